"""Stiffness of active muscles and passive tissues: ``torque = K * (x - x0)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class Stiffness(Term):
    """Models the stiffness of the joint: ``torque = K * (foot position - x0)`` (van 't Veld et al.
    2018, figure 1).

    x0, the angle at which the spring is at rest, is 0 unless given; its torque cannot be told from
    a constant voluntary torque.
    """

    name = "stiffness"
    place = Place.INTRINSIC
    searched = False
    sentence = "Muscles and tissues resist in proportion to the size of the movement."
    parameters = (
        Parameter(
            "K",
            "N.m/rad",
            0.0,
            1000.0,
            100.0,
            "van 't Veld et al. 2018, section III-A: 0 to 200 N.m/rad simulated",
            description="It is the torque for each radian that the foot moves from x0.",
            linear=True,
        ),
        Parameter(
            "x0",
            "rad",
            -1.0,
            1.0,
            0.0,
            "range of the ankle joint; the paper has no offset",
            description="It is the angle at which the spring of the joint is at rest.",
            fitted=False,
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"K": signals.foot_position - values["x0"]}
