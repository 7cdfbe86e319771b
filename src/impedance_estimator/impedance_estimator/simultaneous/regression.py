"""Least squares for intrinsic and reflex parameters together, from sums of products of whitened
signals.

    τ = K x + B v + I a + G h(·; η) * v₊ + (d * v₊) + noise

h(·; η) is a second-order muscle with unit area (`reflex_shapes`), d what the real response adds to
it. With φ = basis functions * v₊, coordinates c(η) of h and δ of d in that basis, and about a shape
η₀, d₀ and a gain G₀,

    τ ≈ K x + B v + I a + G (c(η₀) + d₀)'φ + Σ_k Δη_k G₀ (∂c/∂η_k)'φ + δ'φ

is linear in 7 + m unknowns. Δη and δ have Gaussian priors; η₀ and d₀ follow the data slowly
(Gauss-Newton on the separable
problem: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432). The width of δ's prior is the one
under which the data are most likely (`log_evidence`; MacKay, Neural Computation 4 (1992) 415-447):
nearly zero for a second-order muscle, a third of a typical response for the real trials. A basis
without shapes would need ten free factors throughout: the reflex gain then varies three times as
much, and is biased by up to 30 % behind a high-pass at 4 Hz.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator.compilation import part

INTRINSIC = 3
GAINS = 4
"""K, B, I, G: the unknowns that may jump."""
PARAMETERS = 7
"""The gains and three changes of shape. The deviations δ follow."""
LEAST_GAIN = 0.5
"""G₀ [N.m.s/rad] is at least this: with no reflex at all the shape must stay undetermined, not
singular.
"""
LEAST_PIVOT = 1e-10
"""Smaller pivots of the scaled system count as zero: sums of products of signals with 1e-3 noise
have no more digits.
"""


@part
def unpack_sums(
    sums: np.ndarray, tangent: np.ndarray, normal: np.ndarray, work: np.ndarray
) -> None:
    """Sums of products of the signals of the linear problem.

    Parameters
    ----------
    sums
        Packed upper triangle, row by row, of the products of x, v, a, φ_1 ... φ_m, τ.
    tangent
        Shape (m, 4): c(η₀) + d₀, and G₀ times the derivatives of c.
    normal
        Shape (m + 8, m + 8), replaced; signals as the unknowns, the last row and column belong to
        the torque.
    work
        Shape (m + 4, m + 8), overwritten.
    """
    m = tangent.shape[0]
    size = m + INTRINSIC + 1
    last = m + PARAMETERS
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
        for j in range(m):
            normal[i, PARAMETERS + j] = normal[PARAMETERS + j, i] = work[i, INTRINSIC + j]
        normal[i, last] = normal[last, i] = work[i, size - 1]
    for p in range(4):
        for q in range(4):
            total = 0.0
            for j in range(m):
                total += tangent[j, p] * work[INTRINSIC + j, size + q]
            normal[INTRINSIC + p, INTRINSIC + q] = total
        for j in range(m):
            normal[INTRINSIC + p, PARAMETERS + j] = normal[PARAMETERS + j, INTRINSIC + p] = work[
                INTRINSIC + j, size + p
            ]
        normal[INTRINSIC + p, last] = normal[last, INTRINSIC + p] = work[size - 1, size + p]
    for i in range(m):
        for j in range(m):
            normal[PARAMETERS + i, PARAMETERS + j] = work[INTRINSIC + i, INTRINSIC + j]
        normal[PARAMETERS + i, last] = normal[last, PARAMETERS + i] = work[INTRINSIC + i, size - 1]
    normal[last, last] = work[size - 1, size - 1]


@part
def solve_with_prior(
    normal: np.ndarray,
    size: int,
    precision: np.ndarray,
    mean: np.ndarray,
    solution: np.ndarray,
    covariance: np.ndarray,
    work: np.ndarray,
) -> float:
    """Minimise  θ'Nθ - 2 θ'r + Σ precision_i (θ_i - mean_i)².

    Parameters
    ----------
    normal
        N in its first `size` rows and columns, r in the last column.
    size
        Number of unknowns.
    precision
        Shape (>= size,), of the prior, in units of the noise variance.
    mean
        Shape (>= size,), of the prior.
    solution
        Shape (>= size,), replaced.
    covariance
        Shape (>= size, >= size), replaced by (N + precision)⁻¹; times the noise variance it is the
        covariance.
    work
        Shape (2, >= size, >= size), overwritten.

    Returns
    -------
    float
        ln |N + precision|; NaN where the system is singular, and the results are then meaningless.
    """
    lower, inverse = work[0], work[1]
    right = normal.shape[0] - 1
    determinant = 0.0
    # Scaled to a unit diagonal: position and acceleration differ by a factor of 10⁴.
    for i in range(size):
        diagonal = normal[i, i] + precision[i]
        if not diagonal > 0.0:
            return np.nan
        determinant += np.log(diagonal)
        solution[i] = 1.0 / np.sqrt(diagonal)
    for i in range(size):
        for j in range(i + 1):
            total = normal[i, j] * solution[i] * solution[j] if i != j else 1.0
            for k in range(j):
                total -= lower[i, k] * lower[j, k]
            if i == j:
                if not total > LEAST_PIVOT:
                    return np.nan
                determinant += np.log(total)
                lower[i, i] = np.sqrt(total)
            else:
                lower[i, j] = total / lower[j, j]
    for j in range(size):
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
        work[0, 0, i] = normal[i, right] + precision[i] * mean[i]
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += covariance[i, j] * work[0, 0, j]
        solution[i] = total
    return determinant


@part
def squared_residual(normal: np.ndarray, size: int, solution: np.ndarray) -> float:
    """Σ e² under a solution, from the sums alone."""
    right = normal.shape[0] - 1
    total = normal[right, right]
    for i in range(size):
        row = -2.0 * normal[i, right]
        for j in range(size):
            row += normal[i, j] * solution[j]
        total += solution[i] * row
    return max(total, 0.0)


@part
def log_evidence(
    normal: np.ndarray,
    size: int,
    precision: np.ndarray,
    mean: np.ndarray,
    solution: np.ndarray,
    determinant: float,
    count: float,
) -> float:
    """ln p(data | prior), up to a constant, with the noise variance at its most likely value.

    Parameters
    ----------
    normal, size, precision, mean
        As for `solve_with_prior`.
    solution, determinant
        Its results.
    count
        Number of samples in the sums.
    """
    total = squared_residual(normal, size, solution)
    for i in range(size):
        total += precision[i] * (solution[i] - mean[i]) ** 2
        determinant -= np.log(precision[i])
    return -0.5 * (count * np.log(total / count) + determinant)
