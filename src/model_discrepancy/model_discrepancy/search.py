"""The search for missing terms: base fit, screening, joint refit of the best few, accept or stop.

A term is accepted when the whitened error on rows that were not fitted falls by at least 3 % in both
directions between the two halves and BIC falls by more than 50; between 1.5 and 3 % it is tentative.
Deciding by the plain error would never stop: voluntary torque is autocorrelated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field

import numpy as np

from ankle_physics.model import PAPER_TERMS
from ankle_physics.term import Place, term_library
from model_discrepancy.fit import Fit, Fitter, Start
from model_discrepancy.halves import interleaved
from model_discrepancy.screening import candidates, screen

ACCEPTED = 0.03
TENTATIVE = 0.015
BIC_FALL = 50.0
# A rival is excluded when it leaves this much more whitened error than the best one: the yardstick of acceptance.
RIVAL_EXCESS = 0.03
# The screening is linear: a rival may do somewhat better after its refit than it promised.
RIVAL_PROMISE = 0.6
RIVALS_REFITTED = 3
# Joint refits per step; the screening's order is right about the first few only.
REFITTED = 4
# Candidates that gain less than this share of the best one's are not refitted to the end.
CLOSE = 0.8
# Of those, so many are scored on unseen rows: the best, and one that may generalise better.
JUDGED = 2
MOST_TERMS = 6
# Starts of the base fit: its delay and muscle speed have several minima.
BASE_STARTS = tuple({"delay": delay, "omega": omega, "z": 0.8} for delay in (0.035, 0.05) for omega in (10.0, 21.0))

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Trial:
    """One candidate after its joint refit.

    Attributes:
        name: the term.
        fit: the model with it.
        gain: share of the whitened sum of squares that it takes off.
        held_out: the same on unseen rows, in both directions; 0 for candidates far behind the best.
        bic: change of BIC; negative is better.
    """

    name: str
    fit: Fit
    gain: float
    held_out: tuple[float, float]
    bic: float

    @property
    def accepted(self) -> bool:
        """Whether it passes both criteria."""
        return min(self.held_out) >= ACCEPTED and self.bic < -BIC_FALL

    @property
    def tentative(self) -> bool:
        """Whether it passes the weaker one."""
        return min(self.held_out) >= TENTATIVE and self.bic < -BIC_FALL


@dataclass
class Effect:
    """A term that was found, and those that would do instead."""

    trial: Trial
    rivals: list[Trial]
    tentative: bool = False


@dataclass
class Found:
    """Result of a search.

    Attributes:
        base: fit of the base model.
        final: fit of the base model and all accepted terms, with standard errors.
        effects: in the order in which they were found.
        near: best candidates that were not accepted.
        base_score: whitened sum of squares of the base model under the last whitening.
    """

    base: Fit
    final: Fit
    effects: list[Effect] = field(default_factory=list)
    near: list[Trial] = field(default_factory=list)
    base_score: float = 0.0


def fit_base(fitter: Fitter, terms: Sequence[str] = PAPER_TERMS, progress: Progress = lambda _: None) -> Fit:
    """The paper's model refitted from several starts; leaves the fitter whitened by its residual."""
    progress("fitting the base model")
    best = min((fitter.fit(terms, {"reflex": dict(start)}, evaluations=15) for start in BASE_STARTS), key=lambda fit: fit.score)
    for _ in range(2):
        fitter.whiten_by(best)
        starts = [best.values, *({"reflex": dict(start)} for start in BASE_STARTS[:2])]
        best = min((fitter.fit(terms, start, evaluations=25) for start in starts), key=lambda fit: fit.score)
    fitter.whiten_by(best)
    return fitter.fit(terms, best.values)


def search(fitter: Fitter, base: Fit, library: Sequence[str] | None = None, progress: Progress = lambda _: None) -> Found:
    """Add terms to the base model while they are worth it."""
    found = Found(base, base)
    current = base
    while len(found.effects) < MOST_TERMS:
        progress(f"looking for term {len(found.effects) + 1}: screening")
        trials = _step(fitter, current, candidates(current, library), progress)
        good = [t for t in trials if t.accepted] or [t for t in trials if t.tentative]
        if not good:
            found.near = trials[:3]
            break
        best = max(good, key=lambda t: min(t.held_out))
        found.effects.append(Effect(best, [], tentative=not best.accepted))
        current = best.fit
        fitter.whiten_by(current)
        current = fitter.fit(current.terms, current.values, evaluations=15)
        current = _drop_superfluous(fitter, found, current, progress)
    found.final = current
    if found.effects:
        _rivals(fitter, found, library, progress)
    found.final = fitter.with_errors(fitter.fit(current.terms, current.values, evaluations=15, tolerance=1e-5))
    found.base_score = fitter.fit(base.terms, base.values, evaluations=20).score
    return found


