"""Signals of the regression as combinations of the recorded ones; see `explained_motion`.

Here is what every sample and every block needs: the products of the signals are added up as they
are recorded, and the sums over a stretch of data are then combined, T' S T.
"""

from __future__ import annotations

import numpy as np
from numba.extending import register_jitable

from impedance_estimator.compilation import part
from impedance_estimator.simultaneous.regression import INTRINSIC
from impedance_estimator.simultaneous.state import Plan, State

TAP_REACH = 4
"""Decimated samples (16 ms) by which acceleration is shifted, both ways: the largest skew between
channels that laboratories report is about 10 ms; a reflex begins later."""
TAPS = 2 * TAP_REACH
RELAXATION, YIELDING, SQUARE, CUBE, BEND = TAPS, TAPS + 1, TAPS + 2, TAPS + 3, TAPS + 4
EXTRAS = TAPS + 5
"""Nuisance signals: shifted accelerations, relaxing position, yielding position, position to the
second and the third power, and the muscle's response to the square of v₊."""
RELAXATION_TIME = 0.1
"""Tissue relaxes with this time constant [s]: within 0.03 to 0.3 s that short perturbations show
(Kirsch & Kearney, Exp. Brain Res. 115 (1997)).
"""
YIELD_TRAVEL = 0.006
"""[rad] Travel over which friction of tissues builds up, and at which cross-bridges yield: 3 to 10
mrad (Rack & Westbury, J. Physiol. 240 (1974); Loram, J. Physiol. 2007)."""
CENTRE_TIME = 20.0
"""The operating point is averaged over the memory [s]."""
REFERENCE_FILTER_HZ, REFERENCE_FILTER_DAMPING = 35.0, 0.7
"""Nominal actuator between reference and plate: 30 to 60 Hz are usual. An instrument need not be
exact; within this range the standard errors change by less than 5 %."""


@part
def accumulate(sums: np.ndarray, rows: np.ndarray, signals: int, both: bool) -> None:
    """Put the sums of products over some samples in place of `sums`: Z'Z, Z'τ, τ'τ, and Z'X where
    the instruments are others than the motion (`both`), else zeros.

    Parameters
    ----------
    sums
        Shape (packed_size(signals),).
    rows
        Each sample's instruments, torque and motion, shape (samples, 2 signals + 1).
    signals
        Number of instruments.
    both
        Whether the motion is there.
    """
    width = 2 * signals + 1 if both else signals + 1
    products = np.zeros((signals + 1, width))
    count = rows.shape[0]
    fours = count - count % 4
    for i in range(signals + 1):
        # Four samples at a time, one after the other in every sum.
        for n in range(0, fours, 4):
            a, b, c, d = rows[n, i], rows[n + 1, i], rows[n + 2, i], rows[n + 3, i]
            for j in range(i, width):
                products[i, j] = (
                    products[i, j]
                    + a * rows[n, j]
                    + b * rows[n + 1, j]
                    + c * rows[n + 2, j]
                    + d * rows[n + 3, j]
                )
        for n in range(fours, count):
            a = rows[n, i]
            for j in range(i, width):
                products[i, j] += a * rows[n, j]
    sums[:] = 0.0
    k = 0
    for i in range(signals):
        for j in range(i, signals):
            sums[k] = products[i, j]
            k += 1
    for i in range(signals + 1):
        sums[k] = products[i, signals]
        k += 1
    if both:
        for i in range(signals):
            for j in range(signals + 1, width):
                sums[k] = products[i, j]
                k += 1


@register_jitable
def reducible_size(signals: int) -> int:
    """Return how many numbers of `accumulate` `reduce_sums` needs: Z'Z, Z'τ and τ'τ."""
    return signals * (signals + 1) // 2 + signals + 1


def packed_size(signals: int) -> int:
    """Return how many numbers `accumulate` keeps for so many signals."""
    return reducible_size(signals) + signals * signals


@part
def reduce_sums(sums: np.ndarray, combine: np.ndarray, normal: np.ndarray) -> None:
    """Return the sums of products of the regression's signals: T' S T.

    Parameters
    ----------
    sums
        As `accumulate` makes them, of n instruments.
    combine
        T, shape (k, n): each row one signal of the regression as a combination of instruments; the
        last row is what is subtracted from the torque.
    normal
        Normal matrix of the regression, shape (k, k), replaced; its last row and column are the
        products with the torque.
    """
    count, size = combine.shape
    full, combined = np.empty((size, size)), np.zeros((count, size))
    k = 0
    for i in range(size):
        for j in range(i, size):
            value = sums[k]
            full[i, j] = value
            full[j, i] = value
            k += 1
    with_torque, square = sums[k : k + size], sums[k + size]
    _multiply(combine, full, combined)
    # The products of all signals, each sum in the order of the instruments.
    normal[:] = 0.0
    _multiply(combined, np.ascontiguousarray(combine.T), normal)
    last = count - 1
    for i in range(count):
        # The last signal is the torque less a combination.
        value = -normal[i, last]
        for q in range(size):
            value += combine[i, q] * with_torque[q]
        if i == last:
            value = square
            for q in range(size):
                value += (combined[i, q] - 2.0 * with_torque[q]) * combine[i, q]
        normal[i, last] = value
        for j in range(i, count):
            normal[j, i] = normal[i, j]


@part
def _multiply(left: np.ndarray, right: np.ndarray, product: np.ndarray) -> None:
    """Add the matrix product to `product`, four terms at a time, one after the other in every
    sum.
    """
    terms, columns = right.shape
    fours = terms - terms % 4
    for i in range(left.shape[0]):
        for q in range(0, fours, 4):
            a, b, c, d = left[i, q], left[i, q + 1], left[i, q + 2], left[i, q + 3]
            for j in range(columns):
                product[i, j] = (
                    product[i, j]
                    + a * right[q, j]
                    + b * right[q + 1, j]
                    + c * right[q + 2, j]
                    + d * right[q + 3, j]
                )
        for q in range(fours, terms):
            a = left[i, q]
            for j in range(columns):
                product[i, j] += a * right[q, j]


@part
def nuisance_coefficients(p: Plan, s: State) -> None:
    """Return what the nuisance terms add per recorded signal under the present solution."""
    w = s.nuisance
    base = p.functions.shape[1] + INTRINSIC
    for k in range(w.gamma.shape[0]):
        value = w.gamma[k, base]
        for r in range(INTRINSIC):
            value -= w.gamma[k, r] * s.solution[r]
        for r in range(base - INTRINSIC):
            value -= w.gamma[k, INTRINSIC + r] * s.response[r]
        w.coefficients[k] = value


@part
def tap_shift(tap: int) -> float:
    """Return by how many decimated samples the acceleration of a tap is late: 1, -1, 2, -2, ..."""
    reach = tap // 2 + 1
    return float(reach) if tap % 2 == 0 else -float(reach)
