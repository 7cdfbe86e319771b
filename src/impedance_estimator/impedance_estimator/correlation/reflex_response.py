"""The reflex impulse response: least squares of reflex torque on past half-wave rectified velocity.

    τ_R[n] = Δ Σ_k h_k v₊[n - k],   k Δ from 40 to 400 ms
    T h = r / Δ,   T_jk = φ_vv(j - k),   r_k = φ_vτ(k)
    G = Δ Σ_k h_k

Δ is the interval of decimated samples, about 8 ms. φ are running correlations. T is a Toeplitz
matrix and is solved by Levinson's recursion (Golub & Van Loan, Matrix Computations, algorithm
4.7.2). van 't Veld et al. 2018, section II-A.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from impedance_estimator.digital_filters import filter_step

DECIMATED_RATE = 128.0
"""[Hz] The reflex's bandwidth is about 3 Hz (ω = 21 rad/s), so 125 Hz and 250 Hz give the same
gain; the cost of the solution grows with the square. At 2048 Hz the factor is 16, at 1000 Hz 8 (125
Hz)."""


def decimation(rate: float) -> int:
    """Return how many samples at `rate` [Hz] are averaged into one decimated sample."""
    return max(round(rate / DECIMATED_RATE), 1)


def lags(first: float, last: float, decimated_rate: float) -> np.ndarray:
    """Return the lags of the response in decimated samples, shape (k,), nearest to `first` ...
    `last` [s].
    """
    return np.arange(round(first * decimated_rate), round(last * decimated_rate) + 1)


@njit
def remember(history: np.ndarray, value: float) -> None:
    """Put the newest value in front of the others."""
    for k in range(history.shape[0] - 1, 0, -1):
        history[k] = history[k - 1]
    history[0] = value


@njit
def average_correlations(
    sections: np.ndarray,
    state: np.ndarray,
    averages: np.ndarray,
    history: np.ndarray,
    first_lag: int,
    torque: float,
) -> None:
    """Add one decimated sample to the running correlations.

    Parameters
    ----------
    sections, state
        The averaging low-pass, 2 L + 1 channels.
    averages
        Shape (2 L + 1,): φ_vv at lags 0 ... L-1, φ_vτ at lags first_lag ... first_lag+L-1, and a
        constant 1 that follows the gain of the running average.
    history
        Shape (first_lag + L,), rectified velocity, the newest first.
    torque
        Reflex torque [N.m] now.
    """
    count = averages.shape[0] // 2
    for k in range(count):
        averages[k] = history[0] * history[k]
        averages[count + k] = torque * history[first_lag + k]
    averages[2 * count] = 1.0
    filter_step(sections, state, averages, 2 * count + 1)


@njit
def convolve_now(weights: np.ndarray, history: np.ndarray, first_lag: int) -> float:
    """Return Σ_k weights_k history[first_lag + k]."""
    total = 0.0
    for k in range(weights.shape[0]):
        total += weights[k] * history[first_lag + k]
    return total


# Sums may be taken in another order, so that they run in vector registers; the same input still
# gives the same bits.
@njit(fastmath={"reassoc"})
def solve_toeplitz(
    first_column: np.ndarray,
    right: np.ndarray,
    solution: np.ndarray,
    row_sums: np.ndarray,
    work: np.ndarray,
) -> bool:
    """Solve T s = right and T u = 1 for a symmetric positive definite Toeplitz matrix T by
    Levinson's recursion.

    Parameters
    ----------
    first_column
        Shape (n,), of T.
    right
        Right-hand side of the equations, shape (n,).
    solution
        Shape (n,), becomes s.
    row_sums
        Shape (n,), becomes u, the sums over the rows of T's inverse.
    work
        Shape (2, n), overwritten.

    Returns
    -------
    bool
        False where T is not positive definite; solution and row_sums are then meaningless.
    """
    n = first_column.shape[0]
    if not first_column[0] > 0.0:
        return False
    scale = 1.0 / first_column[0]
    backward, turned = work[0], work[1]
    solution[0] = right[0] * scale
    row_sums[0] = scale
    if n == 1:
        return True
    backward[0] = -first_column[1] * scale
    reflection = backward[0]
    error = 1.0
    for k in range(1, n):
        error *= 1.0 - reflection * reflection
        if not error > 0.0:
            return False
        missing_s, missing_u = right[k], 1.0
        for i in range(k):
            missing_s -= first_column[k - i] * solution[i]
            missing_u -= first_column[k - i] * row_sums[i]
        step_s, step_u = missing_s * scale / error, missing_u * scale / error
        for i in range(k):
            solution[i] += step_s * backward[k - 1 - i]
            row_sums[i] += step_u * backward[k - 1 - i]
        solution[k], row_sums[k] = step_s, step_u
        if k < n - 1:
            missing = first_column[k + 1]
            for i in range(k):
                missing += first_column[k - i] * backward[i]
            reflection = -missing * scale / error
            for i in range(k):
                turned[i] = backward[i] + reflection * backward[k - 1 - i]
            for i in range(k):
                backward[i] = turned[i]
            backward[k] = reflection
    return True
