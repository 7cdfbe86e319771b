"""Hypotheses about what is missing: each adds one term after the other.

Which of two terms comes first depends on what is still missing, and a search that only ever takes
the best one does not find back from a term that stood in for two others. Where a second candidate
did about as well as the chosen one, the search forks: that hypothesis is followed, too, as long as
it keeps up with the first, and the one of the least BIC wins (a beam search; Lowerre 1976, The
Harpy speech recognition system, Carnegie Mellon University).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ankle_physics.term import term_library
from model_discrepancy.fit.base_model import align, bic_change, has_joint
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.parameter_scale import nonlinear
from model_discrepancy.search.found import REFINEMENT, Effect, Found, Progress, Trial
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import Screened, screen
from model_discrepancy.search.trials import (
    drop_superfluous,
    fixed_errors,
    halves_errors,
    judged,
    refitted,
)

# Of the whitened residual that a candidate promises, to be refitted at all.
MIN_PROMISE = 0.003
# Joint refits per step; the screening's order is right about the first few only.
REFITS_PER_STEP = 4
# Where none of them is accepted, further ones are refitted, up to so many.
MOST_REFITS = 12
# Candidates that gain less than this ratio of the best one's are not refitted to the end.
NEAR_BEST_RATIO = 0.6
# Of those, so many are scored on unseen rows: the best, and those that may generalise better.
SCORED_CANDIDATES = 3
# Of what the screening promised: a refit that takes off less has ended in another minimum, and
# begins again at so many of the best points of the whole grid.
LEAST_OF_PROMISE = 0.8
RESTARTS = 3
# Whitened gains within this ratio are too near to choose by: which of two comes first depends on
# what is still missing.
RIVAL_GAIN_RATIO = 0.5
MOST_TERMS = 9
# A term that makes another one superfluous leaves their number as it was; steps end all the same.
MOST_STEPS = 2 * MOST_TERMS
# Of one or two terms every rival is tried anyway (`exchange`); three and more may stand in for
# others.
LEAST_TERMS_FORKED = 3
# Hypotheses beside the first one; each may take as long as that one.
MOST_FORKS = 2
# A hypothesis that is behind by more than the next term gains, two terms after its fork, stays so.
TERMS_TO_CATCH_UP = 2
BEHIND_RATIO = 1.05


@dataclass
class Fork:
    """Describes a step at which a second candidate did about as well as the one that was chosen.

    Attributes
    ----------
    effects
        Found before it.
    current
        The model with them.
    trial
        The second candidate.
    """

    effects: list[Effect]
    current: Fit
    trial: Trial

    @property
    def gain(self) -> float:
        """Return the smaller gain of both directions on unseen rows."""
        return min(self.trial.held_out)


@dataclass
class Hypothesis:
    """Holds the terms that one order of choices led to.

    Attributes
    ----------
    found
        Its effects and near misses.
    current
        The model with them.
    scores
        Least whitened sum of squares by number of effects.
    forks
        Steps at which it might have gone another way.
    first
        What was accepted at its first step.
    """

    found: Found
    current: Fit
    scores: dict[int, float] = field(default_factory=dict)
    forks: list[Fork] = field(default_factory=list)
    first: list[Trial] = field(default_factory=list)

    @property
    def plausible(self) -> bool:
        """Tell whether the model leaves the joint a plausible inertia."""
        return has_joint(self.current)


class Hypotheses:
    """Follows hypotheses about one recording.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    base
        The base model's fit.
    null
        Surrogates of that noise.
    grids
        Of the library that may be added.
    yardstick
        Gain of a fixed whitening at each frequency of the rows.
    progress
        Called with one line for each step.
    """

    def __init__(
        self,
        fitter: Fitter,
        base: Fit,
        null: Null,
        grids: Grids,
        yardstick: np.ndarray,
        progress: Progress,
    ) -> None:
        self._fitter, self._base, self._null, self._grids = fitter, base, null, grids
        self._yardstick, self._progress = yardstick, progress

    def followed(self, found: Found) -> Hypothesis:
        """Return what was found with as many further terms as are worth it, and the near misses
        beside these.
        """
        effects = [*found.effects, *found.refinements]
        further = Hypothesis(replace(found, effects=effects, refinements=[]), found.final)
        self._follow(further)
        return further

    def best(self) -> Hypothesis:
        """Return the hypothesis of the least BIC, or the one term that explains as much alone."""
        first = best = Hypothesis(Found(self._base, self._base), self._base)
        self._follow(first)
        forks = first.forks if len(first.found.effects) >= LEAST_TERMS_FORKED else []
        for _ in range(min(MOST_FORKS, len(forks))):
            fork = max(forks, key=lambda fork: fork.gain)
            self._progress(f"another hypothesis: {fork.trial.name} first")
            found = Found(self._base, self._base, effects=list(fork.effects))
            other = Hypothesis(found, fork.current)
            self._add(other, fork.trial)
            self._follow(other, leading=best)
            forks = [*(one for one in forks if one is not fork), *other.forks]
            if self._preferred(other, best):
                best = other
        best = self._usual(first.first, best)
        alone = self._alone(first.first, best)
        return alone if alone is not None else best

    def _preferred(self, other: Hypothesis, best: Hypothesis) -> bool:
        """Say whether another hypothesis leaves a plausible joint where the best one does not, or
        has the lesser BIC.
        """
        if other.plausible != best.plausible:
            return other.plausible
        return bic_change(self._fitter, best.current, other.current) < 0.0

    def _usual(self, first: Sequence[Trial], best: Hypothesis) -> Hypothesis:
        """Return the hypothesis that begins with a usual term where it is not behind the best one.

        Each of several terms stands in for a part of the others, so that an error that is smaller
        by some per cent does not tell that an unusual part of a rig is there, and straps are not.
        """
        library, effects = term_library(), best.found.effects
        usual = [t for t in first if library[t.name].usual and not _needless(t, first)]
        if len(effects) < LEAST_TERMS_FORKED or library[effects[0].trial.name].usual or not usual:
            return best
        trial = min(usual, key=lambda trial: trial.fit.score)
        self._progress(f"a hypothesis that begins with what is usual: {trial.name}")
        other = Hypothesis(Found(self._base, self._base), self._base)
        self._add(other, trial)
        self._follow(other)
        near = other.current.score < BEHIND_RATIO * best.current.score
        return other if near or self._preferred(other, best) else best

    def _alone(self, first: Sequence[Trial], best: Hypothesis) -> Hypothesis | None:
        """Return the hypothesis that begins with the one term that explains as much alone as the
        best one does; None where no term does, or the best one begins with it.
        """
        if len(best.found.effects) < 2 or not first:
            return None
        trial = min(first, key=lambda trial: trial.fit.score)
        cut = self._base.score - best.current.score
        open_by_it = trial.fit.score - best.current.score
        if open_by_it > REFINEMENT * cut or trial.name == best.found.effects[0].trial.name:
            return None
        self._progress(f"{trial.name} explains as much alone")
        other = Hypothesis(Found(self._base, self._base), self._base)
        self._add(other, trial)
        self._follow(other)
        return other

    def _follow(self, hypothesis: Hypothesis, leading: Hypothesis | None = None) -> None:
        """Add as many terms as are worth it; stop where the leading hypothesis is well ahead."""
        found, begun = hypothesis.found, len(hypothesis.found.effects)
        for _ in range(MOST_STEPS):
            count = len(found.effects)
            if count >= MOST_TERMS or (
                leading is not None
                and count >= begun - 1 + TERMS_TO_CATCH_UP
                and hypothesis.current.score
                > BEHIND_RATIO * leading.scores.get(count, leading.current.score)
            ):
                return
            self._progress(f"looking for term {count + 1}: screening")
            trials, found.by_chance = self._step(hypothesis.current)
            good = [t for t in trials if t.accepted]
            if not good:
                found.near = trials[:3]
                return
            if not found.effects:
                hypothesis.first = good
            chosen = _chosen(self._fitter, good)
            hypothesis.forks += [
                Fork(list(found.effects), hypothesis.current, other)
                for other in _equal(good)
                if other is not chosen
            ]
            self._add(hypothesis, chosen)

    def _add(self, hypothesis: Hypothesis, trial: Trial) -> None:
        """Add a term and remove what it makes superfluous."""
        found, fitter = hypothesis.found, self._fitter
        current = align(fitter, fitter.fit(trial.fit.terms, trial.fit.values, evaluations=15))
        newest = Effect(trial, fixed_errors(current, self._yardstick))
        found.effects.append(newest)
        hypothesis.current = drop_superfluous(
            fitter, found, newest, current, self._null, self._progress
        )
        count, score = len(found.effects), hypothesis.current.score
        hypothesis.scores[count] = min(score, hypothesis.scores.get(count, score))

    def _step(self, current: Fit) -> tuple[list[Trial], float]:
        """Return the most promising candidates, refitted and scored on unseen rows, best first, and
        what the best one gains by chance.

        Where none of the first few is accepted, those behind them are tried.
        """
        fitter, null, grids = self._fitter, self._null, self._grids
        # The library is tried on the noise once: later models imitate no less of it.
        screened = screen(
            fitter,
            current,
            grids.points(current),
            None if null.observed else null,
        )
        grids.learn(screened)
        by_chance = {s.name: null.threshold(s.name) for s in screened}
        promising = [s for s in screened if s.share > max(MIN_PROMISE, 0.5 * by_chance[s.name])]
        tried: list[Trial] = []
        for begin in range(0, min(len(promising), MOST_REFITS), REFITS_PER_STEP):
            few = promising[begin : begin + REFITS_PER_STEP]
            trials = self._refitted_and_judged(current, few, by_chance)
            trials += special_cases(fitter, current, trials, null)
            tried = _best_of_each([*tried, *trials])
            if any(t.accepted for t in trials):
                break
        if tried:
            return tried, tried[0].by_chance
        return tried, by_chance[screened[0].name] if screened else 0.0  # all terms are in the model

    def _refitted_and_judged(
        self, current: Fit, few: Sequence[Screened], by_chance: dict[str, float]
    ) -> list[Trial]:
        """Return a few candidates, best first; those near the best are refitted to the end and
        scored on unseen rows. Where none of them is accepted, those behind them are.
        """
        promised = {s.name: s.share for s in few}
        behind = []
        for s in few:
            self._progress(f"refitting with {s.name}")
            start = {**current.values, s.name: s.start}
            behind.append(refitted(self._fitter, current, s.name, start, evaluations=5))
        tried: list[Trial] = []
        while behind and not any(t.accepted for t in tried):
            near, behind = _near_best(behind, by_chance)
            if not near:
                break
            tried += self._scored(current, near, promised, by_chance)
        rest = [replace(t, by_chance=by_chance[t.name]) for t in behind]
        return sorted([*tried, *rest], key=lambda t: -t.gain)

    def _scored(
        self,
        current: Fit,
        trials: Sequence[Trial],
        promised: dict[str, float],
        by_chance: dict[str, float],
    ) -> list[Trial]:
        """Return trials refitted to the end, and the best of them scored on unseen rows; those
        behind an accepted one need not be.
        """
        final = [self._refitted_to_the_end(current, t, promised[t.name]) for t in trials]
        leading, scored = 0.0, 0
        for place, t in sorted(enumerate(final), key=lambda entry: -entry[1].gain):
            by = by_chance[t.name]
            if scored < SCORED_CANDIDATES and t.gain > max(by, NEAR_BEST_RATIO * leading):
                final[place] = judged(self._fitter, current, t, by)
                leading = t.gain if leading == 0.0 and final[place].accepted else leading
                scored += 1
            else:
                final[place] = replace(t, by_chance=by)
        return final

    def _refitted_to_the_end(self, current: Fit, trial: Trial, promised: float) -> Trial:
        """Return the trial refitted further, from other points of its grid too where it takes off
        much less than the screening promised.
        """
        fitter, name = self._fitter, trial.name
        best = refitted(fitter, current, name, trial.fit.values)
        if best.gain > LEAST_OF_PROMISE * promised or not nonlinear([name]):
            return best
        (screened,) = screen(fitter, current, {name: self._grids.whole(name)})
        points = sorted(screened.tried, key=lambda entry: -entry[0])[:RESTARTS]
        for _, point in points:
            (start,) = screen(fitter, current, {name: [point]})
            other = refitted(fitter, current, name, {**current.values, name: start.start})
            best = max(best, other, key=lambda t: t.gain)
        return best


def _chosen(fitter: Fitter, good: Sequence[Trial]) -> Trial:
    """Choose the best on unseen rows; among those that do about as well, the one that predicts the
    plain torque best.
    """
    equal = _equal(good)
    return (
        equal[0]
        if len(equal) == 1
        else min(equal, key=lambda t: sum(halves_errors(fitter, t.fit, plain=True)))
    )


def _equal(good: Sequence[Trial]) -> list[Trial]:
    """Return those that gain about as much on unseen rows as the best one, and are not needless.

    One that ends at the bound of its range, as a mode does that imitates a lag, is none of them
    where another does not.
    """
    good = [t for t in good if not _needless(t, good)]
    largest = max(min(t.held_out) for t in good)
    equal = [t for t in good if min(t.held_out) >= RIVAL_GAIN_RATIO * largest]
    return [t for t in equal if not t.at_bound] or equal


def _needless(general: Trial, good: Sequence[Trial]) -> bool:
    """Say whether a special case of a term does as well, but for what its further parameters gain
    by chance.
    """
    return any(
        special.name in term_library()[general.name].generalises
        and general.gain < special.gain + general.by_chance
        for special in good
    )


def special_cases(fitter: Fitter, current: Fit, trials: Sequence[Trial], null: Null) -> list[Trial]:
    """Return the special cases of the accepted terms, refitted from the values of these.

    From a value of the grid a special case may end in another minimum, or promise less than terms
    with more parameters, which crowd it out.

    Parameters
    ----------
    fitter, current
        The present model, and what fits it.
    trials
        Of the general terms, judged.
    null
        What each term gains by chance.
    """
    library = term_library()
    cases = []
    for general in trials:
        for name in library[general.name].generalises if general.accepted else ():
            values = general.fit.values[general.name]
            symbols = [parameter.symbol for parameter in library[name].parameters]
            if set(symbols) <= set(values):
                start = {**general.fit.values, name: {s: values[s] for s in symbols}}
                case = refitted(fitter, current, name, start)
                cases.append(judged(fitter, current, case, null.threshold(name)))
    return cases


def _best_of_each(trials: Sequence[Trial]) -> list[Trial]:
    """Return the best trial of each term, best first."""
    ascending = sorted(trials, key=lambda t: t.gain)
    return sorted({t.name: t for t in ascending}.values(), key=lambda t: -t.gain)


def _near_best(
    trials: Sequence[Trial], by_chance: dict[str, float]
) -> tuple[list[Trial], list[Trial]]:
    """Return the trials that gain about as much as the best one, and the others: the first steps of
    a refit tell which ones are worth the further steps.
    """
    beyond = [t for t in trials if t.gain > 0.5 * by_chance[t.name]]
    best = max((t.gain for t in beyond), default=0.0)
    near = [t for t in beyond if t.gain > NEAR_BEST_RATIO * best]
    return near, [t for t in trials if t not in near]
