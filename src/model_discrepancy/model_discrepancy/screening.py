"""Screening: what each candidate would at best take off the whitened residual, without refitting the model.

A score (Lagrange multiplier) test: the candidate is tried on a grid of its nonlinear parameters; what
the present model could imitate, by its linear parameters or by small changes of its nonlinear ones,
is projected out first.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

import numpy as np

from ankle_physics.term import Place, term_library
from model_discrepancy.columns import Columns
from model_discrepancy.fit import Fit, Fitter, _linear, bounded, from_unit, nonlinear, orthonormal

# Not searched: their torque follows no movement (voluntary torque), or a recording cannot tell them
# from inertia or stiffness, which the projection would only show after much work.
NOT_SEARCHED = frozenset({"inertia", "viscosity", "stiffness", "reflex", "voluntary_torque", "gravity", "footplate_inertia", "tremor"})
_GRID = {0: 1, 1: 9, 2: 5, 3: 4}
# A column that keeps less than this share of its norm is what the model already has.
_DISTINCT = 0.02


@dataclass(frozen=True)
class Screened:
    """A candidate at the best point of its grid.

    Attributes:
        name: the term.
        start: where a refit begins: values of the term.
        share: of the sum of squares of the whitened residual that it takes off, 0...1.
        distinct: share of the norm of its torque that the present model cannot imitate.
    """

    name: str
    start: dict[str, float]
    share: float
    distinct: float


def screen(fitter: Fitter, fit: Fit, names: Sequence[str]) -> list[Screened]:
    """Candidates, the most promising first."""
    used = fitter.rows.used
    derivatives, labels = fitter.derivatives(fit)
    basis = orthonormal(derivatives[used])
    residual = fit.residual[used]
    residual = residual - basis @ (basis.T @ residual)
    slopes = derivatives[:, [k for k, (n, s) in enumerate(labels) if not term_library()[n].parameter(s).linear]][used]
    found = []
    for name in names:
        additive = any(p.linear for p in term_library()[name].parameters)
        points = [
            _additive(fitter, fit, name, point, basis, residual) if additive else _shaping(fitter, fit, name, point, slopes)
            for point in grid(name)
        ]
        found.append(max(points, key=lambda s: s.share))
    return sorted(found, key=lambda s: -s.share)


def candidates(fit: Fit, library: Sequence[str] | None = None) -> list[str]:
    """Terms that may be added to the model."""
    names = library if library is not None else list(term_library())
    rigid = any(term_library()[n].place is Place.COUPLING for n in fit.terms)
    return [n for n in names if n not in fit.terms and n not in NOT_SEARCHED and not (rigid and term_library()[n].place is Place.COUPLING)]


def grid(name: str) -> list[dict[str, float]]:
    """Points of the candidate's nonlinear parameters, evenly spread over their (scaled) ranges."""
    free = nonlinear([name])
    count = _GRID[min(len(free), 3)]
    places = (np.arange(count) + 0.5) / count
    return [
        {p.symbol: from_unit(p, float(u)) for (_, p), u in zip(free, units, strict=True)} for units in product(places, repeat=len(free))
    ]


def _additive(fitter: Fitter, fit: Fit, name: str, point: dict[str, float], basis: np.ndarray, residual: np.ndarray) -> Screened:
    columns, rows = fitter.columns, fitter.rows
    values = _with(columns, fit, name, point)
    spectra = {c: s for c, s in columns.spectra(values).items() if c[0] == name}
    matrix = fitter.whitened(spectra.values())[rows.used]
    norm = np.linalg.norm(matrix, axis=0)
    matrix = matrix - basis @ (basis.T @ matrix)
    distinct = float(np.max(np.linalg.norm(matrix, axis=0) / np.where(norm > 0, norm, 1.0)))
    if distinct < _DISTINCT:
        return Screened(name, values[name], 0.0, distinct)
    amplitudes = bounded(matrix, residual, [_linear(c) for c in spectra])
    left = residual - matrix @ amplitudes
    start = values[name] | {symbol: float(a) for (_, symbol), a in zip(spectra, amplitudes, strict=True)}
    return Screened(name, start, 1.0 - float(left @ left) / fit.score, distinct)


def _shaping(fitter: Fitter, fit: Fit, name: str, point: dict[str, float], slopes: np.ndarray) -> Screened:
    columns, rows = fitter.columns, fitter.rows
    values = _with(columns, fit, name, point)
    spectra = columns.spectra(values)
    matrix = fitter.whitened(spectra.values())[rows.used]
    amplitudes = bounded(matrix, fitter.target[rows.used], [_linear(c) for c in spectra])
    left = fitter.target[rows.used] - matrix @ amplitudes
    given = dict(zip(spectra, amplitudes, strict=True))
    own = [fitter.slope(values, name, p, given, spectra)[rows.used] for _, p in nonlinear([name])]
    span = orthonormal(np.column_stack([matrix, slopes, *own]))
    refined = left - span @ (span.T @ left)
    # The linearised refit may leave the bounds; it counts only as far as the bounded one bears it out.
    score = min(float(left @ left), max(float(refined @ refined), 0.5 * float(left @ left)))
    return Screened(name, values[name], 1.0 - score / fit.score, 1.0)


def _with(columns: Columns, fit: Fit, name: str, point: dict[str, float]) -> dict[str, dict[str, float]]:
    own = {p.symbol: p.typical for p in term_library()[name].parameters} | columns.convention(name) | point
    return {**fit.values, name: own}
