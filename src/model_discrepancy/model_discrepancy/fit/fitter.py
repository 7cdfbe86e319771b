"""Fit of a list of terms to a recording by variable projection (Golub & Pereyra 2003, Inverse
Problems 19, R1).

For given nonlinear parameters the linear ones follow from bounded least squares, so that only the
nonlinear ones are searched; physical signs and ranges hold inside the fit.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from scipy.optimize import least_squares, lsq_linear

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.term import Parameter, term_library
from model_discrepancy.fit.block_bootstrap import bootstrap_changes
from model_discrepancy.fit.columns import FOOT_IMPEDANCE, Column, Columns
from model_discrepancy.fit.rows import LOW_PASS_HZ, Rows
from model_discrepancy.recording.motion import Motion

Start = Mapping[str, Mapping[str, float]]
Spectra = Mapping[Column, np.ndarray]
# Step of numerical derivatives and width of "at the bound", in units of the scaled range 0...1.
_STEP = 1e-4
# A refit to half of the rows stays within this share of a nonlinear parameter's range.
_LINEAR_SHARE = 0.1
# Whitened columns kept: two models of twelve columns each; one takes 0.1 to 0.2 MB.
_CACHE_SIZE = 24
# A model is compared with several candidates in turn; the derivatives of one take 3 MB.
_DERIVATIVES_KEPT = 4
_BOUND_MARGIN = 2e-3
# Evaluations after which a fit is asked whether it may still do what it is for. Its steps shrink
# like a geometric series, by a third and more from stage to stage.
STAGE = 4
STAGES_AHEAD = 2.0
# The tolerance of a single fit.
_CONVERGED_SHARE = 1e-4
# Ranges that span more than this ratio are searched on a logarithmic scale.
_LOG_RATIO = 8.0
# Of the torque's variance: a quarter of its noise at the paper's SNR (24.1 dB). What changes less
# is below any instrument's own errors. In a loop whose command was recorded, torque that moved the
# plate lets generic regressors predict up to a half of it.
MATERIAL_SHARE = 1e-3


@dataclass
class Fit:
    """Holds a fitted model.

    Attributes
    ----------
    values
        Every parameter by term and symbol.
    errors
        Standard errors of the fitted ones, likewise.
    residual
        Whitened residual, shape (rows.count,), of all rows whatever was fitted.
    left
        Spectrum of the residual torque, as `Rows.spectrum`.
    rows
        The operator that makes rows of it.
    score
        Sum of squares of the whitened residual over the fitted rows.
    size
        Number of fitted parameters.
    at_bounds
        "term.symbol" of parameters that ended at a bound.
    draws
        Change of each free parameter from draw to draw of the recording's stretches, by term and
        symbol, each of shape (block_bootstrap.DRAWS,); empty without standard errors.
    """

    values: dict[str, dict[str, float]]
    residual: np.ndarray
    left: np.ndarray = field(repr=False)
    rows: Rows = field(repr=False)
    score: float
    size: int
    errors: dict[str, dict[str, float]] = field(default_factory=dict)
    at_bounds: tuple[str, ...] = ()
    draws: dict[Column, np.ndarray] = field(default_factory=dict, repr=False)

    @cached_property
    def plain(self) -> np.ndarray:
        """Return the plain residual [N.m], shape (rows.count,)."""
        return self.rows.plain(self.left)

    @property
    def terms(self) -> tuple[str, ...]:
        """Return the names of the model's terms."""
        return tuple(self.values)


def nonlinear(names: Sequence[str]) -> list[tuple[str, Parameter]]:
    """Return the nonlinear fitted parameters of these terms, with the term's name."""
    return [
        (name, p)
        for name in names
        for p in term_library()[name].parameters
        if p.fitted and not p.linear
    ]


def searched(names: Sequence[str]) -> list[tuple[str, Parameter]]:
    """Return the parameters that a fit searches for.

    They are the nonlinear ones, and the foot's impedance where a compliant fixation filters by it.
    """
    coupled = any(issubclass(term_library()[name], CompliantCoupling) for name in names)
    foot = [
        (name, p)
        for name in names
        if coupled and name in FOOT_IMPEDANCE
        for p in term_library()[name].parameters
        if p.linear
    ]
    return nonlinear(names) + foot


