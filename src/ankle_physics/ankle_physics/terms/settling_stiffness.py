"""Stiffness and damping that drift and settle: ``torque = T (1 - exp(-(t - 30 s) / T)) * (kt * (x -
xc) + bt * v)``.
"""

from __future__ import annotations

from ankle_physics.run_time import SettlingCourse
from ankle_physics.term import Parameter, Turn
from ankle_physics.terms.stiffness_drift import StiffnessDrift


class SettlingStiffness(SettlingCourse, StiffnessDrift):
    """Models fatigue, creep or warming up that comes to an end: K and B approach their last values
    with the time constant T. kt and bt are the rates of change half a minute into the run.

    With a T that is long against the recording it is `stiffness_drift`. By reasoning: one
    exponential is the simplest course that comes to an end.
    """

    name = "settling_stiffness"
    generalises = ("stiffness_drift",)
    separated_by = "the same torque level at the start, in the middle and at the end"
    sentence = "Stiffness changes and settles in the course of the recording."
    turn = Turn(
        "kt",
        0.0,
        "Stiffness falls and settles in the course of the recording, as with creep.",
        "Stiffness rises and settles in the course of the recording.",
    )
    parameters = (
        *StiffnessDrift.parameters,
        Parameter(
            "T",
            "s",
            20.0,
            150.0,
            40.0,
            "tissue creeps, and muscles tire, within tens of seconds to minutes; what is over "
            "sooner is no drift of the recording",
            description="It is the time constant with which the stiffness settles.",
            tried=(25.0, 60.0),
        ),
    )
