"""The cursor's way from one estimate to the next: a critically damped follower.

    x'' = w^2 (target - x) - 2 w x'

It never overshoots, so a step of an estimate is never shown larger than it is, and it lags a ramp
by 2 / w. The step over a frame is exact for a target that stays: with e = x - target and c = x' + w
e,

    e(h) = (e + c h) exp(-w h),   x'(h) = (x' - w c h) exp(-w h)
"""

from __future__ import annotations

import math

import numpy as np

NATURAL_FREQUENCY = 8.0
"""[Hz] Natural frequency of the follower: lag 2 / w = 40 ms, and two to three frames of 30 Hz for a
step: seen as motion rather than as a jump, and less than half of the 100 ms that feedback may take
beyond the estimator."""


class Cursor:
    """Holds a point (x, y) that follows its target.

    Parameters
    ----------
    natural_frequency
        W / 2 pi [Hz].

    Attributes
    ----------
    position
        Shape (2,); NaN before the first target.
    """

    def __init__(self, natural_frequency: float = NATURAL_FREQUENCY) -> None:
        self._w = 2.0 * math.pi * natural_frequency
        self.position: np.ndarray = np.full(2, np.nan)
        self._velocity: np.ndarray = np.zeros(2)

    def advance(self, target: np.ndarray, seconds: float) -> np.ndarray:
        """Return the position some time later.

        Parameters
        ----------
        target
            Shape (2,). A coordinate that is not finite has no target: it stays where it is.
        seconds
            Since the last call.
        """
        known = np.isfinite(target)
        new = known & ~np.isfinite(self.position)
        self.position[new], self._velocity[new] = target[new], 0.0
        self._velocity[~known] = 0.0
        e = np.where(known, self.position - target, 0.0)
        c = self._velocity + self._w * e
        decay = math.exp(-self._w * seconds)
        self._velocity = np.where(known, (self._velocity - self._w * c * seconds) * decay, 0.0)
        self.position = np.where(known, target + (e + c * seconds) * decay, self.position)
        return self.position
