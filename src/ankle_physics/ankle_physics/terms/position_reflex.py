"""Reflex to the size of the stretch: ``torque = Gp * w^2/(s^2 + 1.6 w s + w^2) * (x(t - delay) -
xc)``.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np

from ankle_physics.operating_parameters import operating_angle
from ankle_physics.reflex_arc import MUSCLE_FREQUENCY, ReflexArc
from ankle_physics.signals import Signals
from ankle_physics.term import Parameter, Place, State, Values


class PositionReflex(ReflexArc):
    """Models the tonic stretch reflex of length-sensitive (group II) afferents; it holds as long as
    the stretch does.

    Group II afferents take part in the stretch reflex of the ankle: Grey et al. 2001 (J. Physiol.
    534, 925).
    """

    name = "position_reflex"
    place = Place.REFLEX_DYNAMICS
    family = "further reflex arc"
    separated_by = "steps that are held for one second and more"
    sentence = (
        "Reflex activity lasts as long as the stretch is held: it follows position, not only speed."
    )
    parameters: ClassVar[tuple[Parameter, ...]] = (
        Parameter(
            "Gp",
            "N.m/rad",
            0.0,
            500.0,
            20.0,
            "reflex share of the static stiffness: up to a half (Sinkjaer et al. 1988)",
            description="It is the gain from the size of the stretch to the torque of the reflex.",
            linear=True,
        ),
        Parameter(
            "delay",
            "s",
            0.03,
            0.15,
            0.06,
            "group II: 10 to 20 ms later than the short-latency reflex (Grey et al. 2001)",
            description="It is the time from the stretch to the first activity of this reflex.",
        ),
        MUSCLE_FREQUENCY,
        operating_angle("It is the angle from which the stretch is counted."),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        drive = signals.foot_position - values["xc"]
        return {"Gp": self.response_to(drive, values, state)}
