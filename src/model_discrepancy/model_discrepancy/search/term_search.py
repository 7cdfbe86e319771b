"""The search for missing terms: screening, joint refit of the best few, accept or stop.

A term is accepted when it takes more off the whitened error than any term of the library does by
chance on noise like this recording's (`null`), when the error falls in both directions between two
halves, and when the torque that it changes matters at all. Deciding by the plain error would never
stop: voluntary torque is autocorrelated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from ankle_physics.term import term_library
from model_discrepancy.fit.base_model import ALIGNMENT, align, bic_change, is_alignment
from model_discrepancy.fit.fitter import Fit, Fitter
from model_discrepancy.search.exchange import exchange
from model_discrepancy.search.found import Effect, Found, Progress, Trial
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import Screened, screen, with_term
from model_discrepancy.search.trials import (
    drop_superfluous,
    fixed_errors,
    halves_errors,
    halves_gain,
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
# Whitened gains within this ratio are too near to choose by: which of two comes first depends on
# what is still missing.
RIVAL_GAIN_RATIO = 0.5
MOST_TERMS = 9


def search(
    fitter: Fitter,
    base: Fit,
    null: Null,
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
    activation_of: Callable[[int], np.ndarray] | None = None,
) -> Found:
    """Add terms to the base model while they are worth it.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    base
        The base model's fit.
    null
        Surrogates of that noise.
    library
        Terms that may be added; None for all.
    progress
        Called with one line for each step.
    activation_of
        Slow torque that belongs to each surrogate, as `screening.screen` takes it.
    """
    found = Found(base, base)
    grids = Grids(library, fitter.rows.count / fitter.rows.rate)
    yardstick = fitter.rows.gain()
    current = _add_terms(fitter, found, base, grids, null, activation_of, yardstick, progress)
    current = fitter.fit(current.terms, current.values, evaluations=15, tolerance=1e-5)
    _settle_alignment(fitter, found, current, null, yardstick)
    found.final = current
    if is_alignment(fitter, current):
        # Otherwise what alignment alone gains would count as mismatch.
        found.base = fitter.fit(
            with_term(base.terms, ALIGNMENT),
            {**base.values, ALIGNMENT: current.values[ALIGNMENT]},
            evaluations=20,
        )
    exchange(fitter, found, grids, null, yardstick, progress)
    found.final = fitter.with_errors(found.final)
    found.base_score = fitter.fit(found.base.terms, found.base.values, evaluations=20).score
    return found


def _add_terms(
    fitter: Fitter,
    found: Found,
    current: Fit,
    grids: Grids,
    null: Null,
    activation_of: Callable[[int], np.ndarray] | None,
    yardstick: np.ndarray,
    progress: Progress,
) -> Fit:
    """Return the model with as many further terms as are worth it; they are noted in `found`."""
    while len(found.effects) < MOST_TERMS:
        progress(f"looking for term {len(found.effects) + 1}: screening")
        # The library is tried on the noise once: later models imitate no less of it.
        screened = screen(
            fitter, current, grids.points(current), None if null.observed else null, activation_of
        )
        grids.learn(screened)
        trials = _step(fitter, current, screened, null, progress)
        found.by_chance = trials[0].by_chance if trials else null.threshold(screened[0].name)
        good = [t for t in trials if t.accepted]
        if not good:
            found.near = trials[:3]
            break
        best = _chosen(fitter, good)
        current = align(fitter, fitter.fit(best.fit.terms, best.fit.values, evaluations=15))
        found.effects.append(Effect(best, fixed_errors(current, yardstick)))
        current = drop_superfluous(fitter, found, current, null, progress)
    return current


def _chosen(fitter: Fitter, good: Sequence[Trial]) -> Trial:
    """Choose the best on unseen rows; among those that do about as well, the one that predicts the
    plain torque best.
    """
    good = [t for t in good if not _needless(t, good)]
    largest = max(min(t.held_out) for t in good)
    equal = [t for t in good if min(t.held_out) >= RIVAL_GAIN_RATIO * largest]
    return (
        equal[0]
        if len(equal) == 1
        else min(equal, key=lambda t: sum(halves_errors(fitter, t.fit, plain=True)))
    )


def _needless(general: Trial, good: Sequence[Trial]) -> bool:
    """Say whether a special case of a term does as well, but for what its further parameters gain
    by chance.
    """
    return any(
        special.name in term_library()[general.name].generalises
        and general.gain < special.gain + general.by_chance
        for special in good
    )


def _settle_alignment(
    fitter: Fitter, found: Found, current: Fit, null: Null, yardstick: np.ndarray
) -> None:
    """Name an alignment a skew between the channels where it became one, and vice versa."""
    if is_alignment(fitter, current):
        found.effects = [effect for effect in found.effects if effect.trial.name != ALIGNMENT]
    elif ALIGNMENT in current.terms and all(
        effect.trial.name != ALIGNMENT for effect in found.effects
    ):
        without = fitter.fit(
            [t for t in current.terms if t != ALIGNMENT], current.values, evaluations=15
        )
        gains = halves_gain(halves_errors(fitter, without), halves_errors(fitter, current))
        trial = Trial(
            ALIGNMENT,
            current,
            1.0 - current.score / without.score,
            gains,
            bic_change(fitter, without, current),
        )
        trial = judged(fitter, without, trial, null.threshold(ALIGNMENT))
        if trial.accepted:
            found.effects.append(Effect(trial, fixed_errors(current, yardstick)))


def _step(
    fitter: Fitter,
    current: Fit,
    screened: Sequence[Screened],
    null: Null,
    progress: Progress,
) -> list[Trial]:
    """Return the most promising candidates, refitted and scored on unseen rows, best first.

    Where none of the first few is accepted, those behind them are tried.
    """
    by_chance = {s.name: null.threshold(s.name) for s in screened}
    promising = [s for s in screened if s.share > max(MIN_PROMISE, 0.5 * by_chance[s.name])]
    tried: list[Trial] = []
    for begin in range(0, min(len(promising), MOST_REFITS), REFITS_PER_STEP):
        few = promising[begin : begin + REFITS_PER_STEP]
        trials = _refitted_and_judged(fitter, current, few, by_chance, progress)
        tried = sorted([*tried, *trials], key=lambda t: -t.gain)
        if any(t.accepted for t in trials):
            break
    return tried


def _refitted_and_judged(
    fitter: Fitter,
    current: Fit,
    few: Sequence[Screened],
    by_chance: dict[str, float],
    progress: Progress,
) -> list[Trial]:
    """Return a few candidates, best first; those near the best are refitted to the end and scored
    on unseen rows.
    """
    trials = []
    for s in few:
        progress(f"refitting with {s.name}")
        trials.append(
            refitted(fitter, current, s.name, {**current.values, s.name: s.start}, evaluations=5)
        )
    best = max((t.gain for t in trials), default=0.0)
    # The first steps of a refit tell which ones are worth the others.
    near = [
        refitted(fitter, current, t.name, t.fit.values)
        if t.gain > max(0.5 * by_chance[t.name], NEAR_BEST_RATIO * best)
        else t
        for t in trials
    ]
    near.sort(key=lambda t: -t.gain)
    return [
        judged(fitter, current, t, by_chance[t.name])
        if place < SCORED_CANDIDATES
        and t.gain > max(by_chance[t.name], NEAR_BEST_RATIO * near[0].gain)
        else replace(t, by_chance=by_chance[t.name])
        for place, t in enumerate(near)
    ]
