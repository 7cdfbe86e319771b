"""Viscosity of muscles and tissues: ``torque = B * v``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class Viscosity(Term):
    """Models the viscosity of the joint: ``torque = B * foot velocity`` (van 't Veld et al. 2018,
    figure 1).
    """

    name = "viscosity"
    place = Place.INTRINSIC
    searched = False
    sentence = "Muscles and tissues resist in proportion to the speed of the movement."
    parameters = (
        Parameter(
            "B",
            "N.m.s/rad",
            0.0,
            10.0,
            0.63,
            "van 't Veld et al. 2018, section III-A",
            description="It is the torque for each radian per second of the foot's velocity.",
            linear=True,
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"B": signals.foot_velocity}
