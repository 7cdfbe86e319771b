"""Linear least squares within ranges, and the span of columns."""

from __future__ import annotations

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


def orthonormal(matrix: np.ndarray) -> np.ndarray:
    """Return the orthonormal basis of the columns' span, shape (n, rank)."""
    scale = lengths(matrix)
    kept = matrix[:, scale > 0] / scale[scale > 0]
    if kept.shape[1] == 0:
        return kept
    eigenvalues, vectors = np.linalg.eigh(kept.T @ kept)
    large = eigenvalues > 1e-10 * eigenvalues[-1]
    return kept @ (vectors[:, large] / np.sqrt(eigenvalues[large]))


def bounded(
    matrix: np.ndarray, target: np.ndarray, lower: np.ndarray, upper: np.ndarray
) -> np.ndarray:
    """Return the least-squares amplitudes within ranges, each of shape (p,)."""
    scale = lengths(matrix)
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


def runs_away(columns: np.ndarray) -> bool:
    """Say whether a model runs away: columns per unit of its parameters that no joint makes, or
    that are no numbers.
    """
    return not (columns.max() < RUN_AWAY and columns.min() > -RUN_AWAY)
