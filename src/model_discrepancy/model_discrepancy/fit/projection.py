"""Residual and Jacobian of a fit whose linear parameters are projected out (Golub & Pereyra 2003,
Inverse Problems 19, R1).
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ankle_physics.term import ModelValues, Parameter
from model_discrepancy.fit.least_squares import columns_of, orthonormal
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.fit.parameter_scale import UNIT_STEP, from_unit, to_unit

if TYPE_CHECKING:
    from model_discrepancy.fit.coupled_foot import Foot
    from model_discrepancy.fit.fit_result import Fit
    from model_discrepancy.fit.fitter import Fitter

# Steps between two computations of the Jacobian by differences, each of which takes five times as
# long as a residual. Steps of a fit shrink, so that what the updates miss shrinks, too.
UPDATES = 3


@dataclass(frozen=True)
class _Derivatives:
    """Holds the derivatives at the last place where they were asked for.

    Attributes
    ----------
    units
        The place, shape (p,).
    residual
        There, shape (n,).
    jacobian
        There, shape (n, p).
    updates
        Since the derivatives were computed by differences.
    """

    units: np.ndarray
    residual: np.ndarray
    jacobian: np.ndarray
    updates: int

    def updated(self, units: np.ndarray, residual: np.ndarray) -> np.ndarray:
        """Return the Jacobian that agrees with what the residual did on the step to a place."""
        step = units - self.units
        if not step.any():
            return self.jacobian
        missed = residual - self.residual - self.jacobian @ step
        return self.jacobian + np.outer(missed, step / (step @ step))


class Projection:
    """Computes residual and Jacobian without the linear parameters (Kaufman's approximation).

    Parameters
    ----------
    fitter
        Of the recording.
    values
        Of all parameters to begin with, by term and symbol.
    free
        Parameters that are searched for, with their terms' names.
    fitted
        Rows that are fitted, as a slice or a mask, shape (rows.count,).
    foot
        Behind a compliant fixation, held; None where the model has none.
    """

    def __init__(
        self,
        fitter: Fitter,
        values: ModelValues,
        free: list[tuple[str, Parameter]],
        fitted: slice | np.ndarray,
        foot: Foot | None = None,
    ) -> None:
        self._fitter, self._values, self._free, self._fitted = fitter, values, free, fitted
        self._foot = foot
        self._at: np.ndarray | None = None
        self._last: _Derivatives | None = None
        self._left = math.inf

    @property
    def first(self) -> np.ndarray:
        """Return where a fit begins, within the bounds, shape (p,)."""
        units = [to_unit(p, self._values[name][p.symbol]) for name, p in self._free]
        return np.clip(units, 2.0 * UNIT_STEP, 1.0 - 2.0 * UNIT_STEP)

    def allow(self, evaluations: float) -> None:
        """Allow so many evaluations of the residual. No step follows the last one, so that no
        derivatives are computed there.
        """
        self._left = evaluations

    def beside(self, foot: Foot | None, fit: Fit) -> None:
        """Begin again from a fit beside another foot; the derivatives are kept."""
        self._values, self._foot = fit.values, foot
        self._fit, self._at = fit, self.first
        last = self._last
        if last is not None:
            self._last = replace(
                last,
                units=self._at,
                residual=fit.residual[self._fitted],
                updates=min(last.updates + 1, UPDATES),
            )

    def values_at(self, units: np.ndarray) -> ModelValues:
        """Return all values, the free ones at these places 0...1 of their ranges, shape (p,)."""
        values = {name: dict(given) for name, given in self._values.items()}
        for (name, parameter), unit in zip(self._free, units, strict=True):
            values[name][parameter.symbol] = from_unit(parameter, float(unit))
        return values

    def residual(self, units: np.ndarray) -> np.ndarray:
        """Return the whitened residual of the fitted rows, the linear parameters solved for."""
        self._left -= 1
        return self.fit_at(units).residual[self._fitted]

    def short_residual(self, units: np.ndarray) -> np.ndarray:
        """Return the residual turned so that it has one component, its length, shape (p + 1,).

        Least squares need lengths and products only, which are the same with `short_jacobian`; a
        step takes a tenth of the time.
        """
        residual = self.residual(units)
        found = np.zeros(len(units) + 1)
        found[0] = math.sqrt(residual @ residual)
        return found

    def short_jacobian(self, units: np.ndarray) -> np.ndarray:
        """Return the derivatives, turned as the residual is, shape (p + 1, p)."""
        jacobian = self.jacobian(units)
        residual = self.fit_at(units).residual[self._fitted]
        products = jacobian.T @ jacobian
        # Columns of very different lengths are resolved alike.
        scale = np.sqrt(np.diag(products))
        scale[scale == 0.0] = 1.0
        length = max(math.sqrt(residual @ residual), math.ulp(0.0))
        along = residual @ jacobian / (length * scale)
        across = products / np.outer(scale, scale) - np.outer(along, along)
        squares, axes = np.linalg.eigh(across)
        turned = np.vstack([along, np.sqrt(np.maximum(squares, 0.0))[:, None] * axes.T])
        return np.asarray(turned * scale)

    def fit_at(self, units: np.ndarray) -> Fit:
        """Return the fit at these places, the linear parameters solved for."""
        if self._at is None or not np.array_equal(units, self._at):
            self._fit = self._fitter.solve(self.values_at(units), self._fitted, self._foot)
            self._at = units.copy()
        return self._fit

    def jacobian(self, units: np.ndarray) -> np.ndarray:
        """Return its derivatives by the free parameters, shape (rows that are fitted, p).

        It is computed by differences at first and after each `UPDATES` steps. In between, each step
        corrects it by what the residual did (Broyden 1965, Math. Comput. 19, 577).
        """
        residual = self.fit_at(units).residual[self._fitted]
        last = self._last
        if last is not None and self._left <= 0:
            return last.jacobian
        if last is None or last.updates == UPDATES:
            jacobian, updates = self._differentiated(units), 0
        else:
            jacobian, updates = last.updated(units, residual), last.updates + 1
        self._last = _Derivatives(units.copy(), residual, jacobian, updates)
        return jacobian

    def _differentiated(self, units: np.ndarray) -> np.ndarray:
        values = self.values_at(units)
        spectra = self._fitter.columns.spectra(values, self._foot)
        amplitudes = {(n, symbol): self._fit.values[n][symbol] for n, symbol in spectra}
        slopes = columns_of(
            in_parallel(
                lambda one: self._fitter.slope(values, *one, amplitudes, spectra, foot=self._foot),
                self._free,
            )
        )[self._fitted]
        # Columns at a bound do not follow, so they are not projected out.
        own = {(name, p.symbol) for name, p in self._free}
        inside = [
            s
            for (n, symbol), s in spectra.items()
            if (n, symbol) not in own
            and n not in self._fitter.held
            and f"{n}.{symbol}" not in (*self._fit.at_bounds, *self._fit.absent)
        ]
        if inside:
            basis = orthonormal(self._fitter.whitened(inside)[self._fitted])
            slopes = slopes - basis @ (basis.T @ slopes)
        return -slopes
