"""Linear least squares within ranges, and the span of columns."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy.optimize import lsq_linear

# Torque per unit of a parameter that no joint makes [N.m]: a foot behind straps that do not hold it
# has run away there. Its square is still a number.
RUN_AWAY = 1e12


def lengths(matrix: np.ndarray) -> np.ndarray:
    """Return the Euclidean length of each column, shape (p,); `numpy.linalg.norm` takes four times
    as long.
    """
    return np.sqrt(np.einsum("ij,ij->j", matrix, matrix))


def columns_of(columns: Sequence[np.ndarray]) -> np.ndarray:
    """Return the matrix of these columns, each of shape (n,), shape (n, count).

    Each column lies in one piece of memory; `numpy.column_stack` takes four times as long.
    """
    return np.array(columns).T


def orthonormal(matrix: np.ndarray) -> np.ndarray:
    """Return the orthonormal basis of the columns' span, shape (n, rank)."""
    return matrix @ _mixture(matrix)


def unexplained(matrix: np.ndarray, target: np.ndarray) -> float:
    """Return the sum of squares that the columns leave of a target, shape (n,)."""
    parts = (target @ matrix) @ _mixture(matrix)
    return max(float(target @ target - parts @ parts), 0.0)


def _mixture(matrix: np.ndarray) -> np.ndarray:
    """Return by how much each column enters an orthonormal basis of their span, shape (p, rank)."""
    products = matrix.T @ matrix
    scale = np.sqrt(np.diag(products))
    # One whose square is no number has run away, and spans nothing.
    kept = (scale > 0) & np.isfinite(scale)
    if not kept.any():
        return np.zeros((len(kept), 0))
    scale = scale[kept]
    eigenvalues, vectors = np.linalg.eigh(products[np.ix_(kept, kept)] / np.outer(scale, scale))
    large = eigenvalues > 1e-10 * eigenvalues[-1]
    mixed = np.zeros((len(kept), int(large.sum())))
    mixed[kept] = vectors[:, large] / np.sqrt(eigenvalues[large]) / scale[:, None]
    return mixed


def bounded(
    matrix: np.ndarray, target: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Return the least-squares amplitudes within ranges, each of shape (p,)."""
    products = matrix.T @ matrix
    scale = np.sqrt(np.diag(products))
    scale[scale == 0] = 1.0
    gram = products / np.outer(scale, scale)
    gram[np.diag_indices_from(gram)] += 1e-10
    factor = np.linalg.cholesky(gram).T
    right = np.linalg.solve(factor.T, matrix.T @ target / scale)
    lower, upper = lower * scale, upper * scale
    free = np.linalg.solve(factor, right)
    if np.all((free >= lower) & (free <= upper)):
        return free / scale
    return lsq_linear(factor, right, (lower, upper), method="bvls").x / scale


def runs_away(columns: np.ndarray) -> bool:
    """Say whether a model runs away: columns per unit of its parameters that no joint makes, or
    that are no numbers.
    """
    return not (columns.max() < RUN_AWAY and columns.min() > -RUN_AWAY)
