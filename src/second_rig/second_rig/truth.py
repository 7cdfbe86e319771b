"""What K and G of a recording are: the quantities of its own joint, and others that it could be
held against.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from second_rig.effects.effect import Change
from second_rig.laboratory import Laboratory, with_changes
from second_rig.mechanics import Motion

WITHOUT_SLOPE = frozenset({"reflex_exponent", "reflex_fading", "spindle_slack"})
"""Effects with which no single slope of the reflex exists."""
BENT = frozenset({"reflex_threshold", "reflex_saturation"})
"""Effects with which the slope is that of a part of the velocities."""


@dataclass(frozen=True)
class Impedance:
    """Holds the true impedance of a recording and its operating point.

    Attributes
    ----------
    K, G
        Tangent stiffness and gain of the reflex, as `notes` say [N.m/rad], [N.m.s/rad].
    K_in_the_middle, K_time_average
        Stiffness at the moment in the middle, and its mean in time [N.m/rad].
    G_of_impulse
        Impulse of the torque of all arcs to stretch velocity for each radian of stretch, with the
        gain of the moment in the middle [N.m.s/rad].
    G_time_average
        The mean of the gain in time, whatever velocities were met [N.m.s/rad].
    G_secant
        Drive of the reflex over the stretch velocity that was met [N.m.s/rad].
    G_with_late_reflex
        Short and long latency together [N.m.s/rad].
    mean_position, mean_torque
        [rad], [N.m].
    notes
        What K and G mean in this recording, a sentence each.
    """

    K: float
    G: float
    K_in_the_middle: float
    K_time_average: float
    G_of_impulse: float
    G_time_average: float
    G_secant: float
    G_with_late_reflex: float
    mean_position: float
    mean_torque: float
    notes: tuple[str, ...]


def true_impedance(
    laboratory: Laboratory, hidden: Sequence[str], changes: Sequence[Change], motion: Motion
) -> Impedance:
    """Return the true impedance of what happened.

    Parameters
    ----------
    laboratory
        Without any effect.
    hidden
        Identifiers of the effects.
    changes
        What they change.
    motion
        What happened.
    """
    parameters, courses = with_changes(laboratory, changes)
    clock = laboratory.clock
    within = slice(clock.first, None)
    elastic = parameters.elastic
    x = float(motion.foot[within].mean()) - elastic.mean_position
    slope = np.exp(elastic.rise * x) + 3.0 * elastic.hardening * x * x
    K_in_the_middle = float(elastic.K * slope * courses.stiffness[clock.middle])
    K_time_average = float(elastic.K * slope * courses.stiffness[within].mean())
    if elastic.contraction_gain > 0.0:
        K_time_average *= 1.0 + motion.contraction_share
    G = parameters.reflex.G
    factor = float(courses.stretch[within].mean())
    stretch = np.maximum(motion.velocity[within], 0.0)
    met = float(np.sum(courses.stretch[within] * stretch) / np.sum(stretch))
    G_time_average = G * float(courses.reflex[within].mean()) * factor
    G_secant = G * motion.drive_share * met
    gain_met = float(np.sum(courses.reflex[within] * stretch) / np.sum(stretch))
    in_the_middle = float(courses.reflex[clock.middle]) / gain_met
    stated = G_secant if WITHOUT_SLOPE & set(hidden) else G_time_average
    return Impedance(
        K=K_time_average if "cocontraction" in hidden else K_in_the_middle,
        G=stated,
        K_in_the_middle=K_in_the_middle,
        K_time_average=K_time_average,
        G_of_impulse=G_secant * in_the_middle + parameters.late_reflex.gain * met,
        G_time_average=G_time_average,
        G_secant=G_secant,
        G_with_late_reflex=stated + parameters.late_reflex.gain,
        mean_position=float(clock.sampled(motion.plate).mean()),
        mean_torque=float(clock.sampled(motion.torque).mean()),
        notes=tuple(_notes(hidden)),
    )


def _notes(hidden: Sequence[str]) -> list[str]:
    """Return what K and G mean where these effects are hidden."""
    notes = []
    if "cocontraction" in hidden:
        notes.append(
            "K is taken at the mean activation, which is that of the mean torque: the mean in "
            "time. K_in_the_middle is what applied at that instant."
        )
    if "reflex_contraction" in hidden:
        notes.append("K is without the reflex' contraction; K_time_average includes it.")
    if WITHOUT_SLOPE & set(hidden):
        notes.append(
            "No single slope exists: G is the secant, drive of the reflex over the stretch "
            "velocity that was met."
        )
    if BENT & set(hidden):
        notes.append(
            "G is the local slope, above the threshold or before saturation; G_secant is the "
            "drive over the velocity that was met."
        )
    if "gain_drift" in hidden:
        notes.append("G is the mean in time; G_of_impulse is what applied in the middle.")
    if "late_reflex" in hidden:
        notes.append("G is the short-latency reflex alone; G_with_late_reflex adds the other.")
    return notes
