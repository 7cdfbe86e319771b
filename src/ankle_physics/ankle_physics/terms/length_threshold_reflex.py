"""Reflex to stretch beyond a length: ``torque = Gp * w^2/(s^2 + 1.6 w s + w^2) * max(x(t - delay) -
xc - threshold, 0)``.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, State, Values
from ankle_physics.terms.position_reflex import PositionReflex


class LengthThresholdReflex(PositionReflex):
    """Models the tonic stretch reflex with the threshold of its length: the motoneurons are silent
    until the muscle is longer (Feldman 1966, Biophysics 11, 925; Feldman & Levin 1995, Behav. Brain
    Sci. 18, 723).
    """

    name = "length_threshold_reflex"
    generalises = ("position_reflex",)
    sentence = "A reflex holds the ankle as soon as it is stretched beyond a certain angle."
    # With a third parameter a search tries fewer values of the other two.
    parameters = (
        PositionReflex.parameter("Gp"),
        replace(PositionReflex.parameter("delay"), tried=(0.04, 0.07, 0.11)),
        replace(PositionReflex.parameter("omega"), tried=(12.0, 30.0)),
        PositionReflex.parameter("xc"),
        Parameter(
            "threshold",
            "rad",
            -0.2,
            0.2,
            0.0,
            "a threshold further from the mean angle is outside the movements of a recording",
            description="It is the stretch, counted from xc, beyond which the reflex acts.",
            tried=(-0.01, 0.0, 0.01),
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        stretch = signals.foot_position - values["xc"] - values["threshold"]
        return {"Gp": self.response_to(np.maximum(stretch, 0.0), values, state)}
