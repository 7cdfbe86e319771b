"""Depression between stretches lowers the reflex drive.

``drive = r * v``, ``r' = (1 - r)/recovery - max(v, 0) r / size``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.memory_elements import Structure
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class ReflexDepression(Term):
    """Models that a stretch uses up readiness r, which comes back with time (post-activation
    depression, Hultborn et al. 1996: recovery 0.1 to 10 s).
    """

    name = "reflex_depression"
    place = Place.REFLEX_INPUT
    family = "reflex history"
    separated_by = "pairs of stretches at intervals from 0.2 to 3 s"
    sentence = "A reflex soon after another one is smaller: it needs time to recover."
    parameters = (
        Parameter(
            "size",
            "rad",
            0.002,
            2.0,
            0.06,
            "stretches of a few degrees depress the next reflex",
            description="It is the stretch that uses up most of the readiness of the reflex.",
        ),
        Parameter(
            "recovery",
            "s",
            0.05,
            10.0,
            0.5,
            "Hultborn et al. 1996: up to 10 s; Stein & Kearney 1995: 0.2 to 0.5 s",
            description=(
                "It is the time constant with which the readiness of the reflex comes back."
            ),
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"readiness": Structure(rate)}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        stretch = np.maximum(signals.drive, 0.0)
        signals.drive = stretch * state["readiness"].run(
            stretch, float(values["size"]), float(values["recovery"])
        )
