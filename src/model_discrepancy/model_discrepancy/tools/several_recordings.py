"""Several recordings of one rig are searched together: one list of terms, a state for each.

A candidate is screened on every recording and counts by what it gains in all of them together, so
that an effect too weak for one recording is found in three. Every recording keeps its own values of
what belongs to the subject. What belongs to the rig is the same in all of them: its values are
pooled by their errors and held, unless Cochran's Q (1954, Biometrics 10, 101) says that they
differ.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from ankle_physics.joint_profile import JointProfile, joint_in_force
from ankle_physics.rig_file import RigFile
from ankle_physics.term import Owner, term_library
from model_discrepancy.criticism.remainder import remainder
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.held_out import held_out
from model_discrepancy.fit.parallel import in_background, side_by_side
from model_discrepancy.fit.parameter_scale import nonlinear
from model_discrepancy.problem import knows_movement_better, prepare
from model_discrepancy.recording.channel_gains import channel_findings, trusted
from model_discrepancy.recording.motion import motion_step
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import faults
from model_discrepancy.recording.servo import identify_servo
from model_discrepancy.search.candidates import (
    FURTHER_EVALUATIONS,
    LARGE_PROMISE,
    LEAST_OF_PROMISE,
    MIN_PROMISE,
    REFITS_PER_STEP,
    begun_anew,
)
from model_discrepancy.search.found import Progress, follows_beyond_chance
from model_discrepancy.search.hypotheses import MOST_TERMS
from model_discrepancy.search.null import Null, thresholds
from model_discrepancy.search.screening import (
    Point,
    Screened,
    candidates,
    grid,
    screen,
    with_term,
    without_term,
)
from model_discrepancy.search.trials import halves_errors, preceding_errors
from model_discrepancy.tools.shared_effects import (
    LEAST_PROBABILITY_SAME,
    Member,
    SharedEffect,
    Together,
)

# A standard error below this share of the parameter is not believed: models are not that exact.
LEAST_RELATIVE_ERROR = 0.02


def diagnose_together(
    sources: Sequence[Recording | str | Path],
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
    joint: JointProfile | None = None,
    rig: RigFile | str | Path | None = None,
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

    Raises
    ------
    BagError
        No such bag.
    DiagnosisError
        Fewer than two recordings, two of one name, or one that cannot be used.
    """
    known = RigFile.load(rig) if isinstance(rig, str | Path) else rig
    with (joint or joint_in_force()).in_force(), side_by_side():
        return in_background(lambda: _diagnosed_together(sources, library, progress, known))


def _diagnosed_together(
    sources: Sequence[Recording | str | Path],
    library: Sequence[str] | None,
    progress: Progress,
    known: RigFile | None,
) -> Together:
    recordings = [s if isinstance(s, Recording) else Recording.from_bag(s) for s in sources]
    _require_usable(recordings)
    members = [_member(r, known, progress) for r in recordings]
    found = Together(members)
    gains = _search(found, library, progress)
    fits = [m.fit if knows_movement_better(m.problem, m.fit) else None for m in members]
    if any(fits):
        progress("the movement that torque made is known better now: searching again")
        found = Together(
            [_member(r, known, progress, f) for r, f in zip(recordings, fits, strict=True)]
        )
        gains = _search(found, library, progress)
    _settle(found, gains, progress)
    return found


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


def _member(
    recording: Recording, rig: RigFile | None, progress: Progress, found: Fit | None = None
) -> Member:
    """Make a recording ready for the search, beside what was found in it before."""

    def report_progress(line: str) -> None:
        progress(f"{recording.name}: {line}")

    findings = channel_findings(recording, identify_servo(recording, motion_step(recording)))
    usable = trusted(recording, findings)
    problem = prepare(usable, joint_in_force().terms, report_progress, rig, found)
    rows = problem.fitter.rows
    return Member(problem, Null.of(problem.noise, rows.time, rows.used), problem.base)


def _search(found: Together, library: Sequence[str] | None, progress: Progress) -> dict[str, float]:
    """Add terms to all models while they are worth it; the joint gain of each by its name."""
    gains: dict[str, float] = {}
    while len(gains) < MOST_TERMS:
        progress(f"looking for term {len(gains) + 1}: screening all recordings")
        screened = [_screened(m, library, first=not gains) for m in found.members]
        found.by_chance = _joint_chance(found.members)
        best = _best_step(found, screened, progress)
        if best is None:
            break
        name, fits, gain = best
        for member, fit in zip(found.members, fits, strict=True):
            fitter = member.problem.fitter
            member.fit = fitter.fit(fit.terms, fit.values, evaluations=15)
        gains[name] = gain
    return gains


