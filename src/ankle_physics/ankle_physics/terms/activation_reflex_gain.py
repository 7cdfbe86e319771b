"""Reflex gain that follows activation: ``torque = Gn * w^2/(s^2 + 1.6 w s + w^2) * activation *
max(drive, 0)``, delayed.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import Delay, SecondOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values

# As the short-latency reflex of van 't Veld et al. 2018, section III-A: the muscle is of the same
# kind.
MUSCLE_DAMPING = 0.8


class ActivationReflexGain(Term):
    """Automatic gain compensation: the reflex grows with the background activity of its muscle
    (Matthews 1986, J. Physiol. 374, 73). G is then the gain at zero torque.
    """

    name = "activation_reflex_gain"
    place = Place.REFLEX_DYNAMICS
    family = "reflex follows activation or time"
    follows_torque = True
    separated_by = "holding at several torque levels"
    sentence = "The reflex changes with the torque that the muscle holds."
    turn = Turn(
        "Gn",
        0.0,
        "The reflex is weaker while the muscle holds more torque.",
        "The reflex is stronger while the muscle holds more torque.",
    )
    parameters = (
        Parameter(
            "Gn",
            "s/rad",
            -20.0,
            20.0,
            1.0,
            "Matthews 1986; ankle: gain rises by its own size within 5 to 10 N.m (Toft et al. "
            "1989)",
            linear=True,
        ),
        Parameter("delay", "s", 0.025, 0.08, 0.04, "as the reflex: 35 to 50 ms"),
        Parameter("omega", "rad/s", 5.0, 80.0, 21.0, "van 't Veld et al. 2018, section III-A"),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {
            "delay": Delay(rate, longest=self.parameter("delay").upper),
            "muscle": SecondOrder(rate),
        }

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        drive = signals.activation * np.maximum(signals.drive, 0.0)
        delayed = state["delay"].run(drive, float(values["delay"]))
        return {"Gn": state["muscle"].run(delayed, float(values["omega"]), MUSCLE_DAMPING)}