def to_unit(parameter: Parameter, value: float) -> float:
    """Return a parameter on the scale 0...1 of its range."""
    if parameter.lower > 0 and parameter.upper / parameter.lower > _LOG_RATIO:
        return float(np.log(value / parameter.lower) / np.log(parameter.upper / parameter.lower))
    return (value - parameter.lower) / (parameter.upper - parameter.lower)


def from_unit(parameter: Parameter, unit: float) -> float:
    """Invert `to_unit`; values outside 0...1 are brought to the bounds."""
    unit = min(max(unit, 0.0), 1.0)
    if parameter.lower > 0 and parameter.upper / parameter.lower > _LOG_RATIO:
        return float(parameter.lower * (parameter.upper / parameter.lower) ** unit)
    return parameter.lower + unit * (parameter.upper - parameter.lower)


class Fitter:
    """Fits models to one recording.

    Parameters
    ----------
    columns
        Of the recording.
    rows
        With the whitening that is to be used; None for those of the columns.
    held
        Values of terms that are known, by term and symbol, such as a calibrated rig's; they are
        never fitted.
    """

    def __init__(
        self, columns: Columns, rows: Rows | None = None, held: Start | None = None
    ) -> None:
        self.columns = columns
        self.rows = columns.rows if rows is None else rows
        self.held: Start = held or {}
        self.plain_target = self.rows.plain(columns.target)
        self._refresh()

    @classmethod
    def of(cls, motion: Motion, limit: float = LOW_PASS_HZ, held: Start | None = None) -> Fitter:
        """Build the problem of one recording: its columns and rows up to a limit [Hz], not
        whitened.
        """
        return cls(Columns(motion, Rows(len(motion.position), motion.rate, limit)), held=held)

    def unwhitened(self) -> Fitter:
        """Return a fitter of this problem that minimises the plain error."""
        return Fitter(self.columns, self.rows.unwhitened(), self.held)

    def along(self, motion: Motion) -> Fitter:
        """Return a fitter with this problem and whitening for another movement of that length."""
        return Fitter(Columns(motion, self.rows), held=self.held)

    def holding(self, held: Start) -> Fitter:
        """Return a fitter of this problem that holds these terms too."""
        return Fitter(self.columns, self.rows, {**self.held, **held})

    def searched(self, names: Sequence[str]) -> list[tuple[str, Parameter]]:
        """Return the parameters of these terms that a fit searches for and that are not held."""
        return [(name, p) for name, p in searched(names) if name not in self.held]

    @property
    def motion(self) -> Motion:
        """Return the motion that drives the model."""
        return self.columns.motion

    def whiten_by(self, noise: np.ndarray) -> None:
        """Whiten by these plain rows [N.m], shape (rows.count,), from now on."""
        self.rows.whiten_by(noise)
        self._refresh()

    def _refresh(self) -> None:
        self.target = self.rows.whitened(self.columns.target)
        self._whitened: OrderedDict[int, tuple[np.ndarray, np.ndarray]] = OrderedDict()
        self._derivatives: OrderedDict[tuple[int, bool], tuple[Fit, np.ndarray, list[Column]]] = (
            OrderedDict()
        )

    def whitened(self, spectra: Iterable[np.ndarray]) -> np.ndarray:
        """Return the whitened rows of these spectra, shape (count, size); remembered as long as
        `Columns` gives out the same spectra.
        """
        rows = []
        for spectrum in spectra:
            known = self._whitened.pop(id(spectrum), None)
            if known is None:
                known = (spectrum, self.rows.whitened(spectrum))
                if len(self._whitened) >= _CACHE_SIZE:
                    self._whitened.popitem(last=False)
            self._whitened[id(spectrum)] = known
            rows.append(known[1])
        return np.column_stack(rows)

    def start_values(
        self, names: Sequence[str], start: Start | None = None
    ) -> dict[str, dict[str, float]]:
        """Return the typical values of these terms, conventions set, overridden by `start` where it
        has the term.
        """
        values = {}
        for name in names:
            values[name] = {
                p.symbol: p.default for p in term_library()[name].parameters
            } | self.columns.convention(name)
            for given in (start or {}, self.held):
                values[name] |= given.get(name, {})
        return values

    def fit(
        self,
        names: Sequence[str],
        start: Start | None = None,
        mask: np.ndarray | None = None,
        evaluations: int = 40,
        tolerance: float = 1e-4,
    ) -> Fit:
        """Fit these terms from one start.

        Parameters
        ----------
        names
            Terms.
        start
            Values to begin with, by term.
        mask
            Rows to fit, bool, shape (rows.count,); None for all that are usable.
        evaluations
            Of the residual at most.
        tolerance
            Relative change of the sum of squares at which it ends; ten times as much in the scaled
            parameters.
        """
        mask = self.rows.used if mask is None else mask & self.rows.used
        values = self.start_values(names, start)
        free = self.searched(names)
        if free:
            problem = _Projection(self, values, free, mask)
            first = np.array(
                [
                    min(max(to_unit(p, values[name][p.symbol]), 2 * _STEP), 1 - 2 * _STEP)
                    for name, p in free
                ]
            )
            found = least_squares(
                problem.residual,
                first,
                jac=problem.jacobian,
                bounds=(0.0, 1.0),
                x_scale=1.0,
                max_nfev=evaluations,
                ftol=tolerance,
                xtol=10.0 * tolerance,
            )
            values = problem.values_at(found.x)
        return self.solve(values, mask)

    def fit_below(
        self,
        names: Sequence[str],
        start: Start,
        limit: float,
        evaluations: int,
    ) -> Fit:
        """Fit these terms as long as their score may still come below a limit.

        Parameters
        ----------
        names
            Terms.
        start
            Values to begin with, by term.
        limit
            Of the score. The fit ends early where two more stages of `STAGE` evaluations, each of
            which lowers the score as much as the last one did, would not reach it.
        evaluations
            Of the residual at most.
        """
        last = self.solve(self.start_values(names, start)).score
        fit = self.fit(names, start, evaluations=STAGE)
        for _ in range(STAGE, evaluations, STAGE):
            fell = last - fit.score
            if fell < _CONVERGED_SHARE * fit.score or fit.score - STAGES_AHEAD * fell > limit:
                break
            last = fit.score
            fit = self.fit(names, fit.values, evaluations=STAGE)
        return fit

    def solve(self, values: Start, mask: np.ndarray | None = None) -> Fit:
        """Return the fit with these values of what is searched for; only the other, linear
        parameters are solved for.
        """
        mask = self.rows.used if mask is None else mask & self.rows.used
        spectra = self.columns.spectra(values)
        order = list(spectra)
        matrix = self.whitened(spectra.values())
        amplitudes = np.array([float(values[name][symbol]) for name, symbol in order])
        given = {(name, p.symbol) for name, p in self.searched(list(values))}
        given |= {column for column in order if column[0] in self.held}
        open_ = np.array([column not in given for column in order])
        rest = self.target - matrix[:, ~open_] @ amplitudes[~open_]
        amplitudes[open_] = bounded(
            matrix[mask][:, open_], rest[mask], *ranges(c for c in order if c not in given)
        )
        residual = self.target - matrix @ amplitudes
        left = self.columns.target - sum(
            a * spectra[c] for a, c in zip(amplitudes, order, strict=True)
        )
        filled = {name: dict(given) for name, given in values.items()}
        for amplitude, (name, symbol) in zip(amplitudes, order, strict=True):
            filled[name][symbol] = float(amplitude)
        size = len(nonlinear(list(values))) + len(order)
        return Fit(
            filled,
            residual,
            left,
            self.rows,
            float(residual[mask] @ residual[mask]),
            size,
            at_bounds=_bounds(filled),
        )

    def evaluate(self, values: Start) -> Fit:
        """Evaluate the model with these values, linear ones too, without fitting anything."""
        left = self.columns.target - sum(
            values[name][symbol] * s for (name, symbol), s in self.columns.spectra(values).items()
        )
        residual, used = self.rows.whitened(left), self.rows.used
        return Fit(
            {n: dict(v) for n, v in values.items()},
            residual,
            left,
            self.rows,
            float(residual[used] @ residual[used]),
            0,
        )

    def derivatives(self, fit: Fit, plain: bool = False) -> tuple[np.ndarray, list[Column]]:
        """Return the columns and derivatives by the nonlinear parameters per unit of the scaled
        range, shape (count, size), whitened or plain; those of the last few fits are remembered.
        """
        known = self._derivatives.pop((id(fit), plain), None)
        if known is None:
            known = (fit, *self._differentiated(fit, plain))
            if len(self._derivatives) >= _DERIVATIVES_KEPT:
                self._derivatives.popitem(last=False)
        self._derivatives[id(fit), plain] = known
        return known[1], known[2]

    def _differentiated(self, fit: Fit, plain: bool) -> tuple[np.ndarray, list[Column]]:
        spectra = self.columns.spectra(fit.values)
        amplitudes = {(n, symbol): fit.values[n][symbol] for n, symbol in spectra}
        found = {
            c: self.rows.plain(s) if plain else self.whitened([s])[:, 0]
            for c, s in spectra.items()
            if c[0] not in self.held
        }
        for name, parameter in self.searched(fit.terms):
            slope = self.slope(fit.values, name, parameter, amplitudes, spectra, plain)
            found[name, parameter.symbol] = (
                slope / _stretch(parameter, fit.values[name][parameter.symbol])
                if parameter.linear
                else slope
            )
        return np.column_stack(list(found.values())), list(found)

    def room(self, fit: Fit, labels: Sequence[Column]) -> tuple[np.ndarray, np.ndarray]:
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

    def slope(
        self,
        values: Start,
        name: str,
        parameter: Parameter,
        amplitudes: Mapping[Column, float],
        here: Spectra,
        plain: bool = False,
    ) -> np.ndarray:
        """Return the derivative of the model torque, whitened or plain, by a searched parameter per
        unit of its scaled range, shape (count,).

        One-sided difference.

        Parameters
        ----------
        values
            Where to differentiate.
        name, parameter
            By what.
        amplitudes
            Of the columns.
        here
            The columns at `values`.
        plain
            Not whitened.
        """
        unit = to_unit(parameter, values[name][parameter.symbol])
        step = _STEP if unit + _STEP <= 1.0 else -_STEP
        moved = _moved(values, name, parameter, unit + step)
        # Columns that the parameter does not touch come back as the very same arrays.
        change = sum(
            amplitudes[c] * (s - here[c])
            for c, s in self.columns.spectra(moved).items()
            if s is not here[c]
        )
        if parameter.linear:
            change = (
                change
                + (moved[name][parameter.symbol] - amplitudes[name, parameter.symbol])
                * here[name, parameter.symbol]
            )
        rows = self.rows.plain if plain else self.rows.whitened
        return np.zeros(self.rows.count) if isinstance(change, int) else rows(change) / step

    def with_errors(self, fit: Fit) -> Fit:
        """Return the fit with standard errors; parameters at bounds are held.

        The errors are those of whitened least squares or of stretches, whichever are larger.
        """
        matrix, labels = self.derivatives(fit)
        used = self.rows.used
        held = set(fit.at_bounds)
        free = [k for k, (name, symbol) in enumerate(labels) if f"{name}.{symbol}" not in held]
        part = matrix[used][:, free]
        scale = np.linalg.norm(part, axis=0)
        scale[scale == 0] = 1.0
        information = (part / scale).T @ (part / scale)
        variance = fit.score / max(int(used.sum()) - len(free), 1)
        covariance = (
            np.diag(np.linalg.pinv(information, rcond=1e-12, hermitian=True)) * variance / scale**2
        )
        changes = bootstrap_changes(matrix[:, free], fit.residual, used, self.rows.rate)
        drawn = np.std(changes, axis=0, ddof=1)
        errors: dict[str, dict[str, float]] = {name: {} for name in fit.terms}
        spreads = np.fmax(np.sqrt(np.maximum(covariance, 0.0)), drawn)
        for place, (k, spread) in enumerate(zip(free, spreads, strict=True)):
            name, symbol = labels[k]
            parameter = term_library()[name].parameter(symbol)
            unit = 1.0 if parameter.linear else _stretch(parameter, fit.values[name][symbol])
            errors[name][symbol] = float(spread * unit)
            if np.isfinite(drawn[place]) and drawn[place] > 0.0:
                fit.draws[name, symbol] = changes[:, place] * unit * spread / drawn[place]
        fit.errors = errors
        return fit


