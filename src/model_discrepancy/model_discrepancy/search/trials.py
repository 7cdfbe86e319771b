"""A term is tried: refitted with all others, scored on unseen rows, dropped where superfluous."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import cast

import numpy as np

from ankle_physics.joint_profile import joint_in_force
from ankle_physics.term import term_library
from model_discrepancy.fit.base_model import bic_change, has_joint
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.halves import interleaved
from model_discrepancy.fit.least_squares import bounded, orthonormal
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.fit.parameter_scale import Start, ranges, to_unit
from model_discrepancy.fit.signal_path import Column
from model_discrepancy.search.acting_stretches import acting_in
from model_discrepancy.search.found import Effect, Found, Progress, Trial
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import with_term, without_term

# A term that keeps off so much of the error, by a linear refit of the others, is not tried without:
# no refit makes up for that.
INDISPENSABLE_SHARE = 0.1
# A parameter that keeps less than this share of its value has vanished.
VANISHING_SHARE = 0.02
# Evaluations of a refit from values that are right but for the size of one term.
PRECEDING_EVALUATIONS = 6
# Whitened gains within this ratio are too near to choose by: which of two comes first depends on
# what is still missing.
RIVAL_GAIN_RATIO = 0.5
# A refit to half of the rows stays within this share of a nonlinear parameter's range.
_LINEAR_SHARE = 0.1
# Where movements follow each other without rest, sizes of successive responses that are alike by
# accident seem to follow what was held before: a reflex whose size drifts by 30 % within 3 s gained
# four times as much as by chance so. What is gained there counts less by this factor. Of what they
# gain in all, terms that follow torque then gained 0.14 to 0.5 on the independent rig, and a reflex
# that only varies at most 0.07.
RESTLESS_FACTOR = 1.5
# Of a continuous movement, too, a reflex that varies by little gained up to five times as much as
# by chance, 0.027 in all (22 recordings without a mismatch); effects that follow torque 0.087 to
# 0.41. What gains less is not known to follow it.
LEAST_CONTINUOUS_GAIN = 0.05


def fixed_errors(fit: Fit, yardstick: np.ndarray) -> np.ndarray:
    """Return the sums of squares of the residual torque over the fitted rows: under a fixed
    whitening (its gain), and plain; shape (2,).
    """
    return np.array(
        [
            np.sum(rows[fit.rows.used] ** 2)
            for rows in (fit.rows.filtered(fit.left, yardstick), fit.plain)
        ]
    )


def judged(fitter: Fitter, current: Fit, trial: Trial, by_chance: float) -> Trial:
    """Return the trial with its gain on unseen rows and the torque that it changes."""
    held_out = halves_gain(halves_errors(fitter, current), halves_errors(fitter, trial.fit))
    used = fitter.rows.used
    changed = np.var((trial.fit.plain - current.plain)[used]) / np.var(fitter.plain_target[used])
    return replace(
        trial,
        held_out=held_out,
        by_chance=by_chance,
        torque_share=float(changed),
        displaced=displaced(current, trial.fit),
        joint_change=joint_change(current, trial.fit),
        takes_joint=has_joint(current) and not has_joint(trial.fit),
        stretches=acting_in(fitter.rows.time[used], (trial.fit.residual - current.residual)[used]),
        preceding_gain=preceding_gain(fitter, trial),
    )


def preceding_gain(fitter: Fitter, trial: Trial) -> float | None:
    """Return what a term that follows slow torque gains from what the muscles held before each
    movement, compared with their mean torque; None for other terms, and where this is not known.

    With the mean torque alone such a term is another reflex or another stiffness, which may stand
    in for one that is missing. Without rest between movements, the gain over `RESTLESS_FACTOR`.
    """
    if not term_library()[trial.name].follows_torque:
        return None
    errors = preceding_errors(fitter, trial.fit)
    if errors is None:
        return None
    gain = 1.0 - errors[1] / errors[0]
    return gain / RESTLESS_FACTOR if fitter.motion.restless else gain


def preceding_errors(fitter: Fitter, fit: Fit) -> tuple[float, float] | None:
    """Return the whitened sums of squares of a model, refitted with the muscles' mean torque and
    with what they held before each movement in the place of slow torque; None where this is not
    known. They are alike where a continuous movement gains too little to tell.
    """
    preceding = fitter.motion.preceding
    if preceding is None:
        return None
    mean = np.full_like(preceding, float(np.mean(preceding)))
    old, new = (
        fitter.along(replace(fitter.motion, activation=activation))
        .fit(fit.terms, fit.values, evaluations=PRECEDING_EVALUATIONS)
        .score
        for activation in (mean, preceding)
    )
    if fitter.motion.continuous and new > (1.0 - LEAST_CONTINUOUS_GAIN) * old:
        return old, old
    return old, new


def joint_change(current: Fit, fit: Fit) -> float:
    """Return the largest relative change of K or B from one fit to another, 0...1 and above; 0
    where the joint has neither.
    """
    changes = [0.0]
    for name, symbol in (("stiffness", "K"), ("viscosity", "B")):
        if name in current.values and name in fit.values:
            before, now = (f.values[name][symbol] for f in (current, fit))
            changes.append(abs(now - before) / max(abs(before), abs(now), 1e-12))
    return max(changes)


def displaced(current: Fit, fit: Fit) -> tuple[str, ...]:
    """Return the linear parameters of the base model, "term.symbol", that vanish in a fit and do
    not in the current one.
    """
    found = []
    for name in joint_in_force().terms:
        for parameter in term_library()[name].parameters:
            if parameter.linear:
                before, now = (f.values[name][parameter.symbol] for f in (current, fit))
                if abs(now) < VANISHING_SHARE * abs(before):
                    found.append(f"{name}.{parameter.symbol}")
    return tuple(sorted(found))


def refitted(
    fitter: Fitter,
    current: Fit,
    name: str,
    start: Start,
    evaluations: int = 12,
    limit: float = math.inf,
) -> Trial:
    """Return the trial of one more term, fitted together with those of the current model; a fit
    that cannot come below a limit of the score ends early.
    """
    terms = with_term(current.terms, name)
    fit = (
        fitter.fit(terms, start, evaluations=evaluations)
        if math.isinf(limit)
        else fitter.fit_below(terms, start, limit, evaluations)
    )
    gain = 1.0 - fit.score / current.score
    return Trial(name, fit, gain, (0.0, 0.0), bic_change(fitter, current, fit))


def best_of_equals(fitter: Fitter, good: Sequence[Trial]) -> Trial:
    """Choose the best trial on unseen rows; among those that do about as well, the one that
    predicts the plain torque best.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    good
        Accepted trials, at least one.
    """
    equal = equals(good)
    return (
        equal[0]
        if len(equal) == 1
        else min(equal, key=lambda t: sum(halves_errors(fitter, t.fit, plain=True)))
    )


def equals(good: Sequence[Trial]) -> list[Trial]:
    """Return the trials that gain about as much on unseen rows as the best one, and are not
    needless.

    One that ends at the bound of its range, as a mode does that imitates a lag, is none of them
    where another does not.
    """
    good = [t for t in good if not is_needless(t, good)]
    largest = max(min(t.held_out) for t in good)
    equal = [t for t in good if min(t.held_out) >= RIVAL_GAIN_RATIO * largest]
    return [t for t in equal if not t.at_bound] or equal


def is_needless(general: Trial, good: Sequence[Trial]) -> bool:
    """Say whether a special case of a term does as well, but for what its further parameters gain
    by chance.
    """
    return any(
        special.name in term_library()[general.name].generalises
        and general.gain < special.gain + general.by_chance
        for special in good
    )


def halves_errors(fitter: Fitter, fit: Fit, plain: bool = False) -> tuple[float, float]:
    """Return the sum of squares, whitened or plain, on each half of what the other half predicts:
    refitted there, linearised about the fit.
    """
    parts = interleaved(fitter.rows)
    derivatives, labels = fitter.derivatives(fit, plain)
    residual = fit.plain if plain else fit.residual
    lower, upper = _room(fit, labels)
    errors = []
    for train, test in (parts, parts[::-1]):
        change = bounded(derivatives[train], residual[train], lower, upper)
        errors.append(float(np.sum((residual[test] - derivatives[test] @ change) ** 2)))
    return errors[0], errors[1]


def _room(fit: Fit, labels: Sequence[Column]) -> tuple[np.ndarray, np.ndarray]:
    """Return how far each parameter may go down and up.

    Nonlinear ones move on their scaled range, where the fit is linear enough.
    """
    down, up = ranges(labels)
    for k, (name, symbol) in enumerate(labels):
        parameter, value = term_library()[name].parameter(symbol), fit.values[name][symbol]
        if parameter.linear:
            # The fit solves for amplitudes to rounding only.
            down[k], up[k] = min(down[k] - value, 0.0), max(up[k] - value, 0.0)
        else:
            unit = to_unit(parameter, value)
            down[k], up[k] = max(-unit, -_LINEAR_SHARE), min(1.0 - unit, _LINEAR_SHARE)
    # A range of no width is no range to the solver.
    return np.minimum(down, -1e-9), np.maximum(up, 1e-9)


def halves_gain(old: tuple[float, float], new: tuple[float, float]) -> tuple[float, float]:
    """Return the share of the whitened error on unseen rows that a new model takes off, in both
    directions.
    """
    return 1.0 - new[0] / old[0], 1.0 - new[1] / old[1]


def drop_superfluous(
    fitter: Fitter, found: Found, newest: Effect, current: Fit, null: Null, progress: Progress
) -> Fit:
    """Remove the terms that the newest one made superfluous."""
    left = [effect for effect in found.effects if effect is not newest]
    while left:
        names = [effect.trial.name for effect in left]
        # All at the same time ask for them.
        fitter.derivatives(current)
        fits = in_parallel(partial(_fit_without_superfluous, fitter, current, null), names)
        first = next((k for k, fit in enumerate(fits) if fit is not None), None)
        if first is None:
            break
        progress(f"{names[first]} is superfluous now")
        found.effects.remove(left[first])
        current, left = cast(Fit, fits[first]), left[first + 1 :]
    return current


def _fit_without_superfluous(fitter: Fitter, current: Fit, null: Null, name: str) -> Fit | None:
    """Return the fit without a term; None where the term is worth keeping."""
    if _promised_loss(fitter, current, name) > INDISPENSABLE_SHARE:
        return None
    by_chance = null.threshold_of(name, current)
    without = fitter.fit_below(
        without_term(current.terms, name),
        current.values,
        limit=current.score / (1.0 - min(by_chance, INDISPENSABLE_SHARE)),
        evaluations=20,
    )
    gains = halves_gain(halves_errors(fitter, without), halves_errors(fitter, current))
    superfluous = 1.0 - current.score / without.score < by_chance or min(gains) <= 0.0
    return without if superfluous else None


def _promised_loss(fitter: Fitter, current: Fit, name: str) -> float:
    """Return the share of the whitened error that one term keeps off, as far as a linear refit of
    the others tells.
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
