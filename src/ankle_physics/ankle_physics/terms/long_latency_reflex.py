"""Later reflex response: ``torque = Gl * w^2/(s^2 + 1.6 w s + w^2) * max(drive(t - delay), 0)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import Delay, SecondOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values

# As the short-latency reflex of van 't Veld et al. 2018, section III-A: the muscle is of the same
# kind.
MUSCLE_DAMPING = 0.8


class LongLatencyReflex(Term):
    """Medium- and long-latency components of the stretch reflex (Grey et al. 2001).

    They come after 60 to 80 ms, transcortical ones after 90 to 120 ms (J. Physiol. 534, 925).
    """

    name = "long_latency_reflex"
    place = Place.REFLEX_DYNAMICS
    family = "further reflex arc"
    separated_by = "EMG of the calf beside torque"
    sentence = "A second, later reflex follows the first one."
    parameters = (
        Parameter(
            "Gl",
            "N.m.s/rad",
            0.0,
            100.0,
            3.0,
            "up to the size of the short-latency reflex",
            linear=True,
        ),
        Parameter(
            "delay",
            "s",
            0.06,
            0.2,
            0.095,
            "Grey et al. 2001: group II 60 to 80 ms; transcortical 90 to 120 ms, plus voluntary "
            "reaction from 150 ms",
        ),
        Parameter("omega", "rad/s", 5.0, 80.0, 21.0, "van 't Veld et al. 2018, section III-A"),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {
            "delay": Delay(rate, longest=self.parameter("delay").upper),
            "muscle": SecondOrder(rate),
        }

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        drive = np.maximum(signals.drive, 0.0)
        delayed = state["delay"].run(drive, float(values["delay"]))
        return {"Gl": state["muscle"].run(delayed, float(values["omega"]), MUSCLE_DAMPING)}
