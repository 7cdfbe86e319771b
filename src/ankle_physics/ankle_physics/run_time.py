"""The time of a run, for terms that follow it."""

from __future__ import annotations

import numpy as np

# Terms that drift state K and G for half a minute into the run, the middle of the shortest trial.
REFERENCE_TIME = 30.0  # s


class RunTime:
    """Counts the samples of a run; `Term.start` puts it in the state under ``run_time``.

    Parameters
    ----------
    rate
        Samples a second [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._count = 0

    def advance(self, count: int) -> np.ndarray:
        """Return the times [s] of the next `count` samples, shape (count,)."""
        time = (self._count + np.arange(count)) / self._rate
        self._count += count
        return time

    def skip(self, seconds: float) -> None:
        """Move on by this time [s], to the nearest sample."""
        self._count += round(seconds * self._rate)
