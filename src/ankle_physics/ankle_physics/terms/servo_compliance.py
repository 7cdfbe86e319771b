"""Servo and shaft that give way: ``x_plate = servo(x_command - torque / k_a)``."""

from __future__ import annotations

from ankle_physics.term import Parameter, Place, Term


class ServoCompliance(Term):
    """Models a position servo of finite stiffness: a torque T moves the plate by ``-T / k_a`` at
    rest.

    With the servo's natural frequency w the drive has the apparent inertia ``k_a / w^2``:
    ``y'' + 2 z w y' + w^2 y = w^2 (x - T / k_a)``. The loop between plate and torque is closed by
    `ankle_physics.virtual_rig`; the term itself adds no torque.
    """

    name = "servo_compliance"
    place = Place.ACTUATOR
    searched = False
    sentence = "The drive gives way under load, so that the plate moves less than commanded."
    parameters = (
        Parameter(
            "k_a",
            "N.m/rad",
            300.0,
            1e6,
            3000.0,
            "by reasoning: from a soft drive that gives way by a quarter of the movement on an "
            "ankle of 100 N.m/rad to one whose sag no encoder sees",
            description="It is the stiffness with which the drive holds the plate at rest.",
        ),
    )
