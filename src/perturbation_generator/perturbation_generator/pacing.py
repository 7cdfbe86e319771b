"""When each block is due, and how late blocks were."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class Schedule:
    """Holds the absolute deadlines of blocks.

    Attributes
    ----------
    start
        Time of sample 0 [s].
    rate
        [Hz].
    lead
        How long before the time of its last sample a block is due [s].
    """

    start: float
    rate: float
    lead: float = 0.0

    def times(self, first: int, n: int) -> np.ndarray:
        """Return the times [s] of samples first ... first + n - 1: start + k / rate.

        No sum of intervals is formed, because it would drift.
        """
        return self.start + np.arange(first, first + n) / self.rate

    def deadline(self, first: int, n: int) -> float:
        """Return when the block of samples first ... first + n - 1 is due [s]."""
        return self.start + (first + n - 1) / self.rate - self.lead


@dataclass
class Lateness:
    """Counts how late blocks were.

    Attributes
    ----------
    tolerance
        A block is late when it leaves more than this after its deadline [s].
    sent, late
        Number of blocks.
    worst
        Largest delay behind a deadline [s].
    """

    tolerance: float
    sent: int = 0
    late: int = 0
    worst: float = 0.0

    def note(self, delay: float) -> bool:
        """Count a block that left so long after its deadline [s]; return whether it was late."""
        self.sent += 1
        self.worst = max(self.worst, delay)
        self.late += delay > self.tolerance
        return delay > self.tolerance
