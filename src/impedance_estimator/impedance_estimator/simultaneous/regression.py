"""Least squares for intrinsic and reflex parameters together, from sums of products of whitened
signals.

    τ = K x + B v + I a + G h(·; η) * v₊ + noise

h(·; η) is a second-order muscle with unit area (`reflex_shapes`). With φ = basis functions * v₊ and
coordinates c(η) of h in that basis, about a shape η₀ and a gain G₀,

    τ ≈ K x + B v + I a + G c(η₀)'φ + Σ_k Δη_k G₀ (∂c/∂η_k)'φ

is linear in 7 unknowns. Δη has a Gaussian prior; η₀ follows the data slowly (Gauss-Newton on the
separable problem: Golub & Pereyra, SIAM J. Numer. Anal. 10 (1973) 413-432). A freer response
(twelve functions, even with a prior) takes up what the model leaves out of the intrinsic pathway:
on the independent rig G was then off by several times its value under a resonance, friction that
differs by direction, or a lifting heel.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator.compilation import part

INTRINSIC = 3
GAINS = 4
"""K, B, I, G: the unknowns that may jump."""
PARAMETERS = 7
"""The gains and three changes of shape."""
LEAST_GAIN = 0.5
"""G₀ [N.m.s/rad] is at least this: with no reflex at all the shape must stay undetermined, not
singular.
"""
LEAST_PIVOT = 1e-10
"""Smaller pivots of the scaled system count as zero: sums of products of signals with 1e-3 noise
have no more digits.
"""


@part
def solve_with_prior(
    normal: np.ndarray,
    size: int,
    precision: np.ndarray,
    mean: np.ndarray,
    solution: np.ndarray,
    covariance: np.ndarray,
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

    Returns
    -------
    float
        ln |N + precision|; NaN where the system is singular, and the results are then meaningless.
    """
    lower, inverse = np.empty((size, size)), np.empty((size, size))
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
    weighted = np.empty(size)
    for i in range(size):
        weighted[i] = normal[i, right] + precision[i] * mean[i]
    for i in range(size):
        total = 0.0
        for j in range(size):
            total += covariance[i, j] * weighted[j]
        solution[i] = total
    return determinant


@part
def squared_residual(normal: np.ndarray, size: int, solution: np.ndarray) -> float:
    """Return Σ e² under a solution, from the sums alone."""
    right = normal.shape[0] - 1
    total = normal[right, right]
    for i in range(size):
        row = -2.0 * normal[i, right]
        for j in range(size):
            row += normal[i, j] * solution[j]
        total += solution[i] * row
    return max(total, 0.0)
