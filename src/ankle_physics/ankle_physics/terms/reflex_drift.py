"""Reflex gain that drifts: ``torque = Gt * w^2/(s^2 + 1.6 w s + w^2) * (t - 30 s) * max(drive,
0)``, delayed.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import Delay, SecondOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values

# As the short-latency reflex of van 't Veld et al. 2018, section III-A: the muscle is of the same
# kind.
MUSCLE_DAMPING = 0.8


class ReflexDrift(Term):
    """Habituation or fatigue of the reflex at the constant rate Gt; G is the gain half a minute
    into the run.
    """

    name = "reflex_drift"
    place = Place.REFLEX_DYNAMICS
    family = "reflex follows activation or time"
    separated_by = "the same torque level at the start and at the end"
    sentence = "The reflex changes steadily in the course of the recording."
    turn = Turn(
        "Gt",
        0.0,
        "The reflex weakens steadily in the course of the recording.",
        "The reflex grows steadily in the course of the recording.",
    )
    parameters = (
        Parameter(
            "Gt", "N.m/rad", -5.0, 5.0, -0.05, "a half of G within a minute or two", linear=True
        ),
        Parameter("delay", "s", 0.025, 0.08, 0.04, "as the reflex: 35 to 50 ms"),
        Parameter("omega", "rad/s", 5.0, 80.0, 21.0, "van 't Veld et al. 2018, section III-A"),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {
            "rate": rate,
            "count": 0,
            "delay": Delay(rate, longest=self.parameter("delay").upper),
            "muscle": SecondOrder(rate),
        }

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        count = len(signals.drive)
        time = (state["count"] + np.arange(count)) / state["rate"]
        state["count"] += count
        drive = (time - 30.0) * np.maximum(signals.drive, 0.0)
        delayed = state["delay"].run(drive, float(values["delay"]))
        return {"Gt": state["muscle"].run(delayed, float(values["omega"]), MUSCLE_DAMPING)}
