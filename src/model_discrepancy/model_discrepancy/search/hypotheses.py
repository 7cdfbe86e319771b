"""Hypotheses about what is missing: each adds one term after the other.

Which of two terms comes first depends on what is still missing, and a search that only ever takes
the best one does not find back from a term that stood in for two others. Where a second candidate
did about as well as the chosen one, the search forks: hypotheses are followed side by side, each as
long as it keeps up with the others, and the one of the least BIC wins (a beam search; Lowerre 1976,
The Harpy speech recognition system, Carnegie Mellon University).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ankle_physics.term import term_library
from model_discrepancy.fit.base_model import ALIGNMENT, align, bic_change
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.search.candidates import Candidates
from model_discrepancy.search.found import (
    MOST_EXACT_TERMS,
    REFINEMENT,
    Effect,
    Found,
    Progress,
    Trial,
    is_usual,
)
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.hypothesis import Fork, Hypothesis
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import with_turning
from model_discrepancy.search.time_limit import time_is_over
from model_discrepancy.search.trials import (
    best_of_equals,
    drop_superfluous,
    equals,
    fixed_errors,
    is_needless,
    judged,
    refitted,
)

# A real rig and a real ankle depart from each equation a little. With twelve instead of nine terms,
# models of two human trials left about half as much of their whitened residual predictable.
MOST_TERMS = 12
# A term that makes another one superfluous leaves their number as it was; steps end all the same.
MOST_STEPS = 2 * MOST_TERMS
# Of one or two terms every rival is tried anyway (`exchange`); three and more may stand in for
# others.
LEAST_TERMS_FORKED = 3
# Trials behind the last accepted term that are kept: they may criticise the model, and widen the
# errors of K and G.
MOST_NEAR = 3
# Hypotheses beside the first one; each may take as long as that one.
MOST_FORKS = 2
# Hypotheses with this many terms each have shown which of them lasts: further terms correct what no
# equation of theirs is exact about, and take longer with each.
MOST_TERMS_SIDE_BY_SIDE = MOST_EXACT_TERMS + 1
# A hypothesis that is behind by more than this, two terms after the fork, stays so.
BEHIND_RATIO = 1.05
# Of two terms the equations may be exact, so that less decides: as much as takes an effect's odds
# to 1/e (`exchange.ODDS_SCALE`).
BEHIND_RATIO_OF_TWO = 1.01
# One that begins with what is usual is given up where it is behind by so much: each of several
# terms stands in for a part of the others, so that it may be behind until they are there, too.
FAR_BEHIND_RATIO = 1.5


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
        self._fitter, self._base, self._null = fitter, base, null
        self._grids = grids
        self._candidates = Candidates(fitter, null, grids, progress)
        self._yardstick, self._progress = yardstick, progress
        # Those that began with the base model, by their first term.
        self._followed_from: dict[str, Hypothesis] = {}

    def followed(self, found: Found, alone: str = "") -> Hypothesis:
        """Return what was found with as many further terms as are worth it, and the near misses
        beside these.

        Parameters
        ----------
        found
            With the final model.
        alone
            What its lines of progress begin with, where others are followed at the same time; it
            learns on its own then.
        """
        effects = [*found.effects, *found.refinements]
        further = self._begun(replace(found, effects=effects, refinements=[]), found.final)
        if alone:
            self._set_apart(further, alone)
        self._follow(further)
        return further

    def best(self, before: Found | None = None) -> Hypothesis:
        """Return the hypothesis of the least BIC, or the one term that explains as much alone.

        Parameters
        ----------
        before
            What another search found in this recording. Its terms are a hypothesis, too, which
            takes the place of the forks.
        """
        first = self._begun()
        if before is None:
            followed = self._side_by_side(first)
        else:
            self._follow(first)
            followed = [first, self._again(before)]
        best = self._usual(first.first, self._best_of(followed))
        alone = self._alone(first.first, best)
        best = alone if alone is not None else best
        best.found.other_models = [h.current for h in followed if _is_another(h, best)]
        return best

    def _begun(self, found: Found | None = None, current: Fit | None = None) -> Hypothesis:
        """Return a hypothesis with what was found already; nothing beside the base model where
        nothing is given.
        """
        base = self._base
        found = Found(base, base) if found is None else found
        current = base if current is None else current
        begun = len(found.effects)
        return Hypothesis(found, current, self._candidates, self._progress, begun)

    def _side_by_side(self, first: Hypothesis) -> list[Hypothesis]:
        """Return a hypothesis and its forks, followed until each ends or is well behind another;
        the best one alone where all need many terms.

        Those with the fewest terms are the next in turn, so that what is compared is equally long.
        """
        while not first.ended and first.count < LEAST_TERMS_FORKED:
            self._add_one(first)
        followed = [first]
        while active := [hypothesis for hypothesis in followed if not hypothesis.ended]:
            if min(hypothesis.count for hypothesis in active) < MOST_TERMS_SIDE_BY_SIDE:
                followed += (forked := self._forked(followed))
                active += forked
            least = min(hypothesis.count for hypothesis in active)
            in_parallel(self._add_one, [h for h in active if h.count == least])
            for hypothesis in active:
                others = [other for other in followed if other is not hypothesis]
                if any(hypothesis.is_behind(other, BEHIND_RATIO) for other in others):
                    hypothesis.ended = hypothesis.behind = True
            active = [hypothesis for hypothesis in active if not hypothesis.ended]
            if active and min(h.count for h in active) >= MOST_TERMS_SIDE_BY_SIDE:
                best = self._best_of(active)
                for hypothesis in active:
                    if hypothesis is not best:
                        hypothesis.ended = hypothesis.behind = True
        return followed

    def _forked(self, followed: Sequence[Hypothesis]) -> list[Hypothesis]:
        """Return the hypotheses that go another way at the forks of some, as many as there may be
        beside the first one; those that gain most come first.
        """
        left = MOST_FORKS - (len(followed) - 1)
        forks = [(fork, hypothesis) for hypothesis in followed for fork in hypothesis.forks]
        largest = sorted(forks, key=lambda entry: -entry[0].gain)[:left]
        for fork, hypothesis in largest:
            hypothesis.forks.remove(fork)
        return in_parallel(self._another, [fork for fork, _ in largest])

    def _another(self, fork: Fork) -> Hypothesis:
        """Return the hypothesis that goes another way."""
        name = fork.trial.name
        self._progress(f"another hypothesis: {name} first")
        other = self._begun(Found(self._base, self._base, effects=list(fork.effects)), fork.current)
        self._set_apart(other, name)
        self._add(other, fork.trial)
        other.begun = other.count
        if not fork.effects:
            self._followed_from[name] = other
        return other

    def _set_apart(self, hypothesis: Hypothesis, name: str) -> None:
        """Let a hypothesis that is followed beside others learn, and say what it does, alone."""
        hypothesis.progress = lambda step: self._progress(f"{name} first: {step}")
        hypothesis.candidates = self._candidates.alone(hypothesis.progress)

    def _again(self, before: Found) -> Hypothesis:
        """Return the hypothesis of the terms that another search found, as far as they are worth
        it, and of what is worth it beside them.
        """
        self._progress("what was found before")
        other = self._begun()
        for effect in (*before.effects, *before.refinements):
            name = effect.trial.name
            start = {**before.final.values, **other.current.values}
            trial = refitted(self._fitter, other.current, name, start)
            trial = judged(
                self._fitter, other.current, trial, self._null.threshold_of(name, trial.fit)
            )
            if trial.accepted:
                self._add(other, trial)
        self._follow(other)
        return other

    def _best_of(self, followed: Sequence[Hypothesis]) -> Hypothesis:
        """Return the hypothesis that is preferred to all others, the first of equal ones."""
        best = followed[0]
        for other in followed[1:]:
            if self._preferred(other, best):
                best = other
        return best

    def _preferred(self, other: Hypothesis, best: Hypothesis) -> bool:
        """Say whether another hypothesis leaves a plausible joint where the best one does not, or
        has the lesser BIC.
        """
        if other.plausible != best.plausible:
            return other.plausible
        return bic_change(self._fitter, best.current, other.current) < 0.0

    def _usual(self, first: Sequence[Trial], best: Hypothesis) -> Hypothesis:
        """Return the hypothesis that begins with a usual term where it is not behind the best one,
        and this one holds none.

        Each of several terms stands in for a part of the others, so that an error that is smaller
        by some per cent does not tell that an unusual part of a rig is there, and straps are not.
        """
        library, effects = term_library(), best.found.effects
        usual = [t for t in first if library[t.name].usual and not is_needless(t, first)]
        if len(effects) < 2 or any(is_usual(e.trial.name) for e in effects) or not usual:
            return best
        trial = min(usual, key=lambda trial: trial.fit.score)
        self._progress(f"a hypothesis that begins with what is usual: {trial.name}")
        other = self._beginning_with(trial, best)
        ratio = BEHIND_RATIO_OF_TWO if len(effects) == 2 else BEHIND_RATIO
        near = not other.behind and other.current.score < ratio * best.current.score
        return other if near or self._preferred(other, best) else best

    def _alone(self, first: Sequence[Trial], best: Hypothesis) -> Hypothesis | None:
        """Return the hypothesis that begins with the one term that explains as much alone as the
        best one does; None where no term does, or the best one begins with it, or with what is
        usual and as many terms are needed beside this one.
        """
        if len(best.found.effects) < 2 or not first:
            return None
        trial = min(first, key=lambda trial: trial.fit.score)
        cut = self._base.score - best.current.score
        open_by_it = trial.fit.score - best.current.score
        if open_by_it > REFINEMENT * cut or trial.name == best.found.effects[0].trial.name:
            return None
        self._progress(f"{trial.name} explains as much alone")
        other = self._beginning_with(trial)
        if other.count < best.count:
            return other
        usual = term_library()[best.found.effects[0].trial.name].usual
        return other if self._preferred(other, best) and not usual else None

    def _beginning_with(self, trial: Trial, leading: Hypothesis | None = None) -> Hypothesis:
        """Return the hypothesis that begins with this first term, followed on from where it was
        left to its end, or until the leading one is far ahead.
        """
        other = self._followed_from.get(trial.name)
        if other is None:
            other = self._begun()
            self._add(other, trial)
            other.begun = other.count
            self._followed_from[trial.name] = other
        if other.behind:
            other.ended = other.behind = False
        self._follow(other, leading)
        return other

    def _follow(self, hypothesis: Hypothesis, leading: Hypothesis | None = None) -> None:
        """Add as many terms as are worth it; stop where the leading hypothesis is far ahead."""
        while not hypothesis.ended:
            if leading is not None and hypothesis.is_behind(leading, FAR_BEHIND_RATIO):
                hypothesis.ended = hypothesis.behind = True
            else:
                self._add_one(hypothesis)

    def _add_one(self, hypothesis: Hypothesis) -> None:
        """Add the term that is worth most; where none is, the hypothesis has ended."""
        found = hypothesis.found
        enough = hypothesis.count >= MOST_TERMS or hypothesis.steps >= MOST_STEPS
        if enough or time_is_over():
            hypothesis.ended = True
            return
        hypothesis.steps += 1
        hypothesis.progress(f"looking for term {hypothesis.count + 1}: screening")
        trials, found.by_chance = self._step(hypothesis)
        good = [t for t in trials if t.accepted]
        if good and not found.effects:
            hypothesis.first = good
        if not good or not self._added(hypothesis, good):
            found.near = [trial for trial in trials if not trial.unconfirmed][:MOST_NEAR]
            hypothesis.ended = True

    def _added(self, hypothesis: Hypothesis, good: list[Trial]) -> bool:
        """Add the best of the accepted terms that leaves the joint a plausible inertia once it is
        fitted to the end, and return whether there is one.
        """
        found = hypothesis.found
        while good:
            chosen = best_of_equals(self._fitter, good)
            before = list(found.effects), hypothesis.current, dict(hypothesis.scores)
            had_joint = hypothesis.plausible
            self._add(hypothesis, chosen)
            if hypothesis.plausible or not had_joint:
                hypothesis.forks += [
                    Fork(before[0], before[1], other)
                    for other in equals(good)
                    if other is not chosen
                ]
                return True
            hypothesis.progress(f"{chosen.name} leaves the joint no plausible inertia")
            found.effects, hypothesis.current, hypothesis.scores = before
            good = [trial for trial in good if trial is not chosen]
        return False

    def _add(self, hypothesis: Hypothesis, trial: Trial) -> None:
        """Add a term and remove what it makes superfluous."""
        found, fitter = hypothesis.found, self._fitter
        current = with_turning(
            fitter, fitter.fit(trial.fit.terms, trial.fit.values, evaluations=15)
        )
        # An alignment may become a skew between the channels, which has to be allowed.
        if self._grids.allows(ALIGNMENT):
            current = align(fitter, current)
        newest = Effect(trial, fixed_errors(current, self._yardstick))
        found.effects.append(newest)
        hypothesis.current = drop_superfluous(
            fitter, found, newest, current, self._null, hypothesis.progress
        )
        count, score = len(found.effects), hypothesis.current.score
        hypothesis.scores[count] = min(score, hypothesis.scores.get(count, score))

    def _step(self, hypothesis: Hypothesis) -> tuple[list[Trial], float]:
        """Return the most promising candidates beside the current model, best first, and what the
        best one gains by chance.
        """
        return hypothesis.candidates.best(hypothesis.current)


def _is_another(other: Hypothesis, best: Hypothesis) -> bool:
    """Say whether a hypothesis holds other terms than the best one and leaves about as little: no
    equation is exact, so that some per cent of the error do not tell which is right.
    """
    return (
        other is not best
        and other.plausible
        and set(other.current.terms) != set(best.current.terms)
        and other.current.score < BEHIND_RATIO * best.current.score
    )
