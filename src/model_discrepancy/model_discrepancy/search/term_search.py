"""The search for missing terms: screening, joint refit of the best few, accept or stop.

A term is accepted when it takes more off the whitened error than any term of the library does by
chance on noise like this recording's (`null`), when the error falls in both directions between two
halves, and when the torque that it changes matters at all. Deciding by the plain error would never
stop: voluntary torque is autocorrelated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ankle_physics.term import Place, term_library
from model_discrepancy.fit.base_model import ALIGNMENT, align, bic_change, is_alignment
from model_discrepancy.fit.fitter import (
    MATERIAL_SHARE,
    Fit,
    Fitter,
    Start,
    bounded,
    orthonormal,
)
from model_discrepancy.fit.halves import interleaved
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import (
    Point,
    Screened,
    candidates,
    grid,
    screen,
    with_term,
    without_term,
)

# Slow torque holds a part of every variation of the responses. The surrogates take it along, as far
# as the size of each response is known: to about a fifth of its power where responses overlap.
FOLLOWING_MARGIN = 1.3
# A rival is excluded when it leaves this much more whitened error than the best one.
RIVAL_EXCESS = 0.03
# The screening is linear: a rival may do somewhat better after its refit than it promised.
RIVAL_PROMISE = 0.6
RIVALS_REFITTED = 3
# A rival takes an effect's place where it lowers the whitened error by this share with no more
# parameters; a term that was found early may only have stood in for it.
SWAP_GAIN = 0.005
MOST_SWAPS = 3
# Share of the mismatch, whitened and plain. A term that takes off less of both corrects the
# equation of a larger one, it seems.
REFINEMENT = 0.05
# Of the whitened residual that a candidate promises, to be refitted at all.
MIN_PROMISE = 0.003
# Grids are halved from step to step down to so many points.
MIN_GRID_POINTS = 3
# Joint refits per step; the screening's order is right about the first few only.
REFITS_PER_STEP = 4
# Candidates that gain less than this ratio of the best one's are not refitted to the end.
NEAR_BEST_RATIO = 0.6
# Of those, so many are scored on unseen rows: the best, and those that may generalise better.
SCORED_CANDIDATES = 3
# Whitened gains within this ratio are too near to choose by: which of two comes first depends on
# what is still missing.
RIVAL_GAIN_RATIO = 0.5
MOST_TERMS = 9
# A term that keeps off so much of the error, by a linear refit of the others, is not tried without:
# no refit makes up for that.
INDISPENSABLE_SHARE = 0.1
Progress = Callable[[str], None]


@dataclass(frozen=True)
class Trial:
    """Holds one candidate after it was refitted together with all other terms.

    Attributes
    ----------
    name
        The term.
    fit
        The model with it.
    gain
        Share of the whitened sum of squares that it takes off.
    held_out
        The same on unseen rows, in both directions; 0 for candidates far behind the best.
    bic
        Change of BIC; negative is better.
    by_chance
        Gain at which the library as a whole would be exceeded by chance, for this term.
    torque_share
        Power of the torque that it changes beyond what the other terms imitate, as a share of the
        recorded torque's.
    """

    name: str
    fit: Fit
    gain: float
    held_out: tuple[float, float]
    bic: float
    by_chance: float = 0.0
    torque_share: float = 0.0

    @property
    def accepted(self) -> bool:
        """Say whether the gain exceeds chance, holds on unseen rows, and is large enough."""
        margin = FOLLOWING_MARGIN if term_library()[self.name].follows_torque else 1.0
        return (
            self.gain > margin * self.by_chance
            and min(self.held_out) > 0.0
            and self.torque_share > MATERIAL_SHARE
        )


@dataclass(eq=False)
class Effect:
    """A term that was found.

    Attributes
    ----------
    trial
        With the final model.
    errors
        Whitened and plain error after it was added, as `_errors` gives them.
    rivals
        Those that would do instead.
    excluded
        Why each other term that came near, or is of its family, would not do instead; in words, by
        name.
    without
        The final model without it.
    """

    trial: Trial
    errors: np.ndarray
    rivals: list[Trial] = field(default_factory=list)
    excluded: dict[str, str] = field(default_factory=dict)
    without: Fit = field(init=False, repr=False)


@dataclass
class Found:
    """Result of a search.

    Attributes
    ----------
    base
        Fit of the base model.
    final
        Fit of the base model and all accepted terms, with standard errors.
    effects
        In the order in which they were found.
    refinements
        Terms that stay in the model but take off too little of the mismatch to be an effect: no
        equation is exact.
    near
        Best candidates that were not accepted.
    base_score
        Whitened sum of squares of the base model.
    by_chance
        Gain that the best candidate of the last step reaches by chance on this recording.
    """

    base: Fit
    final: Fit
    effects: list[Effect] = field(default_factory=list)
    refinements: list[Effect] = field(default_factory=list)
    near: list[Trial] = field(default_factory=list)
    base_score: float = 0.0
    by_chance: float = 0.0


class _Grids:
    """Which points of the candidates' nonlinear parameters are worth trying, from what was tried
    before.
    """

    def __init__(self, library: Sequence[str] | None, duration: float) -> None:
        self._library = library
        self._duration = duration
        self._kept: dict[str, list[Point]] = {}
        self._best: dict[str, list[Point]] = {}

    def points(self, fit: Fit) -> dict[str, list[Point]]:
        """Return, for a further term, the whole grid at first, its better half later."""
        return {
            name: self._kept.get(name) or grid(name, self._duration)
            for name in candidates(fit, self._library)
        }

    def best(self, fit: Fit) -> dict[str, list[Point]]:
        """Return, for a rival, the points that were once the best."""
        return {
            name: self._best.get(name) or grid(name, self._duration)
            for name in candidates(fit, self._library)
        }

    def learn(self, screened: Sequence[Screened]) -> None:
        """Keep the better half of what was tried."""
        for s in screened:
            ranked = [point for _, point in sorted(s.tried, key=lambda entry: -entry[0])]
            self._kept[s.name] = ranked[
                : max((len(ranked) + 1) // 2, min(MIN_GRID_POINTS, len(ranked)))
            ]
            known = self._best.setdefault(s.name, [])
            known += [point for point in ranked[:2] if point not in known]


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
    grids = _Grids(library, fitter.rows.count / fitter.rows.rate)
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
    _exchange(fitter, found, grids, null, yardstick, progress)
    found.final = fitter.with_errors(found.final)
    found.base_score = fitter.fit(found.base.terms, found.base.values, evaluations=20).score
    return found


def _add_terms(
    fitter: Fitter,
    found: Found,
    current: Fit,
    grids: _Grids,
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
        found.effects.append(Effect(best, _errors(current, yardstick)))
        current = _drop_superfluous(fitter, found, current, null, progress)
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


def _errors(fit: Fit, yardstick: np.ndarray) -> np.ndarray:
    """Return the sums of squares of the residual torque over the fitted rows: under a fixed
    whitening (its gain), and plain; shape (2,).
    """
    return np.array(
        [
            np.sum(rows[fit.rows.used] ** 2)
            for rows in (fit.rows.filtered(fit.left, yardstick), fit.plain)
        ]
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
        trial = _judged(fitter, without, trial, null.threshold(ALIGNMENT))
        if trial.accepted:
            found.effects.append(Effect(trial, _errors(current, yardstick)))


def _step(
    fitter: Fitter,
    current: Fit,
    screened: Sequence[Screened],
    null: Null,
    progress: Progress,
) -> list[Trial]:
    """Return the most promising candidates, refitted and scored on unseen rows, best first."""
    by_chance = {s.name: null.threshold(s.name) for s in screened}
    promising = [s for s in screened if s.share > max(MIN_PROMISE, 0.5 * by_chance[s.name])]
    trials = []
    for s in promising[:REFITS_PER_STEP]:
        progress(f"refitting with {s.name}")
        trials.append(
            _try(fitter, current, s.name, {**current.values, s.name: s.start}, evaluations=5)
        )
    best = max((t.gain for t in trials), default=0.0)
    # The first steps of a refit tell which ones are worth the others.
    near = [
        _try(fitter, current, t.name, t.fit.values)
        if t.gain > max(0.5 * by_chance[t.name], NEAR_BEST_RATIO * best)
        else t
        for t in trials
    ]
    near.sort(key=lambda t: -t.gain)
    return [
        _judged(fitter, current, t, by_chance[t.name])
        if place < SCORED_CANDIDATES
        and t.gain > max(by_chance[t.name], NEAR_BEST_RATIO * near[0].gain)
        else replace(t, by_chance=by_chance[t.name])
        for place, t in enumerate(near)
    ]


def _judged(fitter: Fitter, current: Fit, trial: Trial, by_chance: float) -> Trial:
    """Return the trial with its gain on unseen rows and the torque that it changes."""
    held_out = halves_gain(halves_errors(fitter, current), halves_errors(fitter, trial.fit))
    used = fitter.rows.used
    changed = np.var((trial.fit.plain - current.plain)[used]) / np.var(fitter.plain_target[used])
    return replace(trial, held_out=held_out, by_chance=by_chance, torque_share=float(changed))


def _try(fitter: Fitter, current: Fit, name: str, start: Start, evaluations: int = 12) -> Trial:
    fit = fitter.fit(with_term(current.terms, name), start, evaluations=evaluations)
    gain = 1.0 - fit.score / current.score
    return Trial(name, fit, gain, (0.0, 0.0), bic_change(fitter, current, fit))


def halves_errors(fitter: Fitter, fit: Fit, plain: bool = False) -> tuple[float, float]:
    """Sum of squares, whitened or plain, on each half of what the other half predicts: refitted
    there, linearised about the fit.
    """
    parts = interleaved(fitter.rows)
    derivatives, labels = fitter.derivatives(fit, plain)
    residual = fit.plain if plain else fit.residual
    lower, upper = fitter.room(fit, labels)
    errors = []
    for train, test in (parts, parts[::-1]):
        change = bounded(derivatives[train], residual[train], lower, upper)
        errors.append(float(np.sum((residual[test] - derivatives[test] @ change) ** 2)))
    return errors[0], errors[1]


def halves_gain(old: tuple[float, float], new: tuple[float, float]) -> tuple[float, float]:
    """Share of the whitened error on unseen rows that a new model takes off, in both directions."""
    return 1.0 - new[0] / old[0], 1.0 - new[1] / old[1]


def _drop_superfluous(
    fitter: Fitter, found: Found, current: Fit, null: Null, progress: Progress
) -> Fit:
    """Remove earlier terms that the later ones made superfluous."""
    for effect in list(found.effects[:-1]):
        name = effect.trial.name
        if _promised_loss(fitter, current, name) > INDISPENSABLE_SHARE:
            continue
        without = fitter.fit(without_term(current.terms, name), current.values, evaluations=20)
        gains = halves_gain(halves_errors(fitter, without), halves_errors(fitter, current))
        if 1.0 - current.score / without.score < null.threshold(name) or min(gains) <= 0.0:
            progress(f"{name} is superfluous now")
            found.effects.remove(effect)
            current = without
    return current


def _promised_loss(fitter: Fitter, current: Fit, name: str) -> float:
    """Share of the whitened error that one term keeps off, as far as a linear refit of the others
    tells.
    """
    left = without_term(current.terms, name)
    used = fitter.rows.used
    derivatives, labels = fitter.derivatives(current)
    basis = orthonormal(
        derivatives[used][:, [k for k, (term, _) in enumerate(labels) if term in left]]
    )
    residual = fitter.evaluate({term: current.values[term] for term in left}).residual[used]
    residual = residual - basis @ (basis.T @ residual)
    return 1.0 - current.score / float(residual @ residual)


def _weigh(fitter: Fitter, found: Found, null: Null, before: np.ndarray) -> None:
    """Measure each effect and mark refinements.

    These lower the mismatch by next to nothing, or move next to no torque.
    """
    final = found.final
    whole = np.abs(before - found.effects[-1].errors)
    effects, found.effects = found.effects, []
    for effect in effects:
        small = bool(np.all(before - effect.errors < REFINEMENT * whole))
        before = np.minimum(before, effect.errors)
        (found.refinements if small else found.effects).append(effect)
    for effect in found.effects:
        name = effect.trial.name
        effect.without = fitter.fit(without_term(final.terms, name), final.values, evaluations=15)
        gain = 1.0 - final.score / effect.without.score
        effect.trial = replace(
            effect.trial, fit=final, gain=gain, bic=bic_change(fitter, effect.without, final)
        )
        effect.trial = _judged(fitter, effect.without, effect.trial, null.threshold(name))


def _rivals(fitter: Fitter, found: Found, grids: _Grids, progress: Progress) -> None:
    """Find, for every effect, which other terms would do as well."""
    final = found.final
    for effect in found.effects:
        name, without = effect.trial.name, effect.without
        progress(f"looking for rivals of {name}")
        points = {
            other: tried
            for other, tried in grids.best(without).items()
            if other != name and name not in term_library()[other].generalises
        }
        screened = screen(fitter, without, points)
        promising = [s for s in screened if s.share > RIVAL_PROMISE * effect.trial.gain]
        trials = [
            _try(fitter, without, s.name, {**without.values, s.name: s.start}, evaluations=8)
            for rank, s in enumerate(promising)
            if rank < RIVALS_REFITTED or _is_simpler_sibling(s.name, name)
        ]
        effect.rivals = sorted(
            (t for t in trials if t.fit.score < (1.0 + RIVAL_EXCESS) * final.score),
            key=lambda t: -t.gain,
        )
        effect.excluded = _excluded(effect, final, trials, screened)


def _is_simpler_sibling(name: str, other: str) -> bool:
    """Return whether a term acts where the other one acts, with no more parameters.

    General terms of that place promise as much as a simple one and would crowd it out.
    """
    one, two = term_library()[name], term_library()[other]
    return one.place is two.place and len(one.parameters) <= len(two.parameters)


def _excluded(
    effect: Effect, final: Fit, trials: Sequence[Trial], screened: Sequence[Screened]
) -> dict[str, str]:
    """Return why terms that were refitted, and siblings that were not, would not do instead."""
    library = term_library()
    name, kept = effect.trial.name, {t.name for t in effect.rivals}
    reasons = {
        t.name: f"refitted in its place it leaves {100 * (t.fit.score / final.score - 1.0):.0f} % "
        "more error"
        for t in trials
        if t.name not in kept
    }
    refitted = {t.name for t in trials}
    family = library[name].family
    for s in screened:
        if family and library[s.name].family == family and s.name not in refitted:
            reasons[s.name] = (
                f"it takes off at most {100 * max(s.share, 0.0):.0f} % of the error where "
                f"{name.replace('_', ' ')} takes off {100 * effect.trial.gain:.0f} %"
            )
    return reasons


def _exchange(
    fitter: Fitter,
    found: Found,
    grids: _Grids,
    null: Null,
    yardstick: np.ndarray,
    progress: Progress,
) -> None:
    """Weigh the effects and find their rivals; one that fits better takes the effect's place."""
    for swaps in range(MOST_SWAPS + 1):
        if not found.effects:
            return
        _weigh(fitter, found, null, _errors(found.base, yardstick))
        _rivals(fitter, found, grids, progress)
        better = _better_rival(found)
        if better is None or swaps == MOST_SWAPS:
            return
        _swap(fitter, found, *better, null, yardstick, progress)


def _better_rival(found: Found) -> tuple[Effect, Trial] | None:
    """Return the effect and its rival that fits better with no more parameters, if there is one."""
    final = found.final
    options = [
        (effect, rival)
        for effect in found.effects
        for rival in effect.rivals
        if rival.fit.size <= final.size and rival.fit.score < (1.0 - SWAP_GAIN) * final.score
    ]
    return min(options, key=lambda option: option[1].fit.score, default=None)


def _swap(
    fitter: Fitter,
    found: Found,
    effect: Effect,
    rival: Trial,
    null: Null,
    yardstick: np.ndarray,
    progress: Progress,
) -> None:
    """Put a rival in an effect's place; what it makes superfluous is removed."""
    progress(f"{rival.name} takes the place of {effect.trial.name}")
    current = fitter.fit(rival.fit.terms, rival.fit.values, evaluations=15)
    found.effects.remove(effect)
    found.effects.append(Effect(rival, _errors(current, yardstick)))
    found.final = _drop_superfluous(fitter, found, current, null, progress)


def place_of(name: str) -> Place:
    """Return where in the signal path a term acts."""
    return term_library()[name].place
