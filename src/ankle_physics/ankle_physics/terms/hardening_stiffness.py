"""Stiffness that changes with the size of the movement: ``torque = k3 * (x - xc)^3``."""

from __future__ import annotations

import numpy as np

from ankle_physics.operating_angle import operating_angle
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values


class HardeningStiffness(Term):
    """Models odd curvature of the static torque-angle curve (Duffing): hardening for k3 > 0,
    softening for k3 < 0.
    """

    name = "hardening_stiffness"
    place = Place.INTRINSIC
    family = "static curve"
    separated_by = "steps about several mean positions"
    sentence = "Large movements, in either direction, meet a different stiffness than small ones."
    turn = Turn(
        "k3",
        0.0,
        "Large movements, in either direction, meet less stiffness than small ones.",
        "Large movements, in either direction, meet more stiffness than small ones.",
    )
    parameters = (
        Parameter(
            "k3",
            "N.m/rad^3",
            -1e5,
            1e6,
            2e4,
            "K doubles at the end of a step of 0.05 rad for k3 = 1.3e4 N.m/rad^3",
            description="It is the torque that grows with the cube of the angle from xc.",
            linear=True,
        ),
        operating_angle("It is the angle in the middle of the curve."),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"k3": (signals.foot_position - values["xc"]) ** 3}