def _screened(member: Member, library: Sequence[str] | None, first: bool) -> dict[str, Screened]:
    fitter, rows = member.problem.fitter, member.problem.fitter.rows
    points = {name: grid(name, rows.count / rows.rate) for name in candidates(member.fit, library)}
    listed = screen(
        fitter,
        member.fit,
        points,
        member.null if first else None,
    )
    return {s.name: s for s in listed}


def _joint_chance(members: Sequence[Member]) -> dict[str, float]:
    """Return the joint gain that each term must exceed: its best in each recording, added up draw
    by draw, which no single point of its grid can exceed.
    """
    scores = np.array([m.fit.score for m in members])
    names = set.intersection(*(set(m.null.gains) for m in members))
    return thresholds(
        {
            name: scores @ np.array([m.null.gains[name] for m in members]) / scores.sum()
            for name in sorted(names)
        }
    )


def _best_step(
    found: Together, screened: list[dict[str, Screened]], progress: Progress
) -> tuple[str, list[Fit], float] | None:
    """Find the term that gains most in all recordings together, with its fits; None where none is
    worth it.
    """
    members = found.members
    scores = np.array([m.fit.score for m in members])
    promise = _promise(members, screened)
    ranked = sorted(promise, key=lambda n: -promise[n])[:REFITS_PER_STEP]
    tried: dict[str, tuple[list[Fit], float]] = {}
    for name in ranked:
        by_chance = found.by_chance.get(name, max(found.by_chance.values()))
        if promise[name] < max(MIN_PROMISE, 0.5 * by_chance):
            continue
        progress(f"refitting all recordings with {name}")
        fits = _refitted(members, name, screened)
        gain = 1.0 - sum(f.score for f in fits) / scores.sum()
        if _accepted(members, fits, name, gain, by_chance):
            tried[name] = fits, gain
    if not tried:
        return None
    best = max(tried, key=lambda name: tried[name][1])
    # A term with fewer parameters is taken where the best one gains no more than chance beyond it.
    least = tried[best][1] - found.by_chance.get(best, 0.0)
    near = [name for name in tried if name == best or tried[name][1] > least]
    simplest = min(near, key=lambda name: (len(term_library()[name].parameters), -tried[name][1]))
    return simplest, *tried[simplest]


def _promise(
    members: Sequence[Member], screened: Sequence[Mapping[str, Screened]]
) -> dict[str, float]:
    """Return the share of all recordings' whitened error that each term takes off at its best point
    of the grid.
    """
    scores = np.array([m.fit.score for m in members])
    names = set.intersection(*(set(s) for s in screened))
    return {
        name: float(scores @ [s[name].share for s in screened]) / scores.sum() for name in names
    }


def _refitted(
    members: Sequence[Member], name: str, screened: list[dict[str, Screened]]
) -> list[Fit]:
    """Return the fit of each recording with one term more; where it takes off much less than a
    large promise, the best of several beginnings.
    """
    fits = []
    for member, start, listed in zip(members, _starts(name, screened), screened, strict=True):
        fitter, current, promised = member.problem.fitter, member.fit, listed[name].share
        begin = {**current.values, name: start}
        fit = fitter.fit(with_term(current.terms, name), begin, evaluations=12)
        short = 1.0 - fit.score / current.score < LEAST_OF_PROMISE * promised
        if short and promised > LARGE_PROMISE and nonlinear([name]):
            points = [point for _, point in listed[name].tried]
            anew = begun_anew(fitter, current, name, points).fit
            fit = min(fit, anew, key=lambda one: one.score)
            fit = fitter.fit(fit.terms, fit.values, evaluations=FURTHER_EVALUATIONS)
        fits.append(fit)
    return fits


