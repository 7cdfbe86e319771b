"""Inertia of the footplate between actuator and torque sensor: ``torque = Ip * a_plate``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Owner, Parameter, Place, State, Term, Values


class FootplateInertia(Term):
    """Models an inertia that moves with the plate, not with the foot; it can be told from I only
    where the two move differently.
    """

    name = "footplate_inertia"
    place = Place.COUPLING
    belongs_to = Owner.RIG
    searched = False
    sentence = "The torque sensor also feels the inertia of the footplate."
    parameters = (
        Parameter(
            "Ip",
            "kg.m^2",
            0.0,
            0.1,
            0.005,
            "light footplates and boots: 0.002 to 0.02 kg.m^2",
            description="It is the inertia of the plate between actuator and torque sensor.",
            linear=True,
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"Ip": signals.acceleration}
