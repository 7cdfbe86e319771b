"""Screening: what each candidate would at best take off the whitened residual, without refitting
the model.

A score (Lagrange multiplier) test: the candidate is tried on a grid of its nonlinear parameters;
what the present model could imitate, by its linear parameters or by small changes of its nonlinear
ones, is projected out first.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from typing import NamedTuple

import numpy as np

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.term import ModelValues, Parameter, Place, Term, term_library
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.coupled_foot import Foot
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.least_squares import (
    bounded,
    lengths,
    orthonormal,
    runs_away,
    unexplained,
)
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.fit.parameter_scale import from_unit, nonlinear, ranges
from model_discrepancy.fit.signal_path import FOOT_IMPEDANCE
from model_discrepancy.search.acting_stretches import FEWEST_STRETCHES, acting_in
from model_discrepancy.search.null import Null

_GRID = {0: 1, 1: 9, 2: 5, 3: 4}
# Frequencies of a rhythm that are tried: two for each resolved one over 100 s up to 2 Hz.
_MOST_FREQUENCIES = 400
# A column that keeps less than this share of its norm is what the model already has.
_MIN_NEW_SHARE = 0.02
# Points at which a candidate that shapes a signal is refined.
_REFINED_POINTS = 3

Point = dict[str, float]


class _AtPoint(NamedTuple):
    """Holds what a candidate that changes a signal leaves at a point: the sum of squares, all
    values, the residual rows, the foot, and the rows of the torque that it changes; None where no
    surrogates are tried.
    """

    error: float
    values: ModelValues
    left: np.ndarray
    foot: Foot | None
    changed: np.ndarray | None


@dataclass(frozen=True)
class Screened:
    """Holds a candidate at the best point of its grid.

    Attributes
    ----------
    name
        The term.
    start
        Where a refit begins: values of the term.
    share
        Of the sum of squares of the whitened residual that it takes off, 0...1.
    tried
        Share at every point of the grid that was tried.
    starts
        Where a refit from each of these points begins.
    """

    name: str
    start: dict[str, float]
    share: float
    tried: tuple[tuple[float, Point], ...]
    starts: tuple[dict[str, float], ...]


# At a point of a grid a foot may run away; such a point takes nothing off.
@np.errstate(over="ignore", invalid="ignore")
def screen(
    fitter: Fitter,
    fit: Fit,
    points: Mapping[str, Sequence[Point]],
    null: Null | None = None,
) -> list[Screened]:
    """Rank the candidates, the most promising first.

    Parameters
    ----------
    fitter
        Whitened by the present model.
    fit
        The present model.
    points
        Values of the nonlinear parameters to try, by candidate.
    null
        Surrogates that every candidate tries as well.
    """
    used = fitter.rows.fitted
    derivatives, labels = fitter.derivatives(fit)
    basis = orthonormal(derivatives[used])
    residual = fit.residual[used]
    residual = residual - basis @ (basis.T @ residual)
    if null is not None:
        null.project_out(basis)
    slopes = derivatives[
        :, [k for k, (n, s) in enumerate(labels) if not term_library()[n].parameter(s).linear]
    ][used]

    def screened(name: str) -> Screened:
        tried = points[name]
        if any(p.linear for p in term_library()[name].parameters):
            one = partial(_additive, fitter, fit, name, basis, residual, null)
            # What the points observe of the surrogates goes to one place.
            results = in_parallel(one, tried) if null is None else [one(point) for point in tried]
        else:
            results = _shaping(fitter, fit, name, tried, slopes, basis, null)
        best = max(range(len(tried)), key=lambda k: results[k][0])
        shares = tuple((result[0], point) for result, point in zip(results, tried, strict=True))
        starts = tuple(start for _, start in results)
        return Screened(name, starts[best], results[best][0], shares, starts)

    # The longest first, so that no core waits for one at the end.
    longest_first = sorted(points, key=lambda name: -len(points[name]))
    return sorted(in_parallel(screened, longest_first), key=lambda s: -s.share)


def candidates(fit: Fit, library: Sequence[str] | None = None) -> list[str]:
    """Return the terms that may be added to the model."""
    terms = term_library()
    names = library if library is not None else list(terms)
    coupled = any(moves_foot(n) for n in fit.terms)
    return [
        n
        for n in names
        if n not in fit.terms
        and (terms[n].searched or n in FOOT_IMPEDANCE)
        and not (coupled and moves_foot(n))
    ]


def moves_foot(name: str) -> bool:
    """Say whether a term lets the foot move differently from the plate; a model holds one such."""
    term = term_library()[name]
    return term.place is Place.COUPLING and (
        issubclass(term, CompliantCoupling) or term.transform is not Term.transform
    )


def with_term(terms: Sequence[str], name: str) -> list[str]:
    """Return the terms with one more and its companions."""
    return [*terms, *(n for n in (name, *term_library()[name].companions) if n not in terms)]


def without_term(terms: Sequence[str], name: str) -> list[str]:
    """Return the terms without this one, its companions, and what frees how it turns, unless
    another term turns so, too.
    """
    library = term_library()
    turning = library[name].turned_by
    left = [n for n in terms if n not in (name, *library[name].companions)]
    shared = any(library[n].turned_by == turning for n in left)
    return [n for n in left if shared or n != turning]


def with_turning(fitter: Fitter, fit: Fit) -> Fit:
    """Return a model in which friction turns in a way of its own, refitted; the same where none of
    its terms does, or all may already.
    """
    library = term_library()
    turning = dict.fromkeys(library[n].turned_by for n in fit.terms if library[n].turned_by)
    missing = [name for name in turning if name not in fit.terms]
    return fitter.fit([*fit.terms, *missing], fit.values, evaluations=15) if missing else fit


def grid(name: str, duration: float) -> list[Point]:
    """Return the points of the candidate's nonlinear parameters, evenly spread over their (scaled)
    ranges unless a parameter states others.

    Parameters
    ----------
    name
        The term.
    duration
        Of the recording [s], which resolves frequencies.
    """
    free = nonlinear([name])
    count = _GRID[min(sum(not p.tried for _, p in free), 3)]
    resolved = term_library()[name].resolved_by_duration
    values = [
        _resolved(p, duration)
        if p.symbol == resolved
        else p.tried or [from_unit(p, (k + 0.5) / count) for k in range(count)]
        for _, p in free
    ]
    return [
        {p.symbol: value for (_, p), value in zip(free, point, strict=True)}
        for point in product(*values)
    ]


def _resolved(parameter: Parameter, duration: float) -> list[float]:
    """Return frequencies half a resolution apart, so that a refit finds the one in between."""
    count = math.ceil(2.0 * duration * (parameter.upper - parameter.lower))
    return np.linspace(
        parameter.lower, parameter.upper, min(count, _MOST_FREQUENCIES), dtype=float
    ).tolist()


def _additive(
    fitter: Fitter,
    fit: Fit,
    name: str,
    basis: np.ndarray,
    residual: np.ndarray,
    null: Null | None,
    point: Point,
) -> tuple[float, dict[str, float]]:
    """Return the share and start of a candidate that adds torque."""
    columns, rows = fitter.columns, fitter.rows
    values = _with(columns, fit, name, point)
    # The candidate's own torque does not move the foot yet.
    foot = columns.foot(fit.values)
    spectra = {c: s for c, s in columns.spectra(values, foot).items() if c[0] == name}
    matrix = fitter.whitened(spectra.values())[rows.fitted]
    if runs_away(matrix):
        return 0.0, values[name]
    norm = lengths(matrix)
    matrix = matrix - basis @ (basis.T @ matrix)
    if np.max(lengths(matrix) / np.where(norm > 0, norm, 1.0)) < _MIN_NEW_SHARE:
        return 0.0, values[name]
    span = orthonormal(matrix)
    if acting_in(rows.time[rows.fitted], span) < FEWEST_STRETCHES:
        return 0.0, values[name]
    if null is not None:
        null.observe(name, span, point)
    amplitudes = bounded(matrix, residual, *ranges(spectra))
    left = residual - matrix @ amplitudes
    start = values[name] | {
        symbol: float(a) for (_, symbol), a in zip(spectra, amplitudes, strict=True)
    }
    return 1.0 - float(left @ left) / fit.score, start


def _shaping(
    fitter: Fitter,
    fit: Fit,
    name: str,
    points: Sequence[Point],
    slopes: np.ndarray,
    basis: np.ndarray,
    null: Null | None,
) -> list[tuple[float, dict[str, float]]]:
    """Return the share and start of a candidate that changes a signal on its way, at each point;
    each point tries the surrogates, too.
    """
    columns, used = fitter.columns, fitter.rows.fitted
    here = None if null is None else columns.torque(fit.values)

    def tried(point: Point) -> _AtPoint:
        values = _with(columns, fit, name, point)
        foot = _foot(columns, fit, values)
        changed = None if here is None else _changed(fitter, fit, values, foot, here)
        left, values = _left(fitter, values, foot)
        return _AtPoint(float(left @ left), values, left, foot, changed)

    results = in_parallel(tried, points)
    if null is not None:
        _observe_shaping(name, points, [at_point.changed for at_point in results], basis, null)
    time, before = fitter.rows.time[used], fit.residual[used]
    shares = [
        1.0 - at.error / fit.score if acting_in(time, at.left - before) >= FEWEST_STRETCHES else 0.0
        for at in results
    ]
    # The present model's nonlinear parameters follow where it matters: at the best points.
    best = sorted(range(len(points)), key=lambda k: -shares[k])[:_REFINED_POINTS]
    for k in (k for k in best if shares[k] != 0.0):
        error, values, left, foot, _ = results[k]
        spectra = columns.spectra(values, foot)
        matrix = fitter.whitened([s for c, s in spectra.items() if c[0] not in fitter.held])[used]
        given = {(n, symbol): values[n][symbol] for n, symbol in spectra}
        own = [
            fitter.slope(values, name, p, given, spectra, foot=foot)[used]
            for _, p in nonlinear([name])
        ]
        refined = unexplained(np.vstack([matrix.T, slopes.T, *own]).T, left)
        # The linearised refit may leave the bounds; it counts only as far as the bounded one bears
        # it out.
        shares[k] = 1.0 - min(error, max(refined, 0.5 * error)) / fit.score
    return [(share, at.values[name]) for share, at in zip(shares, results, strict=True)]


def _foot(columns: Columns, fit: Fit, values: ModelValues) -> Foot | None:
    """Return the foot beside which a candidate is tried: that of the present model, or, where the
    candidate is what lets it move, that of the values after one round.
    """
    present = columns.foot(fit.values)
    return present if present is not None else columns.foot(values, rounds=1)


def _left(fitter: Fitter, values: ModelValues, foot: Foot | None) -> tuple[np.ndarray, ModelValues]:
    """Return the residual rows with all amplitudes solved for but those of held terms, and the
    values with these amplitudes; a model that runs away explains nothing.
    """
    used = fitter.rows.fitted
    spectra = fitter.columns.spectra(values, foot)
    target = fitter.target[used]
    offset = fitter.columns.offset(values, foot)
    if offset is not None:
        target = target - fitter.rows.whitened(offset)[used]
    fixed = {c: s for c, s in spectra.items() if c[0] in fitter.held}
    if fixed:
        amplitudes = np.array([values[n][symbol] for n, symbol in fixed])
        target = target - fitter.whitened(fixed.values())[used] @ amplitudes
    free = {c: s for c, s in spectra.items() if c not in fixed}
    matrix = fitter.whitened(free.values())[used]
    if runs_away(matrix):
        return target, values
    amplitudes = bounded(matrix, target, *ranges(free))
    filled = {n: dict(v) for n, v in values.items()}
    for (n, symbol), amplitude in zip(free, amplitudes, strict=True):
        filled[n][symbol] = float(amplitude)
    return target - matrix @ amplitudes, filled


def _changed(
    fitter: Fitter,
    fit: Fit,
    values: ModelValues,
    foot: Foot | None,
    here: np.ndarray,
) -> np.ndarray:
    """Return the whitened torque that a candidate changes at these values, where the present
    model's parameters and torque stay as they are, shape (rows,).
    """
    columns = fitter.columns
    changed = columns.spectra(values, foot)
    own = {c: spectrum for c, spectrum in changed.items() if c[0] in fit.values}
    shift = sum(fit.values[n][s] * spectrum for (n, s), spectrum in own.items()) - here
    offset = columns.offset(values, foot)
    shift = shift if offset is None else shift + offset
    return fitter.rows.whitened(np.asarray(shift))[fitter.rows.fitted]


def _observe_shaping(
    name: str,
    points: Sequence[Point],
    changes: Sequence[np.ndarray | None],
    basis: np.ndarray,
    null: Null,
) -> None:
    """Let a candidate that changes a signal try the surrogates, by the torque that it changes."""
    for point, change in zip(points, changes, strict=True):
        assert change is not None
        column = change[:, None]
        column = column - basis @ (basis.T @ column)
        if np.linalg.norm(column) > 0.0:
            null.observe(name, orthonormal(column), point)


def _with(columns: Columns, fit: Fit, name: str, point: Point) -> ModelValues:
    values = dict(fit.values)
    for added in with_term((), name):
        values.setdefault(
            added,
            {p.symbol: p.default for p in term_library()[added].parameters}
            | columns.convention(added),
        )
    values[name] = values[name] | point
    return values
