"""The whole diagnosis of one recording: recording, fit, search, criticism, report.

Each stage hands a typed result to those after it, and none calls a later one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from ankle_physics.joint_profile import JointProfile, joint_in_force
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from model_discrepancy.criticism.criticism import Criticism, criticise
from model_discrepancy.fit.parallel import in_background, side_by_side
from model_discrepancy.fit.standard_errors import with_errors
from model_discrepancy.late_torque import late_torque
from model_discrepancy.problem import (
    Problem,
    better_reading,
    knows_movement_better,
    prepare,
    with_better_course,
)
from model_discrepancy.recording.channel_gains import Finding
from model_discrepancy.recording.reading import Reading, check, open_recording
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.torque_reading import TorqueReading
from model_discrepancy.report.conclusion import conclude
from model_discrepancy.report.result_folder import write_results
from model_discrepancy.report.verdict import Verdict
from model_discrepancy.search.found import Found, Progress
from model_discrepancy.search.null import Null
from model_discrepancy.search.term_search import choose_anew, complete, search
from model_discrepancy.search.time_limit import TimeLimit, time_is_over, time_limit

# Share of the whitened residual that generic regressors predict on unseen rows. Where it is less,
# few terms have a wrong shape, and none is chosen anew: of what a search for nine terms of our own
# equations left, they predicted 6 %, of what those in human trials left 9 to 35 %.
LEAST_MISSHAPEN = 0.07
# Of the whitened residual, that generic regressors may predict by chance in one of two movements
# and not in the other. Where more is predictable once the torque sensor is undone, what was found
# of it stands for something else.
READING_MARGIN = 0.01


@dataclass
class Diagnosis:
    """Holds what the stages of a diagnosis found; the verdict alone where the recording is bad.

    Attributes
    ----------
    recording
        As it was read.
    verdict
        The conclusion.
    problem
        The recording made ready for the search, with the base model's fit.
    found
        The terms that the search added.
    criticism
        What base and final model leave unexplained.
    findings
        What is wrong with a channel, which was put right before the search.
    """

    recording: Recording
    verdict: Verdict
    problem: Problem | None = None
    found: Found | None = None
    criticism: Criticism | None = None
    findings: Sequence[Finding] = ()


def diagnose(
    source: Recording | str | Path,
    out: str | Path | None = None,
    model: str | Path | Model | None = None,
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
    joint: JointProfile | None = None,
    rig: RigFile | str | Path | None = None,
    at_most: float | None = None,
) -> Diagnosis:
    """Diagnose a recording or a bag, at a low priority: a graph that runs meanwhile comes first.

    Parameters
    ----------
    source
        A recording, or a bag's path.
    out
        Folder for ``verdict.json``, ``base.yaml``, ``model.yaml`` and ``report.html``; None writes
        nothing.
    model
        A model (or its file) that replaces the paper's as the baseline.
    library
        Terms that may be named; None for all.
    progress
        Called with one line for each step.
    joint
        Whose ranges, units and base model hold; None: those in force, which are an ankle's.
    rig
        A calibrated rig (or its file), which is taken as known: its zeros, delays and terms.
    at_most
        Time after which the search adds no further terms [min]; what was found by then is weighed
        and criticised, which takes longer than that. None: it goes on as long as something is
        worth it, so that the result is the same on every computer.

    Raises
    ------
    BagError
        No such bag.
    ModelError
        The model cannot be read.
    ankle_interfaces.errors.QuantityError
        The time is out of range.
    """
    with (joint or joint_in_force()).in_force(), side_by_side(), time_limit(at_most) as limit:
        known = RigFile.load(rig) if isinstance(rig, str | Path) else rig
        return in_background(
            lambda: _diagnose_and_write(source, out, model, library, progress, known, limit)
        )


def _diagnose_and_write(
    source: Recording | str | Path,
    out: str | Path | None,
    model: str | Path | Model | None,
    library: Sequence[str] | None,
    progress: Progress,
    rig: RigFile | None,
    limit: TimeLimit | None,
) -> Diagnosis:
    """Diagnose a recording or a bag by the ranges and units in force, and write what was found."""
    progress("reading")
    recording = open_recording(source)
    baseline = Model.load(model) if isinstance(model, str | Path) else model
    progress("checking the channels")
    reading = check(recording)
    if reading.faults:
        diagnosis = Diagnosis(recording, Verdict("bad_recording", reasons=reading.faults))
    else:
        diagnosis = _diagnose(reading, baseline, library, progress, rig)
    diagnosis.verdict.reasons += list(diagnosis.recording.notes)
    if limit is not None and limit.left_something_out:
        diagnosis.verdict.reasons.append(limit.reason)
    if rig is not None:
        diagnosis.verdict.rig["known"] = rig.title
        diagnosis.verdict.reasons.append(
            f"the rig '{rig.title}', calibrated {rig.calibrated:%Y-%m-%d}, is taken as known"
        )
    if out is not None:
        progress("writing the report")
        write_results(diagnosis, rig, Path(out))
    return diagnosis


def _searched(
    problem: Problem,
    library: Sequence[str] | None,
    progress: Progress,
    before: Found | None = None,
) -> tuple[Found, Null]:
    """Return what a search finds, perhaps after another one, and the null distribution that it was
    judged by.
    """
    null = Null.of(problem.noise, problem.fitter.rows.time, problem.fitter.rows.used)
    progress("asking what chance finds in this recording's noise")
    return search(problem.fitter, problem.base, null, library, progress, before), null


def _diagnose(
    reading: Reading,
    baseline: Model | None,
    library: Sequence[str] | None,
    progress: Progress,
    rig: RigFile | None,
) -> Diagnosis:
    """Take a usable recording through all stages."""
    terms = (
        joint_in_force().terms
        if baseline is None
        else tuple(e.term.name for e in baseline.entries if e.term.name != "voluntary_torque")
    )
    problem = prepare(reading.trusted, terms, progress, rig)
    late = late_torque(problem, terms, rig)
    if late is not None:
        progress(f"torque that is {1000.0 * late[0]:g} ms late explains far more")
        reading = reading.on_time(*late)
        problem = prepare(reading.trusted, terms, progress, rig)
    found, null = _searched(problem, library, progress)
    if found.effects and knows_movement_better(problem, found.final) and not time_is_over():
        progress("the movement that torque made is known better now: searching again")
        problem = prepare(reading.trusted, terms, progress, rig, found.final)
        found, null = _searched(problem, library, progress, found)
    told = _told_reading(problem, found)
    if told is not None and not time_is_over():
        progress("what the torque sensor does is known better now: searching again")
        other = prepare(reading.trusted, terms, progress, rig, reading=told)
        again, its_null = _searched(other, library, progress)
        before = max(problem.predicted(found.final), 0.0)
        if other.predicted(again.final) < before + READING_MARGIN:
            problem, found, null = other, again, its_null
    better = with_better_course(problem, found.final) if found.effects else None
    if better is not None and not time_is_over():
        progress("the torque that the muscles hold is known better now: searching again")
        problem = better
        found, null = _searched(problem, library, progress)
    if is_misshapen(problem, found):
        found = choose_anew(problem.fitter, found, null, library, progress)
    complete(problem.fitter, found, null, library, progress)
    if reading.findings and found.effects:
        # What would be no mismatch beside sound channels is none beside one that was put right.
        alone = criticise(problem, found, null, [], progress)
        if alone.verdict == "no_mismatch":
            found = found.nameless(with_errors(problem.fitter, found.base))
    criticism = criticise(problem, found, null, reading.findings, progress)
    verdict = conclude(reading.recording, problem, found, criticism, reading.findings, baseline)
    return Diagnosis(reading.recording, verdict, problem, found, criticism, reading.findings)


def _told_reading(problem: Problem, found: Found) -> TorqueReading | None:
    """Return how the torque sensor reads, as what was found tells; None where it says nothing new,
    or beside many terms, where a mode of the sensor is as likely to stand in for something else.
    """
    if not found.effects or found.needs_many_terms:
        return None
    return better_reading(problem, found.final)


def is_misshapen(problem: Problem, found: Found) -> bool:
    """Say whether so much of the recording is still predictable beside so many terms that some of
    them are likely to stand for others.

    Parameters
    ----------
    problem
        The recording.
    found
        What the last search found in it.
    """
    return found.needs_many_terms and problem.predicted(found.final) > LEAST_MISSHAPEN
