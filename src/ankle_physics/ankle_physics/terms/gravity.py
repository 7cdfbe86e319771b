"""Weight of foot and footplate: ``torque = m * sin(x - level)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class Gravity(Term):
    """Models the moment of the weight about the ankle axis; `level` is the angle at which the
    centre of mass is straight below the axis.

    Over small movements it is a constant and a stiffness of m * cos(x - level): a recording cannot
    tell it from K, a change of posture can.
    """

    name = "gravity"
    place = Place.INTRINSIC
    searched = False
    sentence = "The weight of foot and footplate adds a torque that depends on the angle."
    parameters = (
        Parameter(
            "m",
            "N.m",
            0.0,
            20.0,
            1.0,
            "foot of 1 kg with its centre 0.05 to 0.1 m from the axis, plate up to 10 times that",
            description=(
                "It is the largest torque of the weight, with the centre of mass level with the "
                "axis."
            ),
            linear=True,
        ),
        Parameter(
            "level",
            "rad",
            -3.2,
            3.2,
            0.0,
            "any posture",
            description="It is the angle at which the weight of foot and plate makes no torque.",
            fitted=False,
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"m": np.sin(signals.foot_position - values["level"])}
