"""Dry friction of the plate's bearing: ``torque = F * tanh(v_plate / v0)``."""

from __future__ import annotations

from ankle_physics.term import Parameter
from ankle_physics.terms.coulomb_friction import CoulombFriction


class FootplateFriction(CoulombFriction):
    """Models the friction between plate and frame as a calibration with the plate empty finds it,
    for rig files.

    It is the equation of `coulomb_friction`, which is what a recording with a foot on the plate
    finds; greased bearings of an empty plate turn more gradually.
    """

    name = "footplate_friction"
    family = ""
    separated_by = ""
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
        CoulombFriction.parameter("T"),
    )
