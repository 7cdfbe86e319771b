"""Stiffness and damping that drift through the recording: ``torque = (t - 30 s) * (kt * (x - xc) +
bt * v)``.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ankle_physics.operating_parameters import operating_angle
from ankle_physics.run_time import REFERENCE_TIME, RunTime, SteadyCourse
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values


class StiffnessDrift(SteadyCourse, Term):
    """Models that K and B change at the constant rates kt and bt: fatigue, warming up or a new
    posture. By reasoning: a constant rate is the simplest course.
    """

    name = "stiffness_drift"
    place = Place.INTRINSIC
    family = "joint follows activation or time"
    follows_time = True
    separated_by = "the same torque level at the start and at the end"
    sentence = "Stiffness changes steadily in the course of the recording."
    turn = Turn(
        "kt",
        0.0,
        "Stiffness falls steadily in the course of the recording, as with fatigue.",
        "Stiffness rises steadily in the course of the recording.",
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "kt",
            "N.m/rad/s",
            -5.0,
            5.0,
            -0.3,
            "a third of K within a minute or two of contraction",
            description="It says how much the stiffness changes in each second.",
            linear=True,
        ),
        Parameter(
            "bt",
            "N.m/rad",
            -0.05,
            0.05,
            0.0,
            "a third of B within a minute or two: cross-bridges make both",
            description="It says how much the viscosity changes in each second.",
            linear=True,
        ),
        operating_angle("It is the angle about which the spring acts."),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"run_time": RunTime(rate)}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        time = state["run_time"].advance(len(signals.position))
        course = self.course(time - REFERENCE_TIME, values)
        return {
            "kt": course * (signals.foot_position - values["xc"]),
            "bt": course * signals.foot_velocity,
        }
