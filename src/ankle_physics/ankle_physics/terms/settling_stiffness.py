"""Stiffness and damping that drift and settle: ``torque = T (1 - exp(-(t - 30 s) / T)) * (kt * (x -
xc) + bt * v)``.
"""

from __future__ import annotations

import numpy as np

from ankle_physics.term import Parameter, Turn, Values
from ankle_physics.terms.stiffness_drift import StiffnessDrift


class SettlingStiffness(StiffnessDrift):
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

    def course(self, since: np.ndarray, values: Values) -> np.ndarray:
        time_constant = float(values["T"])
        return np.asarray(-time_constant * np.expm1(-since / time_constant))
