"""Muscle activates faster than it relaxes: lag ``rising`` up, ``falling`` down, of the rectified
drive.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.memory_elements import UnequalLag
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values


class ActivationDynamics(Term):
    """Models that calcium is released within milliseconds and taken up within tenths of a second
    (Zajac 1989, Crit. Rev. Biomed. Eng. 17, 359: 10 to 20 ms up, 40 to 200 ms down).
    """

    name = "activation_dynamics"
    place = Place.REFLEX_INPUT
    family = "reflex lag"
    separated_by = "EMG of the calf beside torque"
    sentence = "The reflex contraction builds up quickly and dies away slowly."
    parameters = (
        Parameter(
            "rising",
            "s",
            0.002,
            0.05,
            0.01,
            "Zajac 1989: 10 to 20 ms",
            description="It is the time constant with which the muscle's activation rises.",
        ),
        Parameter(
            "falling",
            "s",
            0.01,
            0.5,
            0.06,
            "Zajac 1989: 40 to 200 ms",
            description="It is the time constant with which the muscle's activation falls.",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {"lag": UnequalLag(rate)}

    def transform(self, signals: Signals, values: Values, state: State) -> None:
        stretch = np.maximum(signals.drive, 0.0)
        signals.drive = state["lag"].run(stretch, float(values["rising"]), float(values["falling"]))
