"""Reflex gain that drifts and settles: ``torque = Gt * w^2/(s^2 + 1.6 w s + w^2) * T (1 - exp(-(t -
30 s) / T)) * max(drive, 0)``, delayed.
"""

from __future__ import annotations

from ankle_physics.run_time import SettlingCourse
from ankle_physics.term import Parameter, Turn
from ankle_physics.terms.reflex_drift import ReflexDrift


class SettlingReflex(SettlingCourse, ReflexDrift):
    """Models habituation or fatigue of the reflex that comes to an end: the gain approaches its
    last value with the time constant T. G is the gain, and Gt its rate of change, half a minute
    into the run.

    With a T that is long against the recording it is `reflex_drift`. By reasoning: one exponential
    is the simplest course that comes to an end.
    """

    name = "settling_reflex"
    generalises = ("reflex_drift",)
    separated_by = "the same torque level at the start, in the middle and at the end"
    sentence = "The reflex changes and settles in the course of the recording."
    turn = Turn(
        "Gt",
        0.0,
        "The reflex weakens and settles in the course of the recording, as with habituation.",
        "The reflex grows and settles in the course of the recording.",
    )
    parameters = (
        *ReflexDrift.parameters,
        Parameter(
            "T",
            "s",
            10.0,
            150.0,
            40.0,
            "reflexes habituate, and muscles tire, within tens of seconds to minutes",
            description="It is the time constant with which the reflex settles.",
            tried=(15.0, 40.0),
        ),
    )
