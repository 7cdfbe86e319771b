"""Reflex gain that drifts: ``torque = Gt * w^2/(s^2 + 1.6 w s + w^2) * (t - 30 s) * max(drive,
0)``, delayed.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ankle_physics.reflex_arc import MUSCLE_FREQUENCY, SHORT_LATENCY, ReflexArc
from ankle_physics.run_time import REFERENCE_TIME, RunTime, SteadyCourse
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Turn, Values


class ReflexDrift(SteadyCourse, ReflexArc):
    """Models habituation or fatigue of the reflex at the constant rate Gt; G is the gain half a
    minute into the run. By reasoning: a constant rate is the simplest course.
    """

    name = "reflex_drift"
    place = Place.REFLEX_DYNAMICS
    family = "reflex follows activation or time"
    follows_time = True
    separated_by = "the same torque level at the start and at the end"
    sentence = "The reflex changes steadily in the course of the recording."
    turn = Turn(
        "Gt",
        0.0,
        "The reflex weakens steadily in the course of the recording.",
        "The reflex grows steadily in the course of the recording.",
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "Gt",
            "N.m/rad",
            -5.0,
            5.0,
            -0.05,
            "a half of G within a minute or two",
            description="It says how much the reflex gain changes in each second.",
            linear=True,
        ),
        SHORT_LATENCY,
        MUSCLE_FREQUENCY,
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {**super().start(rate, seed), "run_time": RunTime(rate)}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        time = state["run_time"].advance(len(signals.drive))
        drive = self.course(time - REFERENCE_TIME, values) * np.maximum(signals.drive, 0.0)
        return {"Gt": self.response_to(drive, values, state)}
