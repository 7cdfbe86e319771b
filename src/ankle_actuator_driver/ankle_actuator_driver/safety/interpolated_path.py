"""The path that a rig follows between samples: the fifth-order polynomial that meets position,
velocity and acceleration at both ends (quintic Hermite interpolation).

    x(s) = x0 + v0 s + c2 s^2 + c3 s^3 + c4 s^4 + c5 s^5,    s = 0 ... 1 over one interval
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

RESOLUTION = 30e-6
"""[s] Time between the points at which position and velocity are looked at: 16 in an interval of
2048 Hz. Within a limit of 2000 rad/s^2 the largest velocity can then pass the looked at ones by
2000 * (30e-6 / 2) = 0.03 rad/s at the very most, and by 1e-5 rad/s for accelerations that change
smoothly."""


@dataclass(frozen=True)
class Path:
    """Holds the motion at many places of an interpolated path, knots included.

    Attributes
    ----------
    position
        [rad], any shape.
    velocity
        [rad/s], as `position`.
    largest_acceleration
        Largest absolute acceleration anywhere on the path [rad/s^2].
    """

    position: np.ndarray
    velocity: np.ndarray
    largest_acceleration: float


def coefficients(start: np.ndarray, end: np.ndarray, length: np.ndarray) -> np.ndarray:
    """Return coefficients of the polynomials in s, lowest power first.

    Parameters
    ----------
    start, end
        Position [rad], velocity [rad/s], acceleration [rad/s^2] at the ends, shape (n, 3).
    length
        Of the intervals [s], shape (n,).

    Returns
    -------
    np.ndarray
        Shape (n, 6).
    """
    rise = end[:, 0] - start[:, 0]
    v0, v1 = start[:, 1] * length, end[:, 1] * length
    a0, a1 = start[:, 2] * length**2, end[:, 2] * length**2
    return np.column_stack(
        [
            start[:, 0],
            v0,
            0.5 * a0,
            10.0 * rise - 6.0 * v0 - 4.0 * v1 - 1.5 * a0 + 0.5 * a1,
            -15.0 * rise + 8.0 * v0 + 7.0 * v1 + 1.5 * a0 - a1,
            6.0 * rise - 3.0 * v0 - 3.0 * v1 - 0.5 * a0 + 0.5 * a1,
        ]
    )


def _powers(part: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    one, zero = np.ones_like(part), np.zeros_like(part)
    position = np.stack([one, part, part**2, part**3, part**4, part**5])
    velocity = np.stack([zero, one, 2 * part, 3 * part**2, 4 * part**3, 5 * part**4])
    return position, velocity


@lru_cache(maxsize=16)
def _powers_of_parts(count: int) -> tuple[np.ndarray, np.ndarray]:
    """Return the powers at the ends of so many equal parts of an interval."""
    return _powers(np.linspace(0.0, 1.0, count + 1))


def _largest_acceleration(c: np.ndarray, length: np.ndarray) -> float:
    """Return the exact largest absolute acceleration: at an end, or where the jerk is zero."""
    c2, c3, c4, c5 = c[:, 2], c[:, 3], c[:, 4], c[:, 5]

    def acceleration(s: np.ndarray) -> np.ndarray:
        return np.abs(2 * c2 + s * (6 * c3 + s * (12 * c4 + s * 20 * c5))) / length**2

    found = [acceleration(np.zeros_like(c2)), acceleration(np.ones_like(c2))]
    # jerk: 60 c5 s^2 + 24 c4 s + 6 c3 = 0
    root = np.sqrt(np.maximum((24 * c4) ** 2 - 4 * 60 * c5 * 6 * c3, 0.0))
    with np.errstate(divide="ignore", invalid="ignore"):
        for sign in (1.0, -1.0):
            found.append(acceleration(_inside((-24 * c4 + sign * root) / (120 * c5))))
        found.append(acceleration(_inside(-c3 / (4 * c4))))  # where c5 vanishes
    return float(max(values.max() for values in found))


def _inside(s: np.ndarray) -> np.ndarray:
    return np.clip(np.where(np.isfinite(s), s, 0.0), 0.0, 1.0)


def path_through(time: np.ndarray, motion: np.ndarray) -> Path:
    """Return the path that a rig follows from the first sample to the last.

    Parameters
    ----------
    time
        [s], shape (n,), increasing, n of at least 2.
    motion
        Position, velocity, acceleration, shape (n, 3).
    """
    length = np.diff(time)
    c = coefficients(motion[:-1], motion[1:], length)
    position, velocity = _powers_of_parts(max(2, math.ceil(float(length.max()) / RESOLUTION)))
    return Path(c @ position, (c @ velocity) / length[:, None], _largest_acceleration(c, length))


def positions_at(time: np.ndarray, motion: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """Return positions of the path [rad] at any times.

    Before the first sample and behind the last one the plate stands at that sample.

    Parameters
    ----------
    time, motion
        As in `path_through`; one sample will do.
    wanted
        Times at which positions are wanted [s], shape (m,).

    Returns
    -------
    np.ndarray
        Shape (m,).
    """
    if len(time) < 2:
        return np.full(len(wanted), motion[0, 0])
    place = np.clip(np.searchsorted(time, wanted, side="right") - 1, 0, len(time) - 2)
    length = time[place + 1] - time[place]
    c = coefficients(motion[place], motion[place + 1], length)
    position, _ = _powers(np.clip((wanted - time[place]) / length, 0.0, 1.0))
    return np.einsum("ij,ji->i", c, position)
