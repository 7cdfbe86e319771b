"""Damping that follows a power of speed: ``torque = D * v * ((v² + v0²) / v1²)^((p - 1) / 2)`` with
``v1 = 1 rad/s``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values
from ankle_physics.terms.coulomb_friction import FASTEST_CHANGE, SLOWEST_CHANGE


class PowerDamping(Term):
    """Models damping that follows a power of the speed: below 1 in tissue that thins as it is
    sheared (the power law of Ostwald 1925, Kolloid-Z. 36, 99), 2 in a fluid that is turbulent.

    It adds to the viscosity B, which is the case p = 1. Below v0 it is a viscosity: a power below 1
    would have no slope at rest, and what changes its direction faster is friction.
    """

    name = "power_damping"
    place = Place.INTRINSIC
    family = "nonlinear damping"
    separated_by = "steps of one size with several rise times"
    sentence = "The damping does not grow in proportion to the speed of the movement."
    turn = Turn(
        "p",
        1.0,
        "The damping grows less than in proportion to the speed: slow movements are damped more "
        "strongly, for their speed, than fast ones.",
        "The damping grows more than in proportion to the speed: fast movements are damped more "
        "strongly, for their speed, than slow ones.",
    )
    parameters = (
        Parameter(
            "D",
            "N.m.s/rad",
            0.0,
            20.0,
            0.6,
            "the order of B",
            description="It is the torque of the damping at 1 rad/s, for each rad/s.",
            linear=True,
        ),
        Parameter(
            "p",
            "1",
            0.2,
            3.0,
            0.5,
            "Ostwald 1925: 0.2 to 1; a fluid that is turbulent: 2; below 0.2 it is friction",
            description="It is the power of the speed that the damping follows; 1 is viscosity.",
            tried=(0.3, 0.5, 0.7, 1.4, 2.0, 2.7),
        ),
        Parameter(
            "v0",
            "rad/s",
            SLOWEST_CHANGE,
            FASTEST_CHANGE,
            0.03,
            "as friction, which is the power 0 (`coulomb_friction`)",
            tried=(0.03,),
            description="It is the speed below which the damping is a viscosity.",
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        velocity = signals.foot_velocity
        exponent = 0.5 * (float(values["p"]) - 1.0)
        return {"D": velocity * (velocity**2 + float(values["v0"]) ** 2) ** exponent}
