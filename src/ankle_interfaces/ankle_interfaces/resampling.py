"""Resampling of recorded signals onto a common clock."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
from scipy.signal import firwin, resample_poly

from ankle_interfaces.errors import SamplingError

# Largest denominator of the rate ratio: 2048/1000 = 256/125 is exact with it, and the polyphase
# filter stays short.
LARGEST_FACTOR = 2048


def resample(signals: np.ndarray, from_rate: float, to_rate: float) -> np.ndarray:
    """Resample equally spaced samples within their band, without delay.

    Parameters
    ----------
    signals
        Shape (n,) or (n, m); time is not one of the columns.
    from_rate, to_rate
        Sampling rates before and after [Hz].

    Returns
    -------
    np.ndarray
        Shape (n', ...) with n' = ceil(n * to_rate / from_rate); sample 0 is at the same time as
        before.

    Raises
    ------
    SamplingError
        A rate that is not positive.
    """
    if not (from_rate > 0 and to_rate > 0):
        raise SamplingError(f"rates must be positive, got {from_rate:g} and {to_rate:g} Hz")
    ratio = Fraction(to_rate / from_rate).limit_denominator(LARGEST_FACTOR)
    up, down = ratio.numerator, ratio.denominator
    if up == down:
        return np.array(signals, dtype=float)
    # 32 zero crossings with a Kaiser window of 10: flat to 0.9 Nyquist, images below -90 dB.
    largest = max(up, down)
    taps = firwin(2 * 32 * largest + 1, 0.95 / largest, window=("kaiser", 10.0))
    # The ends are extended by their own values, so that an offset does not ring.
    return resample_poly(
        np.asarray(signals, dtype=float), up, down, axis=0, window=taps, padtype="edge"
    )


def regular_grid(
    time: np.ndarray, values: np.ndarray, rate: float
) -> tuple[np.ndarray, np.ndarray]:
    """Put values [n, m] at irregular times [s] onto a regular grid by linear interpolation.

    Returns
    -------
    tuple[np.ndarray, np.ndarray]
        Times of shape (k,) and values of shape (k, m).

    Raises
    ------
    SamplingError
        Time does not increase.
    """
    if np.any(np.diff(time) <= 0):
        raise SamplingError("time does not increase everywhere")
    grid = time[0] + np.arange(int(np.floor((time[-1] - time[0]) * rate + 1e-6)) + 1) / rate
    columns = [np.interp(grid, time, values[:, k]) for k in range(values.shape[1])]
    return grid, np.column_stack(columns)
