"""Power law of the stretch reflex: ``drive = v1 * (max(v, 0) / v1)^p`` with ``v1 = 1 rad/s``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Turn, Values


class ReflexExponent(Term):
    """Models that spindles signal a low power of velocity (Houk, Rymer & Crago 1981).

    The exponent is 0.3 there (J. Neurophysiol. 46, 143) and 0.5 to 0.6 in Prochazka's work.
    """

    name = "reflex_exponent"
    place = Place.REFLEX_INPUT
    family = "reflex input curve"
    separated_by = "steps of one size with several rise times"
    sentence = "The reflex does not grow in proportion to the speed of the stretch."
    turn = Turn(
        "p",
        1.0,
        "The reflex grows less than in proportion to the speed of the stretch.",
        "The reflex grows more than in proportion to the speed of the stretch: slow stretches "
        "evoke little.",
    )
    parameters = (
        Parameter(
            "p",
            "1",
            0.05,
            4.0,
            0.6,
            "Houk et al. 1981: 0.3; Prochazka & Gorassini 1998: 0.5 to 0.6; above 1: recruitment",
            description=(
                "It is the power of the stretch speed that the reflex follows; 1 means in "
                "proportion."
            ),
            # Evenly over what people have, and a reflex that answers fully or not at all.
            tried=(0.1, 0.23, 0.33, 0.46, 0.64, 0.9, 1.25, 1.75, 2.4, 3.4),
        ),
    )

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        signals.drive = np.maximum(signals.drive, 0.0) ** float(values["p"])
