"""Damping that differs between the directions: ``torque = b * max(v, 0)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values


class AsymmetricDamping(Term):
    """Models damping that differs by direction: B in plantarflexion, B + b in dorsiflexion; without
    delay, which tells it from a reflex.

    Lengthening muscle resists more than shortening muscle gives way (Katz 1939: the slopes of the
    force-velocity curve differ by a factor of up to 6).
    """

    name = "asymmetric_damping"
    place = Place.INTRINSIC
    family = "nonlinear damping"
    separated_by = "steps of one size with several rise times"
    sentence = (
        "Moving the foot up is damped differently from moving it down, at once and without "
        "a reflex."
    )
    turn = Turn(
        "b",
        0.0,
        "Moving the foot up is damped less than moving it down, at once and without a reflex.",
        "Moving the foot up is damped more than moving it down, at once and without a reflex.",
    )
    parameters = (
        Parameter(
            "b",
            "N.m.s/rad",
            -5.0,
            5.0,
            0.3,
            "a fraction to a multiple of B (Katz 1939)",
            description=(
                "It is the viscosity that dorsiflexion meets beyond that of plantarflexion."
            ),
            linear=True,
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"b": np.maximum(signals.foot_velocity, 0.0)}
