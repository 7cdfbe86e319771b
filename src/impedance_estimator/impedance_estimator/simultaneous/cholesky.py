"""Symmetric positive definite systems, A X = B, by Cholesky's method.

    A = U'U,   U'Y = B,   U X = Y

All loops run along rows, which lie in one piece.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator.compilation import part

LEAST_DIAGONAL = 1e-300
"""A signal that never moves has this sum of squares, so that it can be divided by."""


@part
def factorise(matrix: np.ndarray) -> bool:
    """Replace the upper triangle of a symmetric matrix by its factor U; return False where the
    matrix is not positive definite.

    Parameters
    ----------
    matrix
        A, shape (n, n); its lower triangle is not touched.
    """
    n = matrix.shape[0]
    for k in range(n):
        pivot = matrix[k, k]
        if not pivot > 0.0:
            return False
        pivot = np.sqrt(pivot)
        matrix[k, k] = pivot
        for j in range(k + 1, n):
            matrix[k, j] /= pivot
        for i in range(k + 1, n):
            factor = matrix[k, i]
            for j in range(i, n):
                matrix[i, j] -= factor * matrix[k, j]
    return True


@part
def substitute(factor: np.ndarray, right: np.ndarray) -> None:
    """Replace the right-hand sides B by the solution X.

    Parameters
    ----------
    factor
        As `factorise` leaves it, shape (n, n).
    right
        B, shape (n, k), replaced.
    """
    n, columns = right.shape
    for k in range(n):
        pivot = factor[k, k]
        for j in range(columns):
            right[k, j] /= pivot
        for i in range(k + 1, n):
            share = factor[k, i]
            for j in range(columns):
                right[i, j] -= share * right[k, j]
    for k in range(n - 1, -1, -1):
        pivot = factor[k, k]
        for j in range(columns):
            right[k, j] /= pivot
        for i in range(k):
            share = factor[i, k]
            for j in range(columns):
                right[i, j] -= share * right[k, j]


@part
def solve_scaled(matrix: np.ndarray, ridge: float, right: np.ndarray) -> tuple[bool, float]:
    """Replace the right-hand sides by the solution, with the matrix scaled to a unit diagonal.

    Parameters
    ----------
    matrix
        A, shape (n, n).
    ridge
        Added to the unit diagonal.
    right
        B, shape (n, k), replaced by X.

    Returns
    -------
    tuple
        Whether the matrix is positive definite, and ln of its determinant; where it is not, `right`
        is meaningless.
    """
    n = matrix.shape[0]
    scale, scaled = np.empty(n), np.empty((n, n))
    for i in range(n):
        scale[i] = 1.0 / np.sqrt(max(matrix[i, i], LEAST_DIAGONAL))
    for i in range(n):
        for j in range(n):
            scaled[i, j] = matrix[i, j] * scale[i] * scale[j]
        scaled[i, i] += ridge
        for j in range(right.shape[1]):
            right[i, j] *= scale[i]
    if not factorise(scaled):
        return False, np.nan
    substitute(scaled, right)
    determinant = 0.0
    for i in range(n):
        determinant += 2.0 * np.log(scaled[i, i] / scale[i])
        for j in range(right.shape[1]):
            right[i, j] *= scale[i]
    return True, determinant
