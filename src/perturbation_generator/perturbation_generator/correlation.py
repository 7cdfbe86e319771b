"""Cross-correlation between position and half-wave rectified velocity: what figure 2 of the paper
shows.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.signal import correlate

# Lags [s] at which the reflex can act, so that the correlation must vanish there (paper, section
# II-A).
REFLEX_LAGS = (0.040, 0.400)


def cross_correlation(
    position: np.ndarray, velocity: np.ndarray, rate: float, first: float = -0.1, last: float = 0.5
) -> tuple[np.ndarray, np.ndarray]:
    """Return c(τ) = 1/n Σ v₊(t) (x(t + τ) - mean x), with v₊ = max(v, 0).

    Positive lags: position after the velocity. Only the position's mean is taken off; that
    suffices, as it makes the sum of the second factor zero.

    Parameters
    ----------
    position
        Position of the ankle [rad], shape (n,).
    velocity
        Velocity of the ankle [rad/s], shape (n,).
    rate
        Sampling rate [Hz].
    first, last
        Smallest and largest lag [s].

    Returns
    -------
    tuple[np.ndarray, np.ndarray]
        Lags [s] and correlation [rad^2/s], each of shape (m,).

    Raises
    ------
    ValueError
        The signals differ in length or are shorter than the lags.
    """
    n = len(position)
    lags = np.arange(math.ceil(first * rate - 1e-6), math.floor(last * rate + 1e-6) + 1)
    if len(velocity) != n or n <= np.abs(lags).max():
        raise ValueError(
            f"{n} positions and {len(velocity)} velocities do not allow lags of {first:g} to "
            f"{last:g} s at {rate:g} Hz"
        )
    full = correlate(position - position.mean(), np.maximum(velocity, 0.0), method="fft") / n
    return lags / rate, full[n - 1 + lags]


def residual(
    lags: np.ndarray,
    correlation: np.ndarray,
    first: float = REFLEX_LAGS[0],
    last: float = REFLEX_LAGS[1],
) -> float:
    """Return the largest absolute correlation at lags from first to last [s].

    It is given in per cent of the peak at all lags.
    """
    inside = (lags >= first) & (lags <= last)
    return 100.0 * float(np.abs(correlation[inside]).max() / np.abs(correlation).max())
