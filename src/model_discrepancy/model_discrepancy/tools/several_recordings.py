"""Several recordings of one rig are searched together: one list of terms, a state for each.

A candidate is screened on every recording and counts by what it gains in all of them together, so
that an effect too weak for one recording is found in three. Every recording keeps its own values of
what belongs to the subject. What belongs to the rig is the same in all of them: its values are
pooled by their errors and held, unless Cochran's Q (1954, Biometrics 10, 101) says that they
differ, or a recording is described worse by one value for all.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from ankle_physics.joint_profile import JointProfile, joint_in_force
from ankle_physics.rig_file import RigFile
from ankle_physics.term import ModelValues, term_library
from model_discrepancy.criticism.remainder import remainder
from model_discrepancy.diagnose import READING_MARGIN
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.base_model import bic_change
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.held_out import held_out
from model_discrepancy.fit.parallel import in_background, in_parallel, side_by_side
from model_discrepancy.fit.standard_errors import with_errors
from model_discrepancy.problem import better_reading, knows_movement_better, prepare
from model_discrepancy.recording.channel_gains import channel_findings, trusted
from model_discrepancy.recording.compliance import Compliance
from model_discrepancy.recording.motion import motion_step
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import faults
from model_discrepancy.recording.servo import identify_servo
from model_discrepancy.recording.torque_reading import TorqueReading
from model_discrepancy.search.found import Progress
from model_discrepancy.search.hypotheses import MOST_TERMS
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import with_term
from model_discrepancy.tools.joint_candidates import best_step, specialised
from model_discrepancy.tools.shared_effects import (
    Member,
    SharedEffect,
    Together,
)

# A standard error below this share of the parameter is not believed: models are not that exact.
LEAST_RELATIVE_ERROR = 0.02
# Evaluations of the refit of a term from which a search begins.
BEGIN_EVALUATIONS = 25


def diagnose_together(
    sources: Sequence[Recording | str | Path],
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
    joint: JointProfile | None = None,
    rig: RigFile | str | Path | None = None,
    begin: ModelValues | None = None,
    reading: TorqueReading | None = None,
) -> Together:
    """Diagnose several recordings of one rig together.

    Parameters
    ----------
    sources
        Recordings or bags, two at least, of different names.
    library
        Terms that may be named; None for all.
    progress
        Called with one line for each step.
    joint
        Whose ranges, units and base model hold; None: those in force.
    rig
        A calibrated rig (or its file), which is taken as known.
    begin
        Terms, with values by symbol, from which a second search begins; of both, the models that
        make all recordings likelier, by BIC, are kept. One search takes what is best first, which
        in several movements may be a stand-in that one of them excludes.
    reading
        How the torque sensor reads what acts on the plate, as one of the recordings told before;
        None: as the rig's file has it.

    Raises
    ------
    BagError
        No such bag.
    DiagnosisError
        Fewer than two recordings, two of one name, or one that cannot be used.
    """
    known = RigFile.load(rig) if isinstance(rig, str | Path) else rig
    with (joint or joint_in_force()).in_force(), side_by_side():
        return in_background(
            lambda: _diagnosed_together(sources, library, progress, known, begin or {}, reading)
        )


def _diagnosed_together(
    sources: Sequence[Recording | str | Path],
    library: Sequence[str] | None,
    progress: Progress,
    known: RigFile | None,
    begin: ModelValues,
    reading: TorqueReading | None,
) -> Together:
    recordings = [s if isinstance(s, Recording) else Recording.from_bag(s) for s in sources]
    _require_usable(recordings)
    readings = [reading] * len(recordings)
    members = _members(recordings, known, progress, readings=readings)
    found, gains = _searched(members, library, progress, begin)
    fits = [m.fit if knows_movement_better(m.problem, m.fit) else None for m in members]
    if any(fits):
        progress("the movement that torque made is known better now: searching again")
        members = _members(recordings, known, progress, fits, readings)
        found, gains = _searched(members, library, progress, begin)
    # A search of all recordings takes minutes, too long for what refines a reading that is known.
    told = [
        better_reading(m.problem, m.fit) if gains and not m.problem.reading.sensor else None
        for m in found.members
    ]
    if any(told):
        progress("what the torque sensor does is known better now: searching again")
        readings = [new or m.problem.reading for new, m in zip(told, found.members, strict=True)]
        members = _members(recordings, known, progress, fits, readings)
        again, its_gains = _searched(members, library, progress, begin)
        if _predicted(again) < _predicted(found) + READING_MARGIN:
            found, gains = again, its_gains
    _settle(found, gains, progress)
    return found


def _predicted(found: Together) -> float:
    """Return the share of the whitened residuals that generic regressors predict on unseen rows,
    the mean of all recordings.
    """
    return float(np.mean([max(m.problem.predicted(m.fit), 0.0) for m in found.members]))


def _require_usable(recordings: Sequence[Recording]) -> None:
    names = [r.name for r in recordings]
    if len(names) < 2:
        raise DiagnosisError("several recordings are two at least; diagnose one by itself")
    if len(set(names)) < len(names):
        raise DiagnosisError(f"two recordings have one name: {', '.join(names)}")
    for recording in recordings:
        reasons = faults(recording)
        if reasons:
            raise DiagnosisError(f"{recording.name} cannot be used: {reasons[0]}")


def _members(
    recordings: Sequence[Recording],
    rig: RigFile | None,
    progress: Progress,
    found: Sequence[Fit | None] = (),
    readings: Sequence[TorqueReading | None] = (),
) -> list[Member]:
    """Make the recordings ready for the search, beside what was found in each before. Those that do
    not tell how far the servo gives way have it from the one that tells it best.
    """
    count = len(recordings)
    each = list(zip(recordings, found or [None] * count, readings or [None] * count, strict=True))
    members = [_member(r, rig, progress, fit, reading) for r, fit, reading in each]
    told = [m.problem.told_compliance for m in members]
    known = [compliance for compliance in told if compliance is not None]
    if not known:
        return members
    best = min(known, key=lambda compliance: compliance.magnitude[1])
    return [
        _member(r, rig, progress, fit, reading, best) if compliance is None else member
        for (r, fit, reading), member, compliance in zip(each, members, told, strict=True)
    ]


def _member(
    recording: Recording,
    rig: RigFile | None,
    progress: Progress,
    found: Fit | None,
    reading: TorqueReading | None,
    compliance: Compliance | None = None,
) -> Member:

    def report_progress(line: str) -> None:
        progress(f"{recording.name}: {line}")

    findings = channel_findings(recording, identify_servo(recording, motion_step(recording)))
    usable, terms = trusted(recording, findings), joint_in_force().terms
    problem = prepare(usable, terms, report_progress, rig, found, compliance, reading)
    rows = problem.fitter.rows
    return Member(problem, Null.of(problem.noise, rows.time, rows.used), problem.base)


def _searched(
    members: list[Member], library: Sequence[str] | None, progress: Progress, begin: ModelValues
) -> tuple[Together, dict[str, float]]:
    """Return what is found from the base models or from given terms, whichever makes all recordings
    likelier, and the joint gain of each term by its name.
    """
    found = Together(members)
    gains = _search(found, library, progress, {})
    if not begin:
        return found, gains
    progress("searching once more from the effects that are known")
    other = Together([Member(m.problem, m.null, m.problem.base) for m in members])
    other_gains = _search(other, library, progress, _begun(other, begin))
    change = sum(
        bic_change(m.problem.fitter, m.fit, o.fit)
        for m, o in zip(found.members, other.members, strict=True)
    )
    return (other, other_gains) if change < 0.0 else (found, gains)


def _begun(found: Together, begin: ModelValues) -> dict[str, float]:
    """Put those of the given terms into all models that make all recordings likelier, one after
    the other, and return the joint gain of each.
    """
    gains = {}
    for name, values in begin.items():
        old = [m.fit for m in found.members]
        new = [
            m.problem.fitter.fit(
                with_term(m.fit.terms, name),
                {**m.fit.values, name: dict(values)},
                evaluations=BEGIN_EVALUATIONS,
            )
            for m in found.members
        ]
        fitters = [m.problem.fitter for m in found.members]
        if sum(map(bic_change, fitters, old, new)) >= 0.0:
            continue
        gains[name] = 1.0 - sum(fit.score for fit in new) / sum(fit.score for fit in old)
        for member, fit in zip(found.members, new, strict=True):
            member.fit = fit
    return gains


def _search(
    found: Together,
    library: Sequence[str] | None,
    progress: Progress,
    gains: dict[str, float],
) -> dict[str, float]:
    """Add terms to all models while they are worth it; the joint gain of each by its name, beside
    those that the models hold.
    """
    while len(gains) < MOST_TERMS:
        progress(f"looking for term {len(gains) + 1}: screening all recordings")
        best = best_step(found, library, progress)
        if best is None:
            break
        name, fits, gain = best
        for member, fit in zip(found.members, fits, strict=True):
            fitter = member.problem.fitter
            member.fit = fitter.fit(fit.terms, fit.values, evaluations=15)
        gains[name] = gain
    return specialised(found, gains)


def _settle(found: Together, gains: dict[str, float], progress: Progress) -> None:
    """Compare the recordings' values, share what is the rig's, and score everything."""
    for member in found.members:
        member.fit = with_errors(member.problem.fitter, member.fit)
    held: ModelValues = {}
    shares = _shares(gains)
    for name, gain in gains.items():
        effect = _compared(found.members, name, gain, shares[name])
        if effect.shared:
            progress(f"{name} with one value in all recordings")
            pooled = held | {name: _pooled(effect, found.members[0].fit.values[name])}
            effect = replace(effect, excess=_excess(found.members, pooled))
            held = pooled if effect.shared else held
        found.effects.append(effect)
    for member in found.members:
        progress(f"{member.name}: scoring on unseen data")
        problem = member.problem
        fitter = problem.fitter.holding(held)
        if held:
            member.fit = with_errors(fitter, fitter.fit(member.fit.terms, member.fit.values))
        member.base = held_out(problem.fitter, problem.base)
        member.final = held_out(fitter, member.fit)
        member.after = remainder(
            problem.bank,
            fitter,
            member.fit.residual,
            member.fit.plain,
            problem.parts,
            member.null.noise,
        )


def _shares(gains: Mapping[str, float]) -> dict[str, float]:
    """Return the share of each term, in the order found, of the error that all take off."""
    left, taken = 1.0, {}
    for name, gain in gains.items():
        taken[name] = left * gain
        left -= taken[name]
    return {name: part / (1.0 - left) for name, part in taken.items()}


def _excess(members: Sequence[Member], held: ModelValues) -> float:
    """Return the largest share by which held values raise the whitened error of a recording."""

    def one(member: Member) -> float:
        fit = member.problem.fitter.holding(held).fit(member.fit.terms, member.fit.values)
        return fit.score / member.fit.score - 1.0

    return max(in_parallel(one, members))


def _compared(members: Sequence[Member], name: str, gain: float, share: float) -> SharedEffect:
    term = term_library()[name]
    values: dict[str, list[tuple[float, float]]] = {}
    q, freedom = 0.0, 0
    for p in term.parameters:
        if not p.fitted:
            continue
        pairs = [
            (m.fit.values[name][p.symbol], m.fit.errors.get(name, {}).get(p.symbol, float("nan")))
            for m in members
        ]
        values[p.key] = pairs
        given = np.array([pair for pair in pairs if np.isfinite(pair[1])])
        if len(given) < 2:
            continue
        least = LEAST_RELATIVE_ERROR * np.abs(given[:, 0]).mean()
        weights = 1.0 / np.maximum(given[:, 1], max(least, 1e-300)) ** 2
        mean = float(weights @ given[:, 0] / weights.sum())
        q += float(weights @ (given[:, 0] - mean) ** 2)
        freedom += len(given) - 1
    same = float(chi2.sf(q, freedom)) if freedom else 1.0
    return SharedEffect(name, term.belongs_to, gain, values, share, same)


def _pooled(effect: SharedEffect, given: Mapping[str, float]) -> dict[str, float]:
    """Return the values by symbol: means of the recordings, weighted by their errors; conventions
    as given.
    """
    pooled = dict(given)
    for p in term_library()[effect.name].parameters:
        pairs = np.array(effect.values.get(p.key, []), dtype=float)
        if not len(pairs):
            continue
        known = np.isfinite(pairs[:, 1]) & (pairs[:, 1] > 0.0)
        errors = np.where(known, pairs[:, 1], np.inf)
        weights = 1.0 / errors**2 if known.any() else np.ones(len(pairs))
        pooled[p.symbol] = float(weights @ pairs[:, 0] / weights.sum())
    return pooled
