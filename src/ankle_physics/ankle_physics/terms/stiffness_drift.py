"""Stiffness and damping that drift through the recording: ``torque = (t - 30 s) * (kt * (x - xc) +
bt * v)``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values

# K is then the stiffness half a minute into the run, the middle of the shortest trial.
_REFERENCE_TIME = 30.0


class StiffnessDrift(Term):
    """K and B change at the constant rates kt and bt: fatigue, warming up or a new posture."""

    name = "stiffness_drift"
    place = Place.INTRINSIC
    family = "joint follows activation or time"
    separated_by = "the same torque level at the start and at the end"
    sentence = "Stiffness changes steadily in the course of the recording."
    turn = Turn(
        "kt",
        0.0,
        "Stiffness falls steadily in the course of the recording, as with fatigue.",
        "Stiffness rises steadily in the course of the recording.",
    )
    parameters = (
        Parameter(
            "kt",
            "N.m/rad/s",
            -5.0,
            5.0,
            -0.3,
            "a third of K within a minute or two of contraction",
            linear=True,
        ),
        Parameter(
            "bt",
            "N.m/rad",
            -0.05,
            0.05,
            0.0,
            "a third of B within a minute or two: cross-bridges make both",
            linear=True,
        ),
        Parameter(
            "xc",
            "rad",
            -1.0,
            1.0,
            0.0,
            "angle about which the spring acts; range of the ankle joint",
            fitted=False,
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"rate": rate, "count": 0}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        n = len(signals.position)
        time = (state["count"] + np.arange(n)) / state["rate"]
        state["count"] += n
        since = time - _REFERENCE_TIME
        return {
            "kt": since * (signals.foot_position - values["xc"]),
            "bt": since * signals.foot_velocity,
        }