class _Projection:
    """Computes residual and Jacobian without the linear parameters (Kaufman's approximation)."""

    def __init__(
        self,
        fitter: Fitter,
        values: dict[str, dict[str, float]],
        free: list[tuple[str, Parameter]],
        mask: np.ndarray,
    ) -> None:
        self._fitter, self._values, self._free, self._mask = fitter, values, free, mask
        self._at: np.ndarray | None = None

    def values_at(self, units: np.ndarray) -> dict[str, dict[str, float]]:
        values = {name: dict(given) for name, given in self._values.items()}
        for (name, parameter), unit in zip(self._free, units, strict=True):
            values[name][parameter.symbol] = from_unit(parameter, float(unit))
        return values

    def residual(self, units: np.ndarray) -> np.ndarray:
        self._fit = self._fitter.solve(self.values_at(units), self._mask)
        self._at = units.copy()
        return self._fit.residual[self._mask]

    def jacobian(self, units: np.ndarray) -> np.ndarray:
        if self._at is None or not np.array_equal(units, self._at):
            self.residual(units)
        values = self.values_at(units)
        spectra = self._fitter.columns.spectra(values)
        amplitudes = {(n, symbol): self._fit.values[n][symbol] for n, symbol in spectra}
        slopes = np.column_stack(
            [self._fitter.slope(values, name, p, amplitudes, spectra) for name, p in self._free]
        )[self._mask]
        # Columns at a bound do not follow, so they are not projected out.
        own = {(name, p.symbol) for name, p in self._free}
        inside = [
            s
            for (n, symbol), s in spectra.items()
            if (n, symbol) not in own
            and n not in self._fitter.held
            and f"{n}.{symbol}" not in self._fit.at_bounds
        ]
        if inside:
            basis = orthonormal(self._fitter.whitened(inside)[self._mask])
            slopes = slopes - basis @ (basis.T @ slopes)
        return -slopes


