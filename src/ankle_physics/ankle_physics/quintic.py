"""Quintic Hermite interpolation: between two samples the fifth-order polynomial that meets
position, velocity and acceleration at both.
"""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def quintic(
    start: np.ndarray, end: np.ndarray, length: float, part: float
) -> tuple[float, float, float]:
    """Return the position, velocity and acceleration at ``part`` (0 to 1) of an interval.

    Parameters
    ----------
    start, end
        Position [u], velocity [u/s], acceleration [u/s^2] at the ends, shape (3,).
    length
        Of the interval [s].
    """
    v0, a0 = start[1] * length, start[2] * length**2
    v1, a1 = end[1] * length, end[2] * length**2
    rise = end[0] - start[0]
    c2 = 0.5 * a0
    c3 = 10.0 * rise - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1
    c4 = -15.0 * rise + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1
    c5 = 6.0 * rise - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1
    s = part
    x = start[0] + s * (v0 + s * (c2 + s * (c3 + s * (c4 + s * c5))))
    v = v0 + s * (2.0 * c2 + s * (3.0 * c3 + s * (4.0 * c4 + s * 5.0 * c5)))
    a = 2.0 * c2 + s * (6.0 * c3 + s * (12.0 * c4 + s * 20.0 * c5))
    return x, v / length, a / length**2


@njit(cache=True)
def quintic_upsample(knots: np.ndarray, factor: int, length: float) -> np.ndarray:
    """Return the values at ``1/factor, ..., factor/factor`` of every interval between knots.

    Parameters
    ----------
    knots
        Position, velocity, acceleration, shape (n + 1, 3).
    length
        Of an interval [s].

    Returns
    -------
    np.ndarray
        Position, velocity, acceleration, shape (3, n * factor); the last sample of each interval is
        its end knot.
    """
    n = knots.shape[0] - 1
    out = np.empty((3, n * factor))
    for k in range(n):
        for j in range(1, factor):
            row = k * factor + j - 1
            out[0, row], out[1, row], out[2, row] = quintic(
                knots[k], knots[k + 1], length, j / factor
            )
        last = k * factor + factor - 1
        out[0, last], out[1, last], out[2, last] = knots[k + 1, 0], knots[k + 1, 1], knots[k + 1, 2]
    return out


@njit(cache=True)
def quintic_positions(knots: np.ndarray, first: float, step: float, count: int) -> np.ndarray:
    """Return the position at ``first + k * step``, k = 0...count-1, counted in intervals between
    knots of length 1.

    Parameters
    ----------
    knots
        Position, first and second derivative by interval, shape (m, 3), m > first + (count - 1) *
        step + 1.

    Returns
    -------
    np.ndarray
        Shape (count,).
    """
    out = np.empty(count)
    for k in range(count):
        place = first + k * step
        index = int(place)
        out[k] = quintic(knots[index], knots[index + 1], 1.0, place - index)[0]
    return out
