"""Damping that weakens with speed: ``torque = D * vs * tanh(v / vs)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values
from ankle_physics.terms.coulomb_friction import FASTEST_CHANGE


class SaturatingDamping(Term):
    """Models damping D for slow movements that levels off at the torque D * vs.

    Resistance to stretch levels off with speed in active muscle (Hill 1938; Krylow & Sandercock
    1997).
    """

    name = "saturating_damping"
    place = Place.INTRINSIC
    family = "nonlinear damping"
    separated_by = "steps of one size with several rise times"
    sentence = "Slow movements are damped more strongly, for their speed, than fast ones."
    parameters = (
        Parameter(
            "D",
            "N.m.s/rad",
            0.0,
            20.0,
            0.6,
            "the order of B",
            description="It is the viscosity that slow movements meet.",
            linear=True,
        ),
        Parameter(
            "vs",
            "rad/s",
            FASTEST_CHANGE,
            5.0,
            0.7,
            "muscle yields above about one muscle length a second, 1 to 3 rad/s at the ankle; "
            "tissue thins in slower movements",
            description="It is the speed above which the torque of the damping hardly grows.",
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        vs = float(values["vs"])
        return {"D": vs * np.tanh(signals.foot_velocity / vs)}