def _moved(
    values: Start, name: str, parameter: Parameter, unit: float
) -> dict[str, dict[str, float]]:
    """Return the values with one parameter at another place of its scaled range."""
    moved = {n: dict(v) for n, v in values.items()}
    moved[name][parameter.symbol] = from_unit(parameter, unit)
    return moved


def orthonormal(matrix: np.ndarray) -> np.ndarray:
    """Return the orthonormal basis of the columns' span, shape (n, rank)."""
    scale = np.linalg.norm(matrix, axis=0)
    kept = matrix[:, scale > 0] / scale[scale > 0]
    eigenvalues, vectors = np.linalg.eigh(kept.T @ kept)
    large = eigenvalues > 1e-10 * eigenvalues[-1]
    return kept @ (vectors[:, large] / np.sqrt(eigenvalues[large]))


def bounded(
    matrix: np.ndarray, target: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Return the least-squares amplitudes within ranges, each of shape (p,)."""
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0] = 1.0
    scaled = matrix / scale
    gram = scaled.T @ scaled
    gram[np.diag_indices_from(gram)] += 1e-10
    factor = np.linalg.cholesky(gram).T
    right = np.linalg.solve(factor.T, scaled.T @ target)
    lower, upper = lower * scale, upper * scale
    free = np.linalg.solve(factor, right)
    if np.all((free >= lower) & (free <= upper)):
        return free / scale
    return lsq_linear(factor, right, (lower, upper), method="bvls").x / scale


def ranges(columns: Iterable[Column]) -> tuple[np.ndarray, np.ndarray]:
    """Lower and upper ends of the linear parameters of these columns."""
    parameters = [term_library()[name].parameter(symbol) for name, symbol in columns]
    return np.array([p.lower for p in parameters]), np.array([p.upper for p in parameters])


def _stretch(parameter: Parameter, value: float) -> float:
    """Return the derivative of a parameter by its scaled value."""
    unit = to_unit(parameter, value)
    low, high = max(unit - _STEP, 0.0), min(unit + _STEP, 1.0)
    return (from_unit(parameter, high) - from_unit(parameter, low)) / (high - low)


def _bounds(values: Start) -> tuple[str, ...]:
    """Return the names of fitted parameters at a bound of their range."""
    found = []
    for name, given in values.items():
        for p in term_library()[name].parameters:
            if not p.fitted:
                continue
            unit = to_unit(p, given[p.symbol]) if p.lower <= given[p.symbol] <= p.upper else 0.0
            width = 1e-9 if p.linear else _BOUND_MARGIN
            if unit <= width or unit >= 1.0 - width:
                found.append(f"{name}.{p.symbol}")
    return tuple(found)
