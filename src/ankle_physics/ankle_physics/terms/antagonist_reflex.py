"""The antagonist's reflex responds to plantarflexion.

``torque = -Ga * w^2/(s^2 + 1.6 w s + w^2) * max(-v(t - delay), 0)``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.reflex_arc import MUSCLE_FREQUENCY, ReflexArc
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Values


class AntagonistReflex(ReflexArc):
    """Models the stretch reflex of the shin muscle (tibialis anterior), or the calf's activity
    falling away when it is unloaded; without EMG the two cannot be told apart. It sees the foot's
    velocity, not the calf's reflex input.

    Unloading the calf lowers its activity: Sinkjaer et al. 2000 (J. Physiol. 523, 817). That the
    shin muscle answers as the calf does is by reasoning: both have the same reflex arc.
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
            description="It is the gain from the speed of plantarflexion to the torque.",
            linear=True,
        ),
        Parameter(
            "delay",
            "s",
            0.025,
            0.12,
            0.045,
            "tibialis anterior: 40 to 50 ms short latency, up to 100 ms long latency",
            description="It is the time from the movement to the first muscle activity.",
        ),
        MUSCLE_FREQUENCY,
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        drive = np.maximum(-signals.foot_velocity, 0.0)
        return {"Ga": -self.response_to(drive, values, state)}