def rivals_together(
    found: Together, name: str, library: Sequence[str] | None = None
) -> tuple[dict[str, list[float]], dict[str, float]]:
    """Fit other terms in the place of one that several recordings need together.

    Parameters
    ----------
    found
        What they need together; the joint profile must be in force.
    name
        One of its effects.
    library
        Terms that may be tried; None for all. The most promising `REFITS_PER_STEP` are.

    Returns
    -------
    dict[str, list[float]]
        Whitened error of each term, and of the effect itself, beyond the best of them in each
        recording; 0 is the best.
    dict[str, float]
        Log-likelihood of each below that of the best, over all recordings.
    """
    bare = [
        Member(
            m.problem,
            m.null,
            m.problem.fitter.fit(without_term(m.fit.terms, name), m.fit.values, evaluations=12),
        )
        for m in found.members
    ]
    screened = [_screened(m, library, first=False) for m in bare]
    promise = _promise(bare, screened)
    others = sorted((n for n in promise if n != name), key=lambda n: -promise[n])
    scores = {name: np.array([m.fit.score for m in found.members])}
    for other in others[:REFITS_PER_STEP]:
        scores[other] = np.array([fit.score for fit in _refitted(bare, other, screened)])
    best = np.min(list(scores.values()), axis=0)
    independent = np.array([m.problem.fitter.rows.independent for m in found.members])
    excess = {other: (score / best - 1.0).tolist() for other, score in scores.items()}
    evidence = {
        other: float(0.5 * independent @ np.log(score / best)) for other, score in scores.items()
    }
    return excess, evidence


def _starts(name: str, screened: list[dict[str, Screened]]) -> list[dict[str, float]]:
    """Return where a refit begins: for a rig's term at the one point that suits all recordings."""
    starts = [dict(s[name].start) for s in screened]
    if term_library()[name].belongs_to is not Owner.RIG:
        return starts
    shares = np.array([[share for share, _ in s[name].tried] for s in screened])
    if len({len(s[name].tried) for s in screened}) > 1:
        return starts
    point: Point = screened[0][name].tried[int(np.argmax(shares.sum(axis=0)))][1]
    return [{**start, **point} for start in starts]


def _accepted(
    members: Sequence[Member], fits: Sequence[Fit], name: str, gain: float, by_chance: float
) -> bool:
    """Return whether the joint gain exceeds chance and holds on unseen rows in both directions."""
    if gain <= by_chance:
        return False
    if term_library()[name].follows_torque and not follows_beyond_chance(
        gain, _preceding_gain(members, fits), by_chance
    ):
        return False
    old, new = np.zeros(2), np.zeros(2)
    for member, fit in zip(members, fits, strict=True):
        old += halves_errors(member.problem.fitter, member.fit)
        new += halves_errors(member.problem.fitter, fit)
    return bool(np.all(new < old))


def _preceding_gain(members: Sequence[Member], fits: Sequence[Fit]) -> float | None:
    """Return the joint gain from what the muscles held before each movement; None where that is
    not known of every recording.
    """
    old, new = 0.0, 0.0
    for member, fit in zip(members, fits, strict=True):
        errors = preceding_errors(member.problem.fitter, fit)
        if errors is None:
            return None
        old, new = old + errors[0], new + errors[1]
    return 1.0 - new / old


def _settle(found: Together, gains: dict[str, float], progress: Progress) -> None:
    """Compare the recordings' values, share what is the rig's, and score everything."""
    for member in found.members:
        member.fit = member.problem.fitter.with_errors(member.fit)
    held: dict[str, dict[str, float]] = {}
    for name, gain in gains.items():
        effect = _compared(found.members, name, gain)
        found.effects.append(effect)
        if effect.shared:
            held[name] = _pooled(effect, found.members[0].fit.values[name])
    for member in found.members:
        progress(f"{member.name}: scoring on unseen data")
        problem = member.problem
        fitter = problem.fitter.holding(held)
        if held:
            member.fit = fitter.with_errors(fitter.fit(member.fit.terms, member.fit.values))
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


def _compared(members: Sequence[Member], name: str, gain: float) -> SharedEffect:
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
    shared = term.belongs_to is Owner.RIG and same > LEAST_PROBABILITY_SAME
    return SharedEffect(name, term.belongs_to, gain, values, same, shared)


def _pooled(effect: SharedEffect, given: Mapping[str, float]) -> dict[str, float]:
    """Return the values by symbol: means of the recordings, weighted by their errors; conventions
    as given.
    """
    pooled = dict(given)
    for p in term_library()[effect.name].parameters:
        pairs = np.array(effect.values.get(p.key, []), dtype=float)
        if not len(pairs):
            continue
        errors = np.where(np.isfinite(pairs[:, 1]), pairs[:, 1], np.inf)
        known = np.isfinite(errors) & (errors > 0.0)
        weights = np.where(known, 1.0 / errors**2, 0.0) if known.any() else np.ones(len(pairs))
        pooled[p.symbol] = float(weights @ pairs[:, 0] / weights.sum())
    return pooled
