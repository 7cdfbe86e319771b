"""The search for missing terms: base fit, screening, joint refit of the best few, accept or stop.

A term is accepted when the whitened error on rows that were not fitted falls by at least 3 % in
both directions between the two halves and BIC falls by more than 50; between 1.5 and 3 % it is
tentative. Deciding by the plain error would never stop: voluntary torque is autocorrelated.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ankle_physics.model import PAPER_TERMS
from ankle_physics.term import Place, term_library
from model_discrepancy.fit.fitter import Fit, Fitter, Start, bounded, orthonormal
from model_discrepancy.fit.halves import interleaved
from model_discrepancy.search.effect_size import torque_share
from model_discrepancy.search.screening import (
    Point,
    Screened,
    candidates,
    grid,
    screen,
    with_term,
    without_term,
)

ACCEPTED = 0.03
TENTATIVE = 0.015
BIC_FALL = 50.0
# A rival is excluded when it leaves this much more whitened error than the best one: the yardstick
# of acceptance.
RIVAL_EXCESS = 0.03
# The screening is linear: a rival may do somewhat better after its refit than it promised.
RIVAL_PROMISE = 0.6
RIVALS_REFITTED = 3
# Share of the mismatch, whitened and plain. A term that takes off less of both corrects the
# equation of a larger one, it seems.
REFINEMENT = 0.05
# Of the torque's variance: a quarter of its noise at the paper's SNR (24.1 dB). What changes less
# is below any instrument's own errors.
MATERIAL = 1e-3
# Of the whitened residual that a candidate promises, to be refitted at all.
LEAST_PROMISE = 0.003
# Grids are halved from step to step down to so many points.
LEAST_POINTS = 3
# The term whose smallest values say no more than how well two channels are aligned.
ALIGNMENT = "channel_skew"
# Joint refits per step; the screening's order is right about the first few only.
REFITTED = 4
# Candidates that gain less than this share of the best one's are not refitted to the end.
CLOSE = 0.6
# Of those, so many are scored on unseen rows: the best, and one that may generalise better.
JUDGED = 3
# Of the candidates for slow effects, so many are refitted: half of the plain error is voluntary
# torque, which no order survives well.
SLOW_REFITTED = 5
# Whitened gains within this ratio are too near to choose by: which of two comes first depends on
# what is still missing.
EQUAL = 0.5
MOST_TERMS = 9
# Weight of the plain error beside the whitened one (both as logarithms) where they are judged
# together: slow torque has about a quarter as many independent values as rows, and what acts
# slowly, a reflex, shows there.
PLAIN_WEIGHT = 0.25
# A term that keeps off so much of the error, by a linear refit of the others, is not tried without:
# no refit makes up for that.
NEEDED = 0.1
# Starts of the base fit: its delay and muscle speed have several minima.
BASE_STARTS = tuple(
    {"delay": delay, "omega": omega, "z": 0.8} for delay in (0.035, 0.05) for omega in (10.0, 21.0)
)

Progress = Callable[[str], None]


@dataclass(frozen=True)
class Trial:
    """One candidate after its joint refit.

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


