"""Least squares for intrinsic and reflex parameters together, from sums of products of whitened signals.

    τ = K x + B v + I a + G h(·; η) * v₊ + noise

The shape η enters through the coordinates c(η) of h in a basis. About a shape η₀ and a gain G₀,

    τ ≈ K x + B v + I a + G c(η₀)'φ + Σ_k δ_k G₀ (∂c/∂η_k)'φ,    φ = basis functions * v₊

is linear in seven unknowns. δ, the change of shape, has a Gaussian prior; η₀ follows the data slowly (Gauss-Newton on the
separable problem: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432). A basis alone, without shapes, would need ten
free factors: the reflex gain then varies three times as much and is biased by up to 30 % behind a high-pass at 4 Hz.
"""

from __future__ import annotations

import numpy as np
from numba import njit

INTRINSIC = 3
UNKNOWNS = 7
"""K, B, I, G and three changes of shape."""
GAINS = 4
"""The unknowns that may jump: K, B, I, G."""
LEAST_GAIN = 0.5
"""[N.m.s/rad] G₀ at least: with no reflex at all the shape must stay undetermined, not singular."""


@njit
def unpack_sums(sums: np.ndarray, tangent: np.ndarray, normal: np.ndarray, work: np.ndarray) -> None:
    """Sums of products of the eight signals of the linear problem.

    Args:
        sums: packed upper triangle, row by row, of the products of x, v, a, φ_1 ... φ_m, τ.
        tangent: shape (m, 4): c(η₀), and G₀ times its derivatives.
        normal: shape (8, 8), replaced; the last row and column belong to the torque.
        work: shape (m + 4, m + 8), overwritten.
    """
    m = tangent.shape[0]
    size = m + INTRINSIC + 1
    k = 0
    for i in range(size):
        for j in range(i, size):
            work[i, j] = sums[k]
            work[j, i] = sums[k]
            k += 1
    # Behind the sums: the products of each signal with the four combinations of basis functions.
    for i in range(size):
        for p in range(4):
            work[i, size + p] = 0.0
        for j in range(m):
            value = work[i, INTRINSIC + j]
            for p in range(4):
                work[i, size + p] += value * tangent[j, p]
    for i in range(INTRINSIC):
        for j in range(INTRINSIC):
            normal[i, j] = work[i, j]
        for p in range(4):
            normal[i, INTRINSIC + p] = normal[INTRINSIC + p, i] = work[i, size + p]
        normal[i, UNKNOWNS] = normal[UNKNOWNS, i] = work[i, size - 1]
    for p in range(4):
        for q in range(4):
            total = 0.0
            for j in range(m):
                total += tangent[j, p] * work[INTRINSIC + j, size + q]
            normal[INTRINSIC + p, INTRINSIC + q] = total
        normal[INTRINSIC + p, UNKNOWNS] = normal[UNKNOWNS, INTRINSIC + p] = work[size - 1, size + p]
    normal[UNKNOWNS, UNKNOWNS] = work[size - 1, size - 1]


@njit
def solve_with_prior(
    normal: np.ndarray, size: int, precision: np.ndarray, mean: np.ndarray, solution: np.ndarray, covariance: np.ndarray, work: np.ndarray
) -> bool:
    """Minimise  θ'Nθ - 2 θ'r + Σ precision_i (θ_i - mean_i)².

    Args:
        normal: shape (8, 8), N in its first `size` rows and columns, r in the last column.
        size: number of unknowns.
        precision: shape (>= size,), of the prior, in units of the noise variance.
        mean: shape (>= size,), of the prior.
        solution: shape (>= size,), replaced.
        covariance: shape (>= size, >= size), replaced by (N + precision)⁻¹; times the noise variance it is the covariance.
        work: shape (2, >= size, >= size), overwritten.

    Returns:
        False where the system is singular; the results are then meaningless.
    """
    lower, inverse = work[0], work[1]
    # Scaled to a unit diagonal: position and acceleration differ by a factor of 10⁴.
    for i in range(size):
        diagonal = normal[i, i] + precision[i]
        if not diagonal > 0.0:
            return False
        solution[i] = 1.0 / np.sqrt(diagonal)
    for i in range(size):
        for j in range(i + 1):
            total = normal[i, j] * solution[i] * solution[j] if i != j else 1.0
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                # 1e-10: the digits that remain of a sum of products of signals with 1e-3 noise.
                if not total > 1e-10:
                    return False
                lower[i, i] = np.sqrt(total)
            else:
                lower[i, j] = total / lower[j, j]
    for j in range(size):
        for i in range(size):
            inverse[i, j] = 0.0
        inverse[j, j] = 1.0 / lower[j, j]
        for i in range(j + 1, size):
            total = 0.0
            for k in range(j, i):
                total -= lower[i, k] * inverse[k, j]
            inverse[i, j] = total / lower[i, i]
    for i in range(size):
        for j in range(i + 1):
            total = 0.0
            for k in range(i, size):
                total += inverse[k, i] * inverse[k, j]
            covariance[i, j] = covariance[j, i] = total * solution[i] * solution[j]
    for i in range(size):
        work[0, 0, i] = normal[i, UNKNOWNS] + precision[i] * mean[i]
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += covariance[i, j] * work[0, 0, j]
        solution[i] = total
    return True


@njit
def squared_residual(normal: np.ndarray, size: int, solution: np.ndarray) -> float:
    """Σ e² under a solution, from the sums alone."""
    total = normal[UNKNOWNS, UNKNOWNS]
    for i in range(size):
        row = -2.0 * normal[i, UNKNOWNS]
        for j in range(size):
            row += normal[i, j] * solution[j]
        total += solution[i] * row
    return max(total, 0.0)
