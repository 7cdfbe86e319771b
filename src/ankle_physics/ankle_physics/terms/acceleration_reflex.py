"""Reflex to the acceleration of the stretch: ``torque = Gc * w^2/(s^2 + 1.6 w s + w^2) *
max(a(t - delay), 0)``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.reflex_arc import MUSCLE_FREQUENCY, SHORT_LATENCY, ReflexArc
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Values


class AccelerationReflex(ReflexArc):
    """Models that spindles answer the begin of a stretch more than the stretch itself: their
    discharge follows acceleration, too (Schäfer 1967, Experientia 23, 614), and so does reflex
    torque (van der Helm, Schouten, de Vlugt & Brouwn 2002, J. Neurosci. Methods 119, 1).

    It sees the foot's acceleration, not the calf's reflex input.
    """

    name = "acceleration_reflex"
    place = Place.REFLEX_DYNAMICS
    family = "further reflex arc"
    separated_by = "steps of one size with several rise times"
    sentence = "The reflex answers how suddenly a stretch begins, not only how fast it is."
    parameters = (
        Parameter(
            "Gc",
            "N.m.s^2/rad",
            0.0,
            5.0,
            0.2,
            "van der Helm et al. 2002: acceleration gain over velocity gain some hundredths of a "
            "second",
            description="It is the gain from the acceleration of the stretch to the torque.",
            linear=True,
        ),
        SHORT_LATENCY,
        MUSCLE_FREQUENCY,
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        drive = np.maximum(signals.foot_acceleration, 0.0)
        return {"Gc": self.response_to(drive, values, state)}
