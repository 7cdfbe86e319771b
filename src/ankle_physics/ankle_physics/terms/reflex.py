"""Stretch reflex: delayed, half-wave rectified velocity through a second-order muscle response.

``torque = G * w^2 / (s^2 + 2 z w s + w^2) * max(drive(t - delay), 0)``
"""

from __future__ import annotations

import numpy as np

from ankle_physics.reflex_arc import MUSCLE_DAMPING, MUSCLE_FREQUENCY, ReflexArc
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Values


class Reflex(ReflexArc):
    """Models the reflex pathway of van 't Veld et al. 2018, figure 1 and section III-A (w = 21
    rad/s, z = 0.8, 40 ms).

    The gain multiplies the response, not the input, so that G is a linear parameter; for a constant
    G the two are the same.
    """

    name = "reflex"
    place = Place.REFLEX_DYNAMICS
    searched = False
    sentence = (
        "A stretch makes the calf muscles contract after a delay, in proportion to its speed."
    )
    parameters = (
        Parameter(
            "G",
            "N.m.s/rad",
            0.0,
            100.0,
            10.0,
            "van 't Veld et al. 2018, section III-A: 0 to 20 N.m.s/rad simulated",
            description="It is the gain from the speed of the stretch to the torque of the reflex.",
            linear=True,
        ),
        Parameter(
            "delay",
            "s",
            0.025,
            0.080,
            0.040,
            "van 't Veld et al. 2018, figure 1; short-latency reflex of the calf: 35 to 50 ms",
            description="It is the time from the stretch to the first muscle activity.",
        ),
        MUSCLE_FREQUENCY,
        Parameter(
            "z",
            "1",
            0.3,
            2.0,
            MUSCLE_DAMPING,
            "van 't Veld et al. 2018, section III-A",
            description="It is the damping ratio of the muscle's response.",
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        stretch = np.maximum(signals.drive, 0.0)
        return {"G": self.response_to(stretch, values, state, float(values["z"]))}
