"""Reflex gain that follows activation: ``torque = Gn * w^2/(s^2 + 1.6 w s + w^2) * (activation -
Tc) * max(drive, 0)``, delayed.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.operating_parameters import operating_torque
from ankle_physics.reflex_arc import MUSCLE_FREQUENCY, SHORT_LATENCY, ReflexArc
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Turn, Values


class ActivationReflexGain(ReflexArc):
    """Models automatic gain compensation: the reflex grows with the background activity of its
    muscle (Matthews 1986, J. Physiol. 374, 73). G is then the gain at the
    torque ``Tc``.
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
            description=(
                "It says how much the reflex gain grows for each newton metre that the muscle "
                "holds."
            ),
            linear=True,
        ),
        SHORT_LATENCY,
        MUSCLE_FREQUENCY,
        operating_torque("It is the torque at which the reflex has the gain of the model."),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        drive = (signals.activation - values["Tc"]) * np.maximum(signals.drive, 0.0)
        return {"Gn": self.response_to(drive, values, state)}
