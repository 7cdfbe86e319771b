"""Stiffness that changes with the size of the movement.

``torque = k1 * (x - xc)^2 / 2 + k3 * (x - xc)^3``
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ankle_physics.operating_parameters import operating_angle
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values
from ankle_physics.terms.position_dependent_stiffness import STIFFNESS_SLOPE


class HardeningStiffness(Term):
    """Models a static torque-angle curve with a turning point: hardening on either side of it for
    k3 > 0, softening for k3 < 0.

    The turning point need not be the mean angle xc: it lies at ``xc - k1 / (6 k3)``. The cubic
    spring is that of Duffing 1918 (Erzwungene Schwingungen bei veränderlicher Eigenfrequenz).
    """

    name = "hardening_stiffness"
    place = Place.INTRINSIC
    family = "static curve"
    generalises = ("position_dependent_stiffness",)
    separated_by = "steps about several mean positions"
    sentence = "Large movements, in either direction, meet a different stiffness than small ones."
    turn = Turn(
        "k3",
        0.0,
        "Large movements, in either direction, meet less stiffness than small ones.",
        "Large movements, in either direction, meet more stiffness than small ones.",
    )
    parameters = (
        replace(STIFFNESS_SLOPE, default=0.0),
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
        operating_angle("It is the angle from which the movement is counted."),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        angle = signals.foot_position - values["xc"]
        square = angle**2
        return {"k1": 0.5 * square, "k3": square * angle}
