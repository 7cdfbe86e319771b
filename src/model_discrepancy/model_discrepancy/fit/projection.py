"""Residual and Jacobian of a fit whose linear parameters are projected out (Golub & Pereyra 2003,
Inverse Problems 19, R1).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ankle_physics.term import Parameter
from model_discrepancy.fit.least_squares import orthonormal
from model_discrepancy.fit.parallel import in_parallel
from model_discrepancy.fit.parameter_scale import from_unit

if TYPE_CHECKING:
    from model_discrepancy.fit.fitter import Fitter


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
    mask
        Rows that are fitted, bool, shape (rows.count,).
    """

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
        """Return all values, the free ones at these places 0...1 of their ranges, shape (p,)."""
        values = {name: dict(given) for name, given in self._values.items()}
        for (name, parameter), unit in zip(self._free, units, strict=True):
            values[name][parameter.symbol] = from_unit(parameter, float(unit))
        return values

    def residual(self, units: np.ndarray) -> np.ndarray:
        """Return the whitened residual of the fitted rows, the linear parameters solved for."""
        self._fit = self._fitter.solve(self.values_at(units), self._mask)
        self._at = units.copy()
        return self._fit.residual[self._mask]

    def jacobian(self, units: np.ndarray) -> np.ndarray:
        """Return its derivatives by the free parameters, shape (rows that are fitted, p)."""
        if self._at is None or not np.array_equal(units, self._at):
            self.residual(units)
        values = self.values_at(units)
        spectra = self._fitter.columns.spectra(values)
        amplitudes = {(n, symbol): self._fit.values[n][symbol] for n, symbol in spectra}
        slopes = np.column_stack(
            in_parallel(
                lambda one: self._fitter.slope(values, *one, amplitudes, spectra), self._free
            )
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
