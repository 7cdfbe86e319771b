"""Stiffness of the muscle that its reflex has activated: ``torque = kr * r * z``, ``z' = v - z /
recovery``, with the reflex' response ``r = w^2/(s^2 + 1.6 w s + w^2) * max(drive, 0)``, delayed.
"""

from __future__ import annotations

import math

import numpy as np

from ankle_physics.memory_elements import YieldingSpring
from ankle_physics.reflex_arc import MUSCLE_FREQUENCY, SHORT_LATENCY, ReflexArc
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Values


class ReflexStiffening(ReflexArc):
    """Models a muscle that is stiffer for as long as its reflex contracts it: a movement back that
    comes while it is contracted takes more torque off than the next stretch adds.

    Stiffness grows with the torque of a muscle (Weiss, Hunter & Kearney 1988, J. Biomech. 21, 539),
    most for movements that are short and soon over (Kirsch, Boskov & Rymer 1994, IEEE Trans.
    Biomed. Eng. 41, 758). The torque of the reflex is not held long enough to be background torque,
    which `activation_stiffness` follows.
    """

    name = "reflex_stiffening"
    place = Place.REFLEX_DYNAMICS
    family = "reflex gain by position"
    # In the three of 128 counted recordings in which nothing stood against it, it stood in for a
    # power law and a threshold of the reflex that the library lacked, and for a slack spindle.
    imitates = True
    separated_by = "movements back at several times after a stretch"
    sentence = "The muscle is stiffer while its reflex contracts it."
    parameters = (
        Parameter(
            "kr",
            "N.m.s/rad^2",
            0.0,
            2000.0,
            100.0,
            "Weiss et al. 1988: 1 to 8 N.m/rad per N.m, times a reflex of 10 N.m.s/rad; more for "
            "short movements",
            description=(
                "It is the stiffness that the muscle gains for each radian per second of its "
                "reflex response."
            ),
            linear=True,
        ),
        SHORT_LATENCY,
        MUSCLE_FREQUENCY,
        Parameter(
            "recovery",
            "s",
            0.05,
            5.0,
            0.5,
            "as of short-range stiffness: the muscle gets used to its length",
            description="It is the time constant with which the muscle gets used to a new length.",
        ),
    )

    def start(self, rate: float, seed: int = 0) -> State:
        return {**super().start(rate, seed), "spring": YieldingSpring(rate)}

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        contraction = self.response_to(np.maximum(signals.drive, 0.0), values, state)
        # Without a yield, and at rest at the first sample, wherever the joint stands.
        stretch = state["spring"].run(signals.foot_position, math.inf, float(values["recovery"]))
        return {"kr": contraction * stretch}
