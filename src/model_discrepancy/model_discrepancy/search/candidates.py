"""One step of the search: candidates are screened, and the most promising ones are refitted and
scored on unseen rows.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import replace

from ankle_physics.term import term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.fit.parameter_scale import Start, nonlinear
from model_discrepancy.search.found import Progress, Trial
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import Point, Screened, screen
from model_discrepancy.search.trials import judged, refitted

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
# What promises so much, and about as much as the best one takes off in its first steps, is refitted
# to the end: a strap that is soft takes the joint far from the base model, and its first steps lead
# nowhere.
LARGE_PROMISE = 0.1
# Where one term takes off so much, the present model is too far from the joint for the screening,
# which is linear, to tell what straps would do: beside the base model they are tried whatever they
# promise. It costs as much as one more candidate.
MUCH_TAKEN_OFF = 0.3
# Evaluations of such a refit, beyond those that compare its beginnings: thirty lead there.
FURTHER_EVALUATIONS = 20


class Candidates:
    """Finds the terms that are worth most beside a model.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    null
        Surrogates of that noise.
    grids
        Of the library that may be added.
    progress
        Called with one line for each refit.
    """

    def __init__(self, fitter: Fitter, null: Null, grids: Grids, progress: Progress) -> None:
        self._fitter, self._null, self._grids = fitter, null, grids
        self._progress = progress

    def alone(self, progress: Progress) -> Candidates:
        """Return one that learns on its own which points of the grids are worth trying."""
        return Candidates(self._fitter, self._null, self._grids.copy(), progress)

    def best(self, current: Fit) -> tuple[list[Trial], float]:
        """Return the most promising candidates, refitted and scored on unseen rows, best first, and
        what the best one gains by chance.

        Where none of the first few is accepted, those behind them are tried.

        Parameters
        ----------
        current
            The model that they are to be added to.
        """
        fitter, null, grids = self._fitter, self._null, self._grids
        # The library is tried on the noise once: later models imitate no less of it.
        beginning = not null.observed
        screened = screen(
            fitter,
            current,
            grids.points(current),
            None if null.observed else null,
        )
        grids.learn(screened)
        by_chance = {s.name: null.threshold(s.name, s.start) for s in screened}
        promising = [s for s in screened if s.share > max(MIN_PROMISE, 0.5 * by_chance[s.name])]
        tried: list[Trial] = []
        for begin in range(0, min(len(promising), MOST_REFITS), REFITS_PER_STEP):
            few = promising[begin : begin + REFITS_PER_STEP]
            trials = self._refitted_and_judged(current, few, by_chance)
            trials += special_cases(fitter, current, trials, null)
            tried = _best_of_each([*tried, *trials])
            if any(t.accepted for t in trials):
                break
        accepted = any(t.accepted for t in tried)
        if beginning and (not accepted or tried[0].gain > MUCH_TAKEN_OFF):
            tried = _best_of_each([*tried, *self._usual(current, tried, by_chance)])
        tried = _best_of_each([*tried, *self._unbent(current, tried, by_chance)])
        if tried and tried[0].accepted and term_library()[tried[0].name].rings:
            tried = _best_of_each([*tried, self._rung(current, tried[0])])
        if tried:
            return tried, tried[0].by_chance
        return tried, by_chance[screened[0].name] if screened else 0.0  # all terms are in the model

    def _usual(
        self, current: Fit, tried: Sequence[Trial], by_chance: dict[str, float]
    ) -> list[Trial]:
        """Return what is usual in any rig and not among the best, refitted from its whole grid, as
        far as it gains about as much as those that are accepted.
        """
        library, fitter = term_library(), self._fitter
        leading = max((t.gain for t in tried if t.accepted), default=0.0)
        known = {t.name for t in tried if t.accepted} | set(current.terms)
        names = [
            name
            for name in by_chance
            if library[name].usual
            and nonlinear([name])
            and not known & {name, *library[name].generalises}
            and not any(library[other].usual for other in library[name].generalises)
        ]
        found = []
        for name in names:
            self._progress(f"refitting with {name}, which is usual")
            begun = begun_anew(fitter, current, name, self._grids.whole(name))
            trial = refitted(fitter, current, name, begun.fit.values, FURTHER_EVALUATIONS)
            if trial.gain > NEAR_BEST_RATIO * leading:
                found.append(judged(fitter, current, trial, self._by_chance(trial)))
        return found

    def _unbent(
        self, current: Fit, tried: Sequence[Trial], by_chance: dict[str, float]
    ) -> list[Trial]:
        """Return the terms in whose place others may have bent, begun where these are not bent, as
        far as they gain about as much as the best.
        """
        fitter = self._fitter
        least = NEAR_BEST_RATIO * max((t.gain for t in tried if t.accepted), default=0.0)
        found = []
        for name, by in by_chance.items():
            starts = term_library()[name].begins_beside(current.values)
            if not starts:
                continue
            known = max((t.gain for t in tried if t.name == name), default=0.0)
            best = self._begun_beside(current, name, starts)
            if best.gain > max(by, known, least):
                best = refitted(fitter, current, name, best.fit.values, FURTHER_EVALUATIONS)
                found.append(judged(fitter, current, best, self._by_chance(best)))
        return found

    def _begun_beside(self, current: Fit, name: str, starts: Sequence[Start]) -> Trial:
        """Return the best trial of a term from several values of it and of others."""

        def begun(start: Start) -> Trial:
            return refitted(self._fitter, current, name, {**current.values, **start})

        return max(in_parallel(begun, starts), key=lambda t: t.gain)

    def _rung(self, current: Fit, best: Trial) -> Trial:
        """Return a light vibration, which is the best candidate, begun at other frequencies: a fit
        from one of them may end beside it, with too much damping.
        """
        points = self._grids.whole(best.name)
        anew = begun_anew(self._fitter, current, best.name, points, limit=best.fit.score)
        if not anew.gain > best.gain:
            return best
        anew = judged(self._fitter, current, anew, self._by_chance(anew))
        return anew if anew.accepted else best

    def _refitted_and_judged(
        self, current: Fit, few: Sequence[Screened], by_chance: dict[str, float]
    ) -> list[Trial]:
        """Return a few candidates, best first; those near the best are refitted to the end and
        scored on unseen rows. Where none of them is accepted, those behind them are.
        """
        screened = {s.name: s for s in few}
        promised = {s.name: s.share for s in few}

        def begun(s: Screened) -> Trial:
            start = {**current.values, s.name: s.start}
            return refitted(self._fitter, current, s.name, start, evaluations=5)

        self._progress(f"refitting with {', '.join(screened)}")
        behind = in_parallel(begun, few)
        tried: list[Trial] = []
        while behind and not any(t.accepted for t in tried):
            near, behind = _near_best(behind, by_chance, promised)
            if not near:
                break
            tried += self._scored(current, near, screened)
        rest = [replace(t, by_chance=self._by_chance(t)) for t in behind]
        return sorted([*tried, *rest], key=lambda t: -t.gain)

    def _scored(
        self,
        current: Fit,
        trials: Sequence[Trial],
        screened: dict[str, Screened],
    ) -> list[Trial]:
        """Return trials refitted to the end, and the best of them scored on unseen rows; those
        behind an accepted one need not be.
        """
        final = in_parallel(
            lambda t: self._refitted_to_the_end(
                current, t, screened[t.name].share, screened[t.name].start
            ),
            trials,
        )
        leading, scored = 0.0, 0
        for place, t in sorted(enumerate(final), key=lambda entry: -entry[1].gain):
            by = self._by_chance(t)
            if scored < SCORED_CANDIDATES and t.gain > max(by, NEAR_BEST_RATIO * leading):
                final[place] = judged(self._fitter, current, t, by)
                leading = t.gain if leading == 0.0 and final[place].accepted else leading
                scored += 1
            else:
                final[place] = replace(t, by_chance=by)
        return final

    def _by_chance(self, trial: Trial) -> float:
        """Return what a term gains by chance with the values that it has in a trial."""
        return self._null.threshold_of(trial.name, trial.fit)

    def _refitted_to_the_end(
        self,
        current: Fit,
        trial: Trial,
        promised: float,
        begun: Mapping[str, float] | None = None,
    ) -> Trial:
        """Return the trial refitted further, from other points of its grid too where it takes off
        much less than the screening promised. It began at one of these points.
        """
        fitter, name = self._fitter, trial.name
        best = refitted(fitter, current, name, trial.fit.values)
        if best.gain > LEAST_OF_PROMISE * promised or not nonlinear([name]):
            return best
        # What is gained by chance is not asked for.
        limit = min(best.fit.score, (1.0 - self._by_chance(best)) * current.score)
        points = self._grids.whole(name)
        anew = begun_anew(fitter, current, name, points, limit=limit, tried=begun)
        return max(best, anew, key=lambda t: t.gain)


def begun_anew(
    fitter: Fitter,
    current: Fit,
    name: str,
    points: Sequence[Point],
    evaluations: int = 12,
    others: Start | None = None,
    limit: float = math.inf,
    tried: Mapping[str, float] | None = None,
) -> Trial:
    """Return the trial of one more term, begun at the best points of its grid.

    Parameters
    ----------
    fitter, current
        The present model, and what fits it.
    name
        Of the term.
    points
        Of its grid.
    evaluations
        Of each refit.
    others
        Where the other terms begin; None: as they are in the present model.
    limit
        Of the score; a refit that cannot come below it ends early.
    tried
        Values of the term from where a refit led somewhere else; it begins there again only where
        its grid has no other point.
    """
    (screened,) = screen(fitter, current, {name: points})
    shares = [share for share, _ in screened.tried]
    best = sorted(range(len(shares)), key=lambda k: -shares[k])[:RESTARTS]
    if tried is not None:
        best = [k for k in best if not tried.items() >= screened.tried[k][1].items()] or best

    def begun(start: dict[str, float]) -> Trial:
        beside = current.values if others is None else others
        return refitted(fitter, current, name, {**beside, name: start}, evaluations, limit)

    return max(in_parallel(begun, [screened.starts[k] for k in best]), key=lambda t: t.gain)


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
    starts = []
    for general in trials:
        for name in library[general.name].generalises if general.accepted else ():
            values = general.fit.values[general.name]
            symbols = [parameter.symbol for parameter in library[name].parameters]
            if set(symbols) <= set(values):
                start = {**general.fit.values, name: {s: values[s] for s in symbols}}
                starts.append((name, start))

    def fitted(case: tuple[str, Start]) -> Trial:
        name, start = case
        trial = refitted(fitter, current, name, start)
        return judged(fitter, current, trial, null.threshold_of(name, trial.fit))

    return in_parallel(fitted, starts)


def _best_of_each(trials: Sequence[Trial]) -> list[Trial]:
    """Return the best trial of each term, best first."""
    ascending = sorted(trials, key=lambda t: t.gain)
    return sorted({t.name: t for t in ascending}.values(), key=lambda t: -t.gain)


def _near_best(
    trials: Sequence[Trial], by_chance: dict[str, float], promised: dict[str, float]
) -> tuple[list[Trial], list[Trial]]:
    """Return the trials that gain about as much as the best one, or promise as much, and the
    others: the first steps of a refit tell which ones are worth the further steps.
    """
    beyond = [t for t in trials if t.gain > 0.5 * by_chance[t.name]]
    best = max((t.gain for t in beyond), default=0.0)
    near = [
        t
        for t in trials
        if (t in beyond and t.gain > NEAR_BEST_RATIO * best)
        or promised[t.name] > max(NEAR_BEST_RATIO * best, LARGE_PROMISE)
    ]
    return near, [t for t in trials if t not in near]
