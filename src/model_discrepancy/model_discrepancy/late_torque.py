"""Torque that is read late, where it decides which movement a plate seems to make."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ankle_physics.model import PAPER_TERMS
from ankle_physics.rig_file import RigFile
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.fit.standard_errors import with_errors
from model_discrepancy.problem import Problem, prepare
from model_discrepancy.recording.known_rig import SKEW, on_time

# Delays of the torque channel that are tried where it tells what moved the plate [s], and the steps
# from the best of them to better ones. With 2 ms too much a search still went astray.
TRIED_LATE_S = (-0.008, -0.004, 0.004, 0.008)
LATE_STEPS_S = (0.002, 0.001)
# Of the whitened residual of the base model, that generic regressors predict: in 10 recordings of
# another engine without mismatch, whose servo gives way, 0.59 at most.
UNCLEAR_MOVEMENT = 0.7
# Of the base model's error. With torque that was 6 ms late, delays of 4 and 8 ms left 0.39 and 0.30
# of it, and the right one 0.17.
COARSE_LATE_ERROR, LATE_ERROR = 0.6, 0.4


def late_torque(
    problem: Problem, terms: Sequence[str] = PAPER_TERMS, rig: RigFile | None = None
) -> tuple[float, float] | None:
    """Return by how much the torque channel is late [s], with its standard error, where that
    decides which movement the plate seems to make; None where it does not, or no delay leaves far
    less error.

    Torque that is read late seems to move a plate that gives way after it moved. No delay beside
    the movement that follows from this explains the torque: with 6 ms, an appendage of the plate
    and a mode of the sensor were searched for ten minutes.

    Parameters
    ----------
    problem
        The present one.
    terms, rig
        As `prepare` takes them.
    """
    if problem.servo is not None or SKEW in problem.fitter.held or not problem.gives_way:
        return None
    if problem.told_compliance is None or problem.predicted(problem.base) < UNCLEAR_MOVEMENT:
        return None
    recording = problem.recording

    def put_right(late: float) -> Problem:
        torque = on_time(recording.torque, recording.rate, late)
        return prepare(replace(recording, torque=torque), terms, rig=rig)

    def error(late: float) -> float:
        return put_right(late).base.score

    errors = dict(zip(TRIED_LATE_S, in_parallel(error, TRIED_LATE_S), strict=True))
    best = min(errors, key=lambda late: errors[late])
    if errors[best] > COARSE_LATE_ERROR * problem.base.score:
        return None
    for step in LATE_STEPS_S:
        beside = (best - step, best + step)
        errors |= zip(beside, in_parallel(error, beside), strict=True)
        best = min(errors, key=lambda late: errors[late])
    if errors[best] > LATE_ERROR * problem.base.score:
        return None
    # So near to the right movement a fit tells the rest.
    near = put_right(best)
    fit = with_errors(near.fitter, near.fitter.fit([*near.base.terms, SKEW], near.base.values))
    return best + fit.values[SKEW]["skew"], fit.errors[SKEW]["skew"]