@dataclass(eq=False)
class Effect:
    """A term that was found.

    Attributes
    ----------
    trial
        With the final model.
    errors
        Whitened and plain error after it was added, as `_errors` gives them.
    tentative
        Whether it passed the weaker criteria only.
    rivals
        Those that would do instead.
    without
        The final model without it.
    """

    trial: Trial
    errors: np.ndarray
    tentative: bool = False
    rivals: list[Trial] = field(default_factory=list)
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
        Whitened sum of squares of the base model under the last whitening.
    """

    base: Fit
    final: Fit
    effects: list[Effect] = field(default_factory=list)
    refinements: list[Effect] = field(default_factory=list)
    near: list[Trial] = field(default_factory=list)
    base_score: float = 0.0


def fit_base(fitter: Fitter, terms: Sequence[str] = PAPER_TERMS) -> Fit:
    """The base model from several starts; leaves the fitter whitened by its residual."""
    best = min(
        (fitter.fit(terms, {"reflex": dict(start)}, evaluations=15) for start in BASE_STARTS),
        key=lambda fit: fit.score,
    )
    for _ in range(2):
        fitter.whiten_by(best.plain)
        starts = [best.values, *({"reflex": dict(start)} for start in BASE_STARTS[:2])]
        best = min(
            (fitter.fit(terms, start, evaluations=25) for start in starts),
            key=lambda fit: fit.score,
        )
    return best


def align(fitter: Fitter, fit: Fit) -> Fit:
    """The fit with its channels aligned, where they are apart by less than half a sample: too
    little to be a finding, enough to be seen.
    """
    if ALIGNMENT in fit.terms:
        return fit
    aligned = fitter.fit(
        [*fit.terms, ALIGNMENT], {**fit.values, ALIGNMENT: {"skew": 0.0}}, evaluations=10
    )
    return (
        aligned
        if is_alignment(fitter, aligned) and bic_change(fitter, fit, aligned) < -BIC_FALL
        else fit
    )


def is_alignment(fitter: Fitter, fit: Fit) -> bool:
    """Whether the channels are apart by less than half a sample."""
    return (
        ALIGNMENT in fit.terms
        and abs(fit.values[ALIGNMENT]["skew"]) <= 0.5 * fitter.columns.motion.sample_time
    )


class _Grids:
    """Which points of the candidates' nonlinear parameters are worth trying, from what was tried
    before.
    """

    def __init__(self, library: Sequence[str] | None) -> None:
        self._library = library
        self._kept: dict[str, list[Point]] = {}
        self._best: dict[str, list[Point]] = {}

    def points(self, fit: Fit) -> dict[str, list[Point]]:
        """For a further term: the whole grid at first, its better half later."""
        return {name: self._kept.get(name) or grid(name) for name in candidates(fit, self._library)}

    def best(self, fit: Fit) -> dict[str, list[Point]]:
        """For a rival: the points that were once the best."""
        return {name: self._best.get(name) or grid(name) for name in candidates(fit, self._library)}

    def learn(self, screened: Sequence[Screened]) -> None:
        """Keep the better half of what was tried."""
        for s in screened:
            ranked = [point for _, point in sorted(s.tried, key=lambda entry: -entry[0])]
            self._kept[s.name] = ranked[
                : max((len(ranked) + 1) // 2, min(LEAST_POINTS, len(ranked)))
            ]
            known = self._best.setdefault(s.name, [])
            known += [point for point in ranked[:2] if point not in known]


def search(
    fitter: Fitter,
    base: Fit,
    library: Sequence[str] | None = None,
    progress: Progress = lambda _: None,
) -> Found:
    """Add terms to the base model while they are worth it."""
    found = Found(base, base)
    grids = _Grids(library)
    yardstick = fitter.rows.gain()
    current = _add_terms(fitter, found, base, grids, yardstick, progress)
    current = fitter.fit(current.terms, current.values, evaluations=15, tolerance=1e-5)
    _settle_alignment(fitter, found, current, yardstick)
    found.final = current
    if is_alignment(fitter, current):
        # Otherwise what alignment alone gains would count as mismatch.
        found.base = fitter.fit(
            with_term(base.terms, ALIGNMENT),
            {**base.values, ALIGNMENT: current.values[ALIGNMENT]},
            evaluations=20,
        )
    if found.effects:
        _weigh(fitter, found, _errors(found.base, yardstick))
        _rivals(fitter, found, grids, progress)
    found.final = fitter.with_errors(current)
    found.base_score = fitter.fit(found.base.terms, found.base.values, evaluations=20).score
    return found


def _add_terms(
    fitter: Fitter,
    found: Found,
    current: Fit,
    grids: _Grids,
    yardstick: np.ndarray,
    progress: Progress,
) -> Fit:
    """The model with as many further terms as are worth it; they are noted in `found`."""
    while len(found.effects) < MOST_TERMS:
        progress(f"looking for term {len(found.effects) + 1}: screening")
        trials = _step(fitter, current, grids, progress)
        good = (
            [t for t in trials if t.accepted]
            or [t for t in trials if t.tentative]
            or _slow_step(fitter, current, grids, progress)
        )
        if not good:
            found.near = trials[:3]
            break
        best = _chosen(fitter, good)
        current = align(fitter, fitter.fit(best.fit.terms, best.fit.values, evaluations=15))
        found.effects.append(Effect(best, _errors(current, yardstick), tentative=not best.accepted))
        current = _drop_superfluous(fitter, found, current, progress)
    return current


def _chosen(fitter: Fitter, good: Sequence[Trial]) -> Trial:
    """The best on unseen rows; among those that do about as well, the one that predicts the plain
    torque best.
    """
    largest = max(min(t.held_out) for t in good)
    equal = [t for t in good if min(t.held_out) >= EQUAL * largest]
    return (
        equal[0]
        if len(equal) == 1
        else min(equal, key=lambda t: sum(halves_errors(fitter, t.fit, plain=True)))
    )


def _errors(fit: Fit, yardstick: np.ndarray) -> np.ndarray:
    """Sums of squares of the residual torque over the fitted rows: under a fixed whitening (its
    gain), and plain; shape (2,).
    """
    return np.array(
        [
            np.sum(rows[fit.rows.used] ** 2)
            for rows in (fit.rows.filtered(fit.left, yardstick), fit.plain)
        ]
    )


def _settle_alignment(fitter: Fitter, found: Found, current: Fit, yardstick: np.ndarray) -> None:
    """What began as an alignment may end as a skew between the channels, and the other way round."""  # noqa: E501
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
        if trial.tentative:
            found.effects.append(
                Effect(trial, _errors(current, yardstick), tentative=not trial.accepted)
            )


def _step(fitter: Fitter, current: Fit, grids: _Grids, progress: Progress) -> list[Trial]:
    """The most promising candidates, refitted and scored on unseen rows, best first."""
    screened = screen(fitter, current, grids.points(current))
    grids.learn(screened)
    trials = []
    for s in screened[:REFITTED]:
        if s.share > LEAST_PROMISE:
            progress(f"refitting with {s.name}")
            trials.append(
                _try(fitter, current, s.name, {**current.values, s.name: s.start}, evaluations=5)
            )
    best = max((t.gain for t in trials), default=0.0)
    # The first steps of a refit tell which ones are worth the others.
    close = [
        _try(fitter, current, t.name, t.fit.values)
        if t.gain > max(0.5 * TENTATIVE, CLOSE * best)
        else t
        for t in trials
    ]
    close.sort(key=lambda t: -t.gain)
    judged = []
    before = halves_errors(fitter, current) if any(t.gain > TENTATIVE for t in close) else None
    for place, trial in enumerate(close):
        worth = (
            place < JUDGED
            and trial.gain > max(TENTATIVE, CLOSE * close[0].gain)
            and trial.bic < -BIC_FALL
        )
        held_out = (
            halves_gain(before, halves_errors(fitter, trial.fit))
            if worth and before
            else (0.0, 0.0)
        )
        judged.append(Trial(trial.name, trial.fit, trial.gain, held_out, trial.bic))
    return judged


def _slow_step(fitter: Fitter, current: Fit, grids: _Grids, progress: Progress) -> list[Trial]:
    """The candidate that gains most in the plain error, if it gains in the whitened error too; none
    or one.
    """
    progress("looking for slow terms")
    plain = fitter.unwhitened()
    screened = screen(plain, plain.evaluate(current.values), grids.best(current))
    found: list[tuple[float, Trial]] = []
    for s in screened[:SLOW_REFITTED]:
        if s.share < ACCEPTED:
            continue
        trial = _try(fitter, current, s.name, {**current.values, s.name: s.start})
        gains, together = _gains(fitter, current, trial.fit)
        if min(gains) > 0.0 and together >= TENTATIVE and trial.bic < -BIC_FALL:
            found.append((together, replace(trial, held_out=gains)))
    return [max(found, key=lambda entry: entry[0])[1]] if found else []


def _gains(fitter: Fitter, old: Fit, new: Fit) -> tuple[tuple[float, float], float]:
    """Gain on unseen rows: whitened, in both directions, and together with the plain one, in the
    worse direction.
    """
    white, plain = (
        halves_gain(halves_errors(fitter, old, kind), halves_errors(fitter, new, kind))
        for kind in (False, True)
    )
    return white, min(w + PLAIN_WEIGHT * p for w, p in zip(white, plain, strict=True))


def _try(fitter: Fitter, current: Fit, name: str, start: Start, evaluations: int = 12) -> Trial:
    fit = fitter.fit(with_term(current.terms, name), start, evaluations=evaluations)
    gain = 1.0 - fit.score / current.score
    return Trial(name, fit, gain, (np.nan, np.nan), bic_change(fitter, current, fit))


def bic_change(fitter: Fitter, old: Fit, new: Fit) -> float:
    """BIC of the new fit minus that of the old one."""
    n = fitter.rows.independent
    return n * float(np.log(new.score / old.score)) + (new.size - old.size) * float(np.log(n))


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


def _drop_superfluous(fitter: Fitter, found: Found, current: Fit, progress: Progress) -> Fit:
    """Remove earlier terms that the later ones made superfluous."""
    for effect in list(found.effects[:-1]):
        name = effect.trial.name
        if _promised_loss(fitter, current, name) > NEEDED:
            continue
        without = fitter.fit(without_term(current.terms, name), current.values, evaluations=20)
        if (
            1.0 - current.score / without.score < TENTATIVE
            and _gains(fitter, without, current)[1] < TENTATIVE
        ):
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


def _weigh(fitter: Fitter, found: Found, before: np.ndarray) -> None:
    """What each effect is worth; those that took off next to nothing of the mismatch, or move next
    to no torque, are refinements.
    """
    final = found.final
    whole = np.abs(before - found.effects[-1].errors)
    effects, found.effects = found.effects, []
    for effect in effects:
        small = bool(np.all(before - effect.errors < REFINEMENT * whole))
        small = small or torque_share(fitter, final, effect.trial.name) ** 2 < MATERIAL
        before = np.minimum(before, effect.errors)
        (found.refinements if small else found.effects).append(effect)
    for effect in found.effects:
        name = effect.trial.name
        effect.without = fitter.fit(without_term(final.terms, name), final.values, evaluations=15)
        gain = 1.0 - final.score / effect.without.score
        effect.trial = replace(
            effect.trial, fit=final, gain=gain, bic=bic_change(fitter, effect.without, final)
        )


def _rivals(fitter: Fitter, found: Found, grids: _Grids, progress: Progress) -> None:
    """For every effect: which other terms would do as well."""
    final = found.final
    for effect in found.effects:
        name, without = effect.trial.name, effect.without
        progress(f"looking for rivals of {name}")
        points = {other: tried for other, tried in grids.best(without).items() if other != name}
        promising = [
            s
            for s in screen(fitter, without, points)
            if s.share > RIVAL_PROMISE * effect.trial.gain
        ]
        trials = [
            _try(fitter, without, s.name, {**without.values, s.name: s.start}, evaluations=8)
            for s in promising[:RIVALS_REFITTED]
        ]
        effect.rivals = sorted(
            (t for t in trials if t.fit.score < (1.0 + RIVAL_EXCESS) * final.score),
            key=lambda t: -t.gain,
        )


def place_of(name: str) -> Place:
    """Where in the signal path a term acts."""
    return term_library()[name].place
