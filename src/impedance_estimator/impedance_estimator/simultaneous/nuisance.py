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
    known = rows if both else np.ascontiguousarray(rows[:, : signals + 1])
    products = np.dot(np.ascontiguousarray(rows[:, : signals + 1].T), known)
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
            for j in range(signals + 1, 2 * signals + 1):
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
    # T' S T = Y + Y' with Y = T' H T, where H is the upper triangle of S with half its diagonal.
    half = np.zeros((size, size))
    k = 0
    for i in range(size):
        half[i, i:] = sums[k : k + size - i]
        half[i, i] *= 0.5
        k += size - i
    with_torque, square = np.dot(combine, sums[k : k + size]), sums[k + size]
    np.dot(np.dot(combine, half), combine.T, normal)
    for i in range(count):
        for j in range(i, count):
            normal[i, j] = normal[j, i] = normal[i, j] + normal[j, i]
    # The last signal is the torque less a combination.
    last = count - 1
    normal[last, last] += square - 2.0 * with_torque[last]
    for i in range(last):
        normal[i, last] = normal[last, i] = with_torque[i] - normal[i, last]


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
