"""Saturation of the stretch reflex: ``drive = vs * tanh(max(v, 0) / vs)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class ReflexSaturation(Term):
    """Models that the reflex cannot recruit more than its pool: fast stretches evoke no more than
    vs would.

    Reflexes at the ankle level off with velocity: Stein & Kearney 1995 (J. Neurophysiol. 73, 65).
    """

    name = "reflex_saturation"
    place = Place.REFLEX_INPUT
    family = "reflex input curve"
    separated_by = "steps of one size with several rise times"
    sentence = "Beyond a certain speed a faster stretch evokes no larger reflex."
    parameters = (
        Parameter(
            "vs",
            "rad/s",
            0.02,
            10.0,
            1.0,
            "reflex torque levels off between 1 and 5 rad/s (Stein & Kearney 1995)",
            description="It is the speed of the stretch above which the reflex hardly grows.",
            # Evenly over what people have, and a reflex that answers fully or not at all.
            tried=(0.05, 0.13, 0.22, 0.36, 0.6, 1.0, 1.7, 2.8, 4.6, 7.7),
        ),
    )

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        vs = float(values["vs"])
        signals.drive = vs * np.tanh(np.maximum(signals.drive, 0.0) / vs)
