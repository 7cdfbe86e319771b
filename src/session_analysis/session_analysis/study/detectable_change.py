"""How far two visits of an unchanged ankle may be apart: the minimal detectable change.

The usual 1.96 √2 times the standard error of measurement (Weir, J. Strength Cond. Res. 19 (2005)
231-240) is too small in three ways. Neighbouring visits resemble each other, so the first and the
last one differ by more than the scatter within a subject says; a scatter of few visits is itself
not well known; and a change that is to be judged must not be part of the scatter. Therefore

    y_v = level of the subject + e_v,   corr(e_v, e_w) = φ^|v - w|

is fitted to the other subjects (to the subject's own earlier visits where there is no other). For a
given φ the difference of two visits over its standard error has a t distribution; over φ it is
averaged, weighted by the restricted likelihood, with all values of φ equally likely beforehand
(Diggle, Heagerty, Liang & Zeger, Analysis of Longitudinal Data, Oxford 2002, sections 4.4 and 4.5).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

FALSE_CHANGE_RATE = 0.03
"""Share of unchanged ankles with a larger difference, on average over the correlations below. It is
below 0.05 so that visits that are correlated by 0.8 do not have more: `benchmarks/visit_changes.py`
counts it."""
CORRELATIONS = np.linspace(0.0, 0.95, 20)
"""Correlations of neighbouring visits that are possible. Above, an ankle wanders so slowly that no
study of this length tells a change from it."""


@dataclass(frozen=True)
class Scatter:
    """Describes the differences between visits of unchanged ankles.

    Attributes
    ----------
    squares
        Sum of squares of the whitened residuals, for each of `CORRELATIONS`; shape (20,).
    determinants
        Logarithm of the determinants in the restricted likelihood, likewise.
    freedom
        Degrees of freedom.
    """

    squares: np.ndarray
    determinants: np.ndarray
    freedom: int

    def __add__(self, other: Scatter) -> Scatter:
        return Scatter(
            self.squares + other.squares,
            self.determinants + other.determinants,
            self.freedom + other.freedom,
        )


EMPTY_SCATTER = Scatter(np.zeros(len(CORRELATIONS)), np.zeros(len(CORRELATIONS)), 0)
"""The scatter of no visits."""


def scatter(visits: np.ndarray, values: np.ndarray) -> Scatter:
    """Return the scatter of one subject's visits.

    Parameters
    ----------
    visits
        Numbers of the visits, shape (n,).
    values
        Of a quantity, shape (n,); visits with NaN are left out.
    """
    known = np.isfinite(values)
    number, value = np.asarray(visits, dtype=float)[known], values[known]
    if len(value) < 2:
        return EMPTY_SCATTER
    value = value - value.mean()
    covariance = CORRELATIONS[:, None, None] ** np.abs(np.subtract.outer(number, number))
    inverse = np.linalg.inv(covariance)
    weight = inverse.sum(axis=2)
    total = weight.sum(axis=1)
    level = weight @ value / total
    squares = np.einsum("i,kij,j->k", value, inverse, value) - level**2 * total
    determinants = np.linalg.slogdet(covariance)[1] + np.log(total)
    return Scatter(np.maximum(squares, 0.0), determinants, len(value) - 1)


def detectable_change(known: Scatter, apart: float) -> float:
    """Return the difference of two visits that an unchanged ankle seldom exceeds.

    Parameters
    ----------
    known
        Scatter of unchanged ankles.
    apart
        Difference of the visits' numbers.

    Returns
    -------
    float
        In the quantity's unit; NaN where nothing is known of the scatter.
    """
    from scipy import optimize, special  # they take a while to load

    if known.freedom == 0:
        return float("nan")
    if not known.squares.min() > 0.0:
        return 0.0
    likelihood = -0.5 * (known.determinants + known.freedom * np.log(known.squares))
    weight = np.exp(likelihood - likelihood.max())
    weight /= weight.sum()
    error = np.sqrt(2.0 * known.squares / known.freedom * (1.0 - CORRELATIONS**apart))
    each = -error * special.stdtrit(known.freedom, 0.5 * FALSE_CHANGE_RATE)

    def excess(change: float) -> float:
        beyond = 2.0 * special.stdtr(known.freedom, -change / error)
        return float(weight @ beyond) - FALSE_CHANGE_RATE

    # The quantile of a mixture lies between those of its parts.
    return float(optimize.brentq(excess, 0.999 * each.min(), 1.001 * each.max()))


def detectable_changes(
    visits: Sequence[int], values: np.ndarray, sure: np.ndarray | None = None
) -> np.ndarray:
    """Return the minimal detectable change of each subject from their first to their last visit.

    Parameters
    ----------
    visits
        Numbers of the visits, ascending.
    values
        Of a quantity, shape (subjects, visits), NaN where there is none.
    sure
        The values that the scatter is taken from, NaN at the others; None takes all.

    Returns
    -------
    np.ndarray
        Shape (subjects,); NaN where a subject has one visit, or nothing is known of the scatter.
    """
    numbers = np.asarray(visits)
    known_values = values if sure is None else sure
    own = [scatter(numbers, row) for row in known_values]
    changes = np.full(len(values), np.nan)
    for k, row in enumerate(values):
        there = np.flatnonzero(np.isfinite(row))
        if len(there) < 2:
            continue
        others = sum((one for place, one in enumerate(own) if place != k), EMPTY_SCATTER)
        earlier = there[:-1]
        before = scatter(numbers[earlier], known_values[k, earlier])
        known = others if others.freedom else before
        changes[k] = detectable_change(known, float(numbers[there[-1]] - numbers[there[0]]))
    return changes
