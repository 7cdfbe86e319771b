"""The terms that are worth most to several recordings together, beside the model of each.

A term counts by what it gains in all recordings: each keeps its own values, and what belongs to the
rig begins at the one point of the grid that suits all of them.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ankle_physics.term import Owner, term_library
from model_discrepancy.fit.base_model import bic
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
from model_discrepancy.search.null import balanced
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
from model_discrepancy.tools.open_set import stretch_errors
from model_discrepancy.tools.shared_effects import Member, Together

# Evaluations of the refit of a special case, which begins at the values of the general one.
SPECIAL_EVALUATIONS = 15


@dataclass(frozen=True)
class Rivals:
    """Holds terms that were fitted in the place of one that several recordings need together.

    Attributes
    ----------
    fits
        Model of each recording with each term, and with the one that was found.
    excess
        Whitened error of each beyond the best of them in each recording; 0 is the best.
    evidence
        Half of the BIC of each above that of the best, over all recordings: how much less likely
        (ln) it is.
    errors
        Whitened squared error that each leaves in each stretch of a recording, an array for each
        recording.
    """

    fits: dict[str, list[Fit]]
    excess: dict[str, list[float]]
    evidence: dict[str, float]
    errors: dict[str, list[np.ndarray]]


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
        special = special_cases_together(members, name, fits)
        for one, refitted in {name: fits, **special}.items():
            gain = 1.0 - _total(refitted) / scores.sum()
            by_chance = found.by_chance.get(one, max(found.by_chance.values()))
            worse = one in tried and tried[one][1] >= gain
            if not worse and _accepted(members, refitted, one, gain, by_chance):
                tried[one] = refitted, gain
    if not tried:
        return None
    best = max(tried, key=lambda name: tried[name][1])
    # A term with fewer parameters is taken where the best one gains no more than chance beyond it.
    least = tried[best][1] - found.by_chance.get(best, 0.0)
    near = [name for name in tried if name == best or tried[name][1] > least]
    simplest = min(near, key=lambda name: (len(term_library()[name].parameters), -tried[name][1]))
    return simplest, *tried[simplest]


def special_cases_together(
    members: Sequence[Member], name: str, fits: Sequence[Fit]
) -> dict[str, list[Fit]]:
    """Return the special cases of a term in its place, refitted from its values, by their names.

    From a value of the grid a special case may end in another minimum, or promise less than terms
    with more parameters, which crowd it out.

    Parameters
    ----------
    members
        The recordings; their present models need not hold the term.
    name
        The general term.
    fits
        The model of each recording with it.
    """
    library = term_library()
    found = {}
    for special in library[name].generalises:
        symbols = [parameter.symbol for parameter in library[special].parameters]
        known = all(set(symbols) <= set(fit.values[name]) for fit in fits)
        if not known or any(special in fit.terms for fit in fits):
            continue
        found[special] = [
            member.problem.fitter.fit(
                with_term(without_term(fit.terms, name), special),
                {**fit.values, special: {s: fit.values[name][s] for s in symbols}},
                evaluations=SPECIAL_EVALUATIONS,
            )
            for member, fit in zip(members, fits, strict=True)
        ]
    return found


def specialised(found: Together, gains: Mapping[str, float]) -> dict[str, float]:
    """Put the special case of a general term in its place in all models, where the general one
    takes off no more than by chance beyond it, and return the gains by the names that are left.

    Beside the terms that were found later, and with all values fitted to the end, the general one
    may not be needed.

    Parameters
    ----------
    found
        What all recordings need together; its members' models are changed.
    gains
        Joint gain of each term, in the order in which they were found.
    """
    left = {}
    for name, gain in gains.items():
        fits = [member.fit for member in found.members]
        score = _total(fits)
        left[name] = gain
        for special, others in special_cases_together(found.members, name, fits).items():
            beyond = 1.0 - score / _total(others)
            if special not in gains and beyond < found.by_chance.get(name, 0.0):
                for member, fit in zip(found.members, others, strict=True):
                    member.fit = fit
                left[special] = left.pop(name)
                break
    return left


def rivals_together(found: Together, name: str, library: Sequence[str] | None = None) -> Rivals:
    """Fit other terms in the place of one that several recordings need together.

    Parameters
    ----------
    found
        What they need together; the joint profile must be in force.
    name
        One of its effects.
    library
        Terms that may be tried; None for all. The most promising `REFITS_PER_STEP` are.

        So are the special cases of these and of the effect.
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
    fits = {name: [m.fit for m in found.members]}
    fits |= special_cases_together(bare, name, fits[name])
    for other in others[:REFITS_PER_STEP]:
        fits.setdefault(other, _refitted(bare, other, screened))
        for special, refitted in special_cases_together(bare, other, fits[other]).items():
            if special not in fits or _total(refitted) < _total(fits[special]):
                fits[special] = refitted
    scores = {other: np.array([fit.score for fit in each]) for other, each in fits.items()}
    best = np.min(list(scores.values()), axis=0)
    fitters = [m.problem.fitter for m in found.members]
    criterion = {other: sum(map(bic, fitters, each)) for other, each in fits.items()}
    least = min(criterion.values())
    return Rivals(
        fits,
        {other: (score / best - 1.0).tolist() for other, score in scores.items()},
        {other: 0.5 * (value - least) for other, value in criterion.items()},
        {other: [stretch_errors(fit) for fit in each] for other, each in fits.items()},
    )


def _total(fits: Sequence[Fit]) -> float:
    return sum(fit.score for fit in fits)


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
    names = sorted(set.intersection(*(set(m.null.gains) for m in members)))
    least = balanced(
        [scores @ np.array([m.null.gains[name] for m in members]) / scores.sum() for name in names]
    )
    return dict(zip(names, least.tolist(), strict=True))


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
