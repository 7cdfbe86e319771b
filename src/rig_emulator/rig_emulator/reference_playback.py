"""What the rig follows: samples with their times, and between them the fifth-order polynomial that
meets both.
"""

from __future__ import annotations

from collections import deque
from enum import Enum
from typing import Union

import numpy as np

from ankle_actuator_driver.safety.continuation import LONGEST_BRIDGE
from ankle_physics.quintic import quintic

REST_VELOCITY = 1e-6
"""[rad/s], and [rad/s^2] times a second: a reference that ends slower than this has come to rest.
"""

Motion = tuple[float, float, float]


class Empty(Enum):
    """Names the reason why there is no motion at a time."""

    BEFORE = "the first sample is still to come"
    OVER = "the samples are over while the plate moves, or a gap is too long to bridge"


class ReferencePlayback:
    """Stores stretches of samples and gives the motion at any later time.

    Attributes
    ----------
    bridged
        Number of gaps bridged.
    """

    def __init__(self) -> None:
        self.bridged = 0
        self._knots: deque[tuple[float, np.ndarray]] = deque()
        self._interval = 0.0
        # Compiled here, where nothing waits: at the first movement it would keep the rig from the
        # line for longer than the driver's watchdog allows.
        quintic(np.zeros(3), np.zeros(3), 1.0, 0.5)

    def clear(self) -> None:
        """Forget all samples."""
        self._knots.clear()

    @property
    def end(self) -> float | None:
        """Return the time of the last sample [s]; None where there is none."""
        return self._knots[-1][0] if self._knots else None

    def follows(self, first: float, interval: float) -> float | None:
        """Return the last position [rad] if a stretch from `first` [s] on follows without a gap.

        Otherwise the result is None.
        """
        if self._knots and abs(first - self._knots[-1][0] - interval) < 0.5 * interval:
            return float(self._knots[-1][1][0])
        return None

    def add(self, first: float, interval: float, motion: np.ndarray) -> None:
        """Append samples; those that are not later than the last one are left out.

        Parameters
        ----------
        first
            Time of sample 0 [s].
        interval
            Time between two samples [s].
        motion
            Position, velocity, acceleration, shape (n, 3).
        """
        end = self.end
        self._interval = interval
        # A copy: rows of a packet's own bytes, which cannot be written to, would be another type
        # to be compiled for.
        for index, sample in enumerate(np.array(motion, dtype=float)):
            time = first + index * interval
            if end is None or time > end + 0.5 * interval:
                self._knots.append((time, sample))

    def at(self, time: float) -> Union[Motion, Empty]:
        """Return position [rad], velocity [rad/s] and acceleration [rad/s^2] at a time [s].

        The time must never decrease.
        """
        knots = self._knots
        while len(knots) > 1 and knots[1][0] <= time:
            self.bridged += knots[1][0] - knots[0][0] > 1.5 * self._interval
            knots.popleft()
        if not knots or time < knots[0][0]:
            return Empty.BEFORE
        start, sample = knots[0]
        if len(knots) > 1:
            length = knots[1][0] - start
            if length > LONGEST_BRIDGE:
                return self._at_rest(sample)
            return quintic(sample, knots[1][1], length, (time - start) / length)
        if time - start < 1e-9:
            return float(sample[0]), float(sample[1]), float(sample[2])
        return self._at_rest(sample)

    @staticmethod
    def _at_rest(sample: np.ndarray) -> Union[Motion, Empty]:
        if abs(sample[1]) < REST_VELOCITY and abs(sample[2]) < REST_VELOCITY:
            return float(sample[0]), 0.0, 0.0
        return Empty.OVER
