"""What a fit of a list of terms to a recording gives."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from ankle_physics.term import ModelValues
from model_discrepancy.fit.parameter_scale import limit_cases
from model_discrepancy.fit.rows import Rows
from model_discrepancy.fit.signal_path import Column


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
        "term.symbol" of parameters that ended at a bound, which says that the term stands in for
        another one, or is superfluous.
    absent
        "term.symbol" of amplitudes that are 0 beside others of their term, which says nothing.
    draws
        Change of each free parameter from draw to draw of the recording's stretches, by term and
        symbol, each of shape (block_bootstrap.DRAWS,); empty without standard errors.
    spreads
        Rows of a root of the covariance by least squares, likewise: the product of two of them is
        the covariance of their parameters.
    """

    values: ModelValues
    residual: np.ndarray
    left: np.ndarray = field(repr=False)
    rows: Rows = field(repr=False)
    score: float
    size: int
    errors: ModelValues = field(default_factory=dict)
    at_bounds: tuple[str, ...] = ()
    absent: tuple[str, ...] = ()
    draws: dict[Column, np.ndarray] = field(default_factory=dict, repr=False)
    spreads: dict[Column, np.ndarray] = field(default_factory=dict, repr=False)

    @cached_property
    def stopped(self) -> tuple[str, ...]:
        """Return the names of parameters that a bound stopped, which says something against
        the term: not those that ended at a `Parameter.limit_case`.
        """
        simple = limit_cases(self.values)
        return tuple(label for label in self.at_bounds if label not in simple)

    @cached_property
    def plain(self) -> np.ndarray:
        """Return the plain residual [N.m], shape (rows.count,)."""
        return self.rows.plain(self.left)

    def error_of(self, slopes: Mapping[Column, np.ndarray | float]) -> np.ndarray:
        """Return the standard error of what follows from the parameters: that of the stretches or
        of least squares, whichever is larger. Both hold what ties the parameters to each other.

        Parameters
        ----------
        slopes
            By each free parameter, of one value or of values of shape (n,); those left out are 0.

        Returns
        -------
        np.ndarray
            In the values' unit, shape () or (n,).

        Raises
        ------
        KeyError
            A parameter was held, or there are no standard errors.
        """
        drawn = sum(np.multiply.outer(slope, self.draws[at]) for at, slope in slopes.items())
        spread = sum(np.multiply.outer(slope, self.spreads[at]) for at, slope in slopes.items())
        return np.fmax(np.std(drawn, axis=-1), np.linalg.norm(spread, axis=-1))

    @property
    def terms(self) -> tuple[str, ...]:
        """Return the names of the model's terms."""
        return tuple(self.values)
