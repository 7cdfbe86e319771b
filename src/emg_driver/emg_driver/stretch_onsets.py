"""The onsets of movements of the ankle, from the commanded reference or measured velocity.

An onset of direction d (1 dorsiflexing, -1 plantarflexing) is the last sample at rest, d v <= rest
velocity, before a movement that reaches the onset velocity. Two velocities, because a pulse turns
round without resting and a servo overshoots.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from ankle_interfaces.continuity import STEP_TOLERANCE, sampling_rate
from emg_driver.muscles import DORSIFLEXING, PLANTARFLEXING

# A commanded reference has no noise; this is far below the speed in the first sample of an edge
# (0.007 rad/s).
REFERENCE_REST = 1e-3  # rad/s


class OnsetDetector:
    """Finds onsets in a stream of samples; the result does not depend on the size of the blocks.

    Behind a gap, a step back in time or a sample that is not finite, a movement counts only after a
    rest: half of a movement gives no onset.

    Parameters
    ----------
    rest
        Speed up to which a sample counts as rest [rad/s].
    least
        Speed that a movement must reach [rad/s].

    Attributes
    ----------
    first, last
        Times of the first and the newest sample [s]; NaN before any.
    """

    def __init__(self, rest: float, least: float) -> None:
        self._rest, self._least = rest, least
        self._rested_at = np.full(
            2, np.nan
        )  # by direction; NaN when there was no rest since the last onset
        self.first = self.last = float("nan")
        self._last_position = float("nan")
        self._rate: float | None = None

    def from_velocity(self, time: np.ndarray, velocity: np.ndarray) -> np.ndarray:
        """Return onsets found in further samples.

        Parameters
        ----------
        time
            Times of the samples [s], shape (n,).
        velocity
            Velocity of the ankle [rad/s], shape (n,).

        Returns
        -------
        np.ndarray
            Time [s] and direction, shape (k, 2), in the order in which they are known.
        """
        if not len(time):
            return np.empty((0, 2))
        if self._rate is None and len(time) > 1:
            self._rate = sampling_rate(time)
        longest = (1.0 + STEP_TOLERANCE) / self._rate if self._rate else np.inf
        found = _scan(time, velocity, self._rested_at, self._rest, self._least, self.last, longest)
        if np.isnan(self.first):
            self.first = float(time[0])
        self.last = float(time[-1])
        return found

    def from_position(self, time: np.ndarray, position: np.ndarray) -> np.ndarray:
        """Return onsets by the first difference of a position [rad] without noise.

        The commanded reference is such a position; see `from_velocity`.
        """
        if not len(time):
            return np.empty((0, 2))
        before = position[0] if np.isnan(self._last_position) else self._last_position
        rate = self._rate or (sampling_rate(time) if len(time) > 1 else 1.0)
        velocity = np.diff(position, prepend=before) * rate
        self._last_position = float(position[-1])
        return self.from_velocity(time, velocity)


@njit(cache=True)
def _scan(
    time: np.ndarray,
    velocity: np.ndarray,
    rested_at: np.ndarray,
    rest: float,
    least: float,
    last: float,
    longest: float,
) -> np.ndarray:
    """Find the onsets, shape (k, 2); changes `rested_at`, the time of the last rest by direction,
    NaN where an onset has used it.
    """
    found = np.empty((2 * time.size, 2))
    count = 0
    for k in range(time.size):
        if not 0.0 < time[k] - last <= longest or not np.isfinite(velocity[k]):
            rested_at[:] = np.nan
        last = time[k]
        for index in range(2):
            speed = velocity[k] if index == 0 else -velocity[k]
            if speed <= rest:
                rested_at[index] = time[k]
            elif speed >= least and not np.isnan(rested_at[index]):
                found[count, 0] = rested_at[index]
                found[count, 1] = DORSIFLEXING if index == 0 else PLANTARFLEXING
                rested_at[index] = np.nan
                count += 1
    return found[:count]
