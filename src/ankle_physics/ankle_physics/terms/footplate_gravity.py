"""Weight of the footplate: ``torque = m * sin(x_plate - level)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Owner, Parameter, Place, State, Term, Values
from ankle_physics.terms.gravity import Gravity


class FootplateGravity(Term):
    """Models the moment of the plate's weight about the axis, as a calibration with the plate empty
    finds it.

    `level` is the angle at which the plate's centre of mass is straight below the axis.
    """

    name = "footplate_gravity"
    place = Place.COUPLING
    belongs_to = Owner.RIG
    searched = False
    sentence = "The weight of the footplate adds a torque that depends on its angle."
    parameters = (
        Parameter(
            "m",
            "N.m",
            0.0,
            20.0,
            0.5,
            "plate of 1 kg with its centre 0.05 m from the axis; heavy plates up to 20 N.m",
            description=(
                "It is the largest torque of the plate's weight, with the plate's centre level "
                "with the axis."
            ),
            linear=True,
        ),
        Gravity.parameter("level"),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"m": np.sin(signals.position - float(values["level"]))}
