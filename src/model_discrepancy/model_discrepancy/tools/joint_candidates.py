"""The terms that are worth most to several recordings together, beside the model of each.

A term counts by what it gains in all recordings: each keeps its own values, and what belongs to the
rig begins at the one point of the grid that suits all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ankle_physics.term import Owner, term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.parameter_scale import nonlinear
from model_discrepancy.search.candidates import (
    FURTHER_EVALUATIONS,
    LARGE_PROMISE,
    LEAST_OF_PROMISE,
    MIN_PROMISE,
    REFITS_PER_STEP,
    begun_anew,
)
from model_discrepancy.search.found import Progress, follows_beyond_chance
from model_discrepancy.search.null import thresholds
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
from model_discrepancy.tools.shared_effects import Member, Together


def best_step(
    found: Together, library: Sequence[str] | None, progress: Progress
) -> tuple[str, list[Fit], float] | None:
    """Return the term that gains most in all recordings together, the fits with it and the share of
    the whitened error that it takes off; None where no term is worth it.

    Parameters
    ----------
    found
        The present model of each recording; gets what each term gains by chance.
    library
        Terms that may be named; None for all.
    progress
        Called with one line for each refit.
    """
    members = found.members
    # The library is tried on the noise once.
    screened = [_screened(m, library, first=not m.null.observed) for m in members]
    found.by_chance = _joint_chance(members)
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
