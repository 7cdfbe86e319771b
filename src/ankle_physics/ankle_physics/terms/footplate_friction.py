"""Dry friction of the plate's bearing: ``torque = F * tanh(v_plate / v0)``."""

from __future__ import annotations

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import Owner, Parameter, Place, State, Term, Values


class FootplateFriction(Term):
    """Models the friction between plate and frame, as a calibration with the plate empty finds it.

    It acts on the plate's velocity; a recording with a foot strapped on rigidly cannot tell it
    from `coulomb_friction`.
    """

    name = "footplate_friction"
    place = Place.COUPLING
    belongs_to = Owner.RIG
    rest_torque = "F"
    searched = False
    sentence = "The bearing of the footplate opposes every movement with a constant torque."
    parameters = (
        Parameter(
            "F",
            "N.m",
            0.0,
            10.0,
            0.2,
            "bearings and seals of ankle rigs: below 2 N.m",
            description=(
                "It is the torque with which the bearing opposes the movement of the plate."
            ),
            linear=True,
        ),
        Parameter(
            "v0",
            "rad/s",
            0.01,
            1.0,
            0.03,
            "dry bearings a few hundredths; greased ones and seals up to 1 rad/s (Stribeck)",
            description=(
                "It is the speed of the plate within which the friction changes its direction "
                "gradually."
            ),
        ),
    )

    def torque(self, signals: Signals, values: Values, state: State) -> dict[str, np.ndarray]:
        return {"F": np.tanh(signals.velocity / float(values["v0"]))}