def _step(fitter: Fitter, current: Fit, names: Sequence[str], progress: Progress, count: int = REFITTED) -> list[Trial]:
    """The most promising candidates, refitted and scored on unseen rows, best first."""
    screened = [s for s in screen(fitter, current, names) if s.share > 0.003]
    trials = []
    for s in screened[:count]:
        progress(f"refitting with {s.name}")
        trials.append(_try(fitter, current, s.name, {**current.values, s.name: s.start}, evaluations=5))
    best = max((t.gain for t in trials), default=0.0)
    # The first steps of a refit tell which ones are worth the others.
    close = [_try(fitter, current, t.name, t.fit.values) if t.gain > max(0.5 * TENTATIVE, CLOSE * best) else t for t in trials]
    close.sort(key=lambda t: -t.gain)
    judged = []
    before = halves_errors(fitter, current) if any(t.gain > TENTATIVE for t in close) else None
    for place, trial in enumerate(close):
        worth = place < JUDGED and trial.gain > max(TENTATIVE, CLOSE * close[0].gain) and trial.bic < -BIC_FALL
        held_out = halves_gain(before, halves_errors(fitter, trial.fit)) if worth and before else (0.0, 0.0)
        judged.append(Trial(trial.name, trial.fit, trial.gain, held_out, trial.bic))
    return judged


def _try(fitter: Fitter, current: Fit, name: str, start: Start, evaluations: int = 12) -> Trial:
    fit = fitter.fit([*current.terms, name], start, evaluations=evaluations)
    gain = 1.0 - fit.score / current.score
    return Trial(name, fit, gain, (np.nan, np.nan), bic_change(fitter, current, fit))


def bic_change(fitter: Fitter, old: Fit, new: Fit) -> float:
    """BIC of the new fit minus that of the old one."""
    n = int(fitter.rows.used.sum())
    return n * float(np.log(new.score / old.score)) + (new.size - old.size) * float(np.log(n))


def halves_errors(fitter: Fitter, fit: Fit, evaluations: int = 5) -> tuple[float, float]:
    """Whitened sum of squares on each half after a refit to the other one."""
    parts = interleaved(fitter.rows)
    refits = [fitter.fit(fit.terms, fit.values, mask=train, evaluations=evaluations) for train in parts]
    return float(np.sum(refits[0].residual[parts[1]] ** 2)), float(np.sum(refits[1].residual[parts[0]] ** 2))


def halves_gain(old: tuple[float, float], new: tuple[float, float]) -> tuple[float, float]:
    """Share of the whitened error on unseen rows that a new model takes off, in both directions."""
    return 1.0 - new[0] / old[0], 1.0 - new[1] / old[1]


def _drop_superfluous(fitter: Fitter, found: Found, current: Fit, progress: Progress) -> Fit:
    """Remove earlier terms that the later ones made superfluous."""
    for effect in list(found.effects[:-1]):
        name = effect.trial.name
        left = [t for t in current.terms if t != name]
        without = fitter.fit(left, current.values, evaluations=20)
        if 1.0 - current.score / without.score < TENTATIVE:
            progress(f"{name} is superfluous now")
            found.effects.remove(effect)
            current = without
    return current


def _rivals(fitter: Fitter, found: Found, library: Sequence[str] | None, progress: Progress) -> None:
    """For every effect: what it is worth in the final model, and which other terms would do as well."""
    final = found.final
    for effect in found.effects:
        name = effect.trial.name
        progress(f"looking for rivals of {name}")
        without = fitter.fit([t for t in final.terms if t != name], final.values, evaluations=15)
        gain = 1.0 - final.score / without.score
        effect.trial = Trial(name, final, gain, effect.trial.held_out, bic_change(fitter, without, final))
        others = [c for c in candidates(without, library) if c != name]
        promising = [s for s in screen(fitter, without, others) if s.share > RIVAL_PROMISE * gain]
        trials = [_try(fitter, without, s.name, {**without.values, s.name: s.start}, evaluations=8) for s in promising[:RIVALS_REFITTED]]
        effect.rivals = sorted((t for t in trials if t.fit.score < (1.0 + RIVAL_EXCESS) * final.score), key=lambda t: -t.gain)


def place_of(name: str) -> Place:
    """Where in the signal path a term acts."""
    return term_library()[name].place
