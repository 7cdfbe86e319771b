"""The antagonist's reflex responds to plantarflexion.

``torque = -Ga * w^2/(s^2 + 1.6 w s + w^2) * max(-v(t - delay), 0)``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.linear_dynamics import Delay, SecondOrder
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Term, Values

# As the short-latency reflex of van 't Veld et al. 2018, section III-A: the muscle is of the same
# kind.
MUSCLE_DAMPING = 0.8


class AntagonistReflex(Term):
    """Stretch reflex of the shin muscle (tibialis anterior), or the calf's activity falling away
    when it is unloaded; without EMG the two cannot be told apart. It sees the foot's velocity, not
    the calf's reflex input.
    """

    name = "antagonist_reflex"
    place = Place.REFLEX_DYNAMICS
    family = "further reflex arc"
    separated_by = "EMG of the shin muscle"
    sentence = (
        "Moving the foot down evokes a reflex, too: the shin muscle pulls, or the calf lets go."
    )
    parameters = (
        Parameter(
            "Ga",
            "N.m.s/rad",
            0.0,
            100.0,
            3.0,
            "up to the calf's own reflex gain; unloading responses: Sinkjaer et al. 2000",
            linear=True,
        ),
        Parameter(
            "delay",
            "s",
            0.025,
            0.12,
            0.045,
            "tibialis anterior: 40 to 50 ms short latency, up to 100 ms long latency",
        ),
        Parameter("omega", "rad/s", 5.0, 80.0, 21.0, "van 't Veld et al. 2018, section III-A"),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {
            "delay": Delay(rate, longest=self.parameter("delay").upper),
            "muscle": SecondOrder(rate),
        }

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        drive = np.maximum(-signals.foot_velocity, 0.0)
        delayed = state["delay"].run(drive, float(values["delay"]))
        return {"Ga": -state["muscle"].run(delayed, float(values["omega"]), MUSCLE_DAMPING)}
