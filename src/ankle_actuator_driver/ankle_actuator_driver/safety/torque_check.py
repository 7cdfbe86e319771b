"""A check whether the torque stays beyond its limit, or comes back to it again and again."""

from __future__ import annotations

import numpy as np

TORQUE_PATIENCE = 0.17
"""[s] Time for which the torque may stay beyond its limit while the plate yields: with the packet
that brings the news it is a fault within 200 ms."""
LONGEST_SWING_TIME = 0.25
"""[s] Longest time between two excursions beyond the limit that count as a swing: a plate that
yields comes back once, and slowly."""
EXCURSION_SHARE = 0.05
"""Part of the limit by which an excursion passes it, and by which the torque falls below it in
between; the noise of a torque sensor (0.14 N.m of 30) does neither."""


class TorqueCheck:
    """Follows the measured torque."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Forget the samples so far: the check begins again."""
        self._beyond_since: float | None = None
        self._outside = False
        self._excursion = -np.inf

    def passed(self, time: np.ndarray, torque: np.ndarray, limit: float) -> str | None:
        """Return what is wrong with further samples, as a sentence; None where all is well.

        Parameters
        ----------
        time
            [s], increasing, shape (n,).
        torque
            Measured torque [N.m], shape (n,).
        limit
            Largest torque that is allowed [N.m].
        """
        for at, size in zip(time.tolist(), np.abs(torque).tolist(), strict=True):
            if size <= limit:
                self._beyond_since = None
            elif self._beyond_since is None:
                self._beyond_since = at
            elif at - self._beyond_since > TORQUE_PATIENCE:
                return f"torque of {size:.3g} N.m stays beyond the limit of {limit:g} N.m"
            if size < limit * (1.0 - EXCURSION_SHARE):
                self._outside = False
            elif size > limit * (1.0 + EXCURSION_SHARE) and not self._outside:
                again, self._outside, self._excursion = at - self._excursion, True, at
                if again < LONGEST_SWING_TIME:
                    return (
                        f"torque of {size:.3g} N.m swings beyond the limit of {limit:g} N.m, "
                        f"twice within {1e3 * again:.0f} ms"
                    )
        return None
