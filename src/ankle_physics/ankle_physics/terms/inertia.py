"""Inertia of foot and footplate: ``torque = I * a``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class Inertia(Term):
    """Models the inertia of the foot: ``torque = I * foot acceleration`` (van 't Veld et al. 2018,
    figure 1).
    """

    name = "inertia"
    place = Place.INTRINSIC
    searched = False
    sentence = "The foot resists acceleration by its inertia."
    parameters = (
        Parameter(
            "I",
            "kg.m^2",
            0.0,
            0.1,
            0.0137,
            "van 't Veld et al. 2018, section III-A; foot alone 0.005 to 0.02 kg.m^2",
            description="It is the inertia of foot and footplate about the axis of the ankle.",
            linear=True,
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"I": signals.foot_acceleration}
