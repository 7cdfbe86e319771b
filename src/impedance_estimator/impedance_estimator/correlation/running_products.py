"""Running averages of products of signals: what the normal equations of least squares are made of.

    R_ij[n] = w * (s_i s_j),   s = (x, v, a, τ),   w = weighting function of a low-pass

The low-pass is the estimator's memory. All products pass the same one, so its gain cancels in the
solution.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from impedance_estimator.digital_filters import filter_step

SIGNALS = 4
"""Position, velocity, acceleration, torque."""

PRODUCTS = SIGNALS * (SIGNALS + 1) // 2 + 1
"""The upper triangle of the products, row by row, and a constant 1 that follows the gain of the
running average.
"""


@njit(inline="always")
def add_products(sums: np.ndarray, signals: np.ndarray) -> None:
    """Add one sample's products.

    Parameters
    ----------
    sums
        Sums that the products are added to, shape (`PRODUCTS`,).
    signals
        Signals of one sample, shape (`SIGNALS`,).
    """
    x, v, a, torque = signals[0], signals[1], signals[2], signals[3]
    sums[0] += x * x
    sums[1] += x * v
    sums[2] += x * a
    sums[3] += x * torque
    sums[4] += v * v
    sums[5] += v * a
    sums[6] += v * torque
    sums[7] += a * a
    sums[8] += a * torque
    sums[9] += torque * torque
    sums[10] += 1.0


@njit
def average_products(
    sections: np.ndarray, state: np.ndarray, averages: np.ndarray, sums: np.ndarray
) -> None:
    """Take the products of one decimated sample (8 ms, a thousandth of the memory) into the running
    averages; clears the sums.

    Parameters
    ----------
    sections, state
        The averaging low-pass at the decimated rate, `PRODUCTS` channels.
    averages
        Shape (`PRODUCTS`,), replaced by the new running averages.
    sums
        Shape (`PRODUCTS`,), from `add_products`; the last one counts its samples, at least 1.
    """
    count = sums[PRODUCTS - 1]
    for k in range(PRODUCTS):
        averages[k] = sums[k] / count
    sums[:] = 0.0
    filter_step(sections, state, averages, PRODUCTS)
