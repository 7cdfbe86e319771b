"""Reflex gain that depends on the angle: ``torque = Gx * w^2/(s^2 + 1.6 w s + w^2) * (x - xc) *
max(drive, 0)``, delayed.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.operating_parameters import operating_angle
from ankle_physics.reflex_arc import MUSCLE_FREQUENCY, SHORT_LATENCY, ReflexArc
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Turn, Values


class PositionReflexGain(ReflexArc):
    """Models that a longer calf has a stronger reflex (Mirbagheri, Barbeau & Kearney 2000).

    The gain rises severalfold towards dorsiflexion (Exp. Brain Res. 135, 423).
    """

    name = "position_reflex_gain"
    place = Place.REFLEX_DYNAMICS
    family = "reflex gain by position"
    separated_by = "steps about several mean positions"
    sentence = "The reflex depends on the angle of the foot."
    turn = Turn(
        "Gx",
        0.0,
        "The reflex is weaker when the foot is further up.",
        "The reflex is stronger when the foot is further up.",
    )
    parameters = (
        Parameter(
            "Gx",
            "N.m.s/rad^2",
            -2000.0,
            2000.0,
            100.0,
            "Mirbagheri et al. 2000: G doubles over 0.1 to 0.2 rad; more within small steps",
            description="It says how much the reflex gain grows for each radian of dorsiflexion.",
            linear=True,
        ),
        SHORT_LATENCY,
        MUSCLE_FREQUENCY,
        operating_angle("It is the angle at which G is stated."),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        drive = (signals.foot_position - values["xc"]) * np.maximum(signals.drive, 0.0)
        return {"Gx": self.response_to(drive, values, state)}
