"""Velocity threshold of the stretch reflex: ``drive = max(v - vt, 0)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class ReflexThreshold(Term):
    """Models that stretches slower than vt do not reach the motoneurons' threshold (Powers,
    Campbell & Rymer 1989).
    """

    name = "reflex_threshold"
    place = Place.REFLEX_INPUT
    family = "reflex input curve"
    separated_by = "steps of one size with several rise times"
    sentence = "Slow stretches evoke no reflex: a velocity threshold has to be passed."
    parameters = (
        Parameter(
            "vt",
            "rad/s",
            0.0,
            3.0,
            0.3,
            "ankle reflexes appear above about 0.2 to 1 rad/s (Powers et al. 1989; Mirbagheri et "
            "al. 2000)",
            description="It is the speed of the stretch below which there is no reflex.",
            tried=(0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6),
        ),
    )

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        signals.drive = np.maximum(signals.drive - float(values["vt"]), 0.0)
