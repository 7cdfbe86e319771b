"""Whether a stream's samples come as often as it declares, on a computer that is busy.

A computer that is busy hands samples over late and never early, so what counts is the smallest
delay of many chunks: the time at which the last sample of a chunk arrived, less the time that so
many samples take at the declared rate. It stays where it is at the right rate, and moves with time
at another one.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

PARTS = 30
"""Parts of the window of which each keeps its smallest delay."""
SHARE = 3
"""The smallest delays of the first and of the last of so many equal shares of a window are
compared: each share has chunks that have not waited, also on a busy computer."""


@dataclass(frozen=True)
class Window:
    """Describes how long the rate is looked at, and what is allowed.

    Attributes
    ----------
    length
        [s].
    tolerance
        Allowed part of the declared rate.
    """

    length: float
    tolerance: float


class RateCheck:
    """Follows the arrivals of one stream.

    Parameters
    ----------
    rate
        Declared [Hz].
    window
        How long and how closely.
    """

    def __init__(self, rate: float, window: Window) -> None:
        self._rate, self._window = rate, window
        self._least: deque[tuple[float, float]] = deque()  # arrival and smallest delay [s]
        self._part = -math.inf

    def add(self, arrival: float, count: int) -> None:
        """Note an arrival.

        Parameters
        ----------
        arrival
            Of a chunk [s].
        count
            Samples since the start, those included that are known to be missing.
        """
        found = (arrival, arrival - count / self._rate)
        if arrival - self._part >= self._window.length / PARTS:
            self._part = arrival
            self._least.append(found)
        elif found[1] < self._least[-1][1]:
            self._least[-1] = found
        while len(self._least) > 1 and arrival - self._least[1][0] >= self._window.length:
            self._least.popleft()

    @property
    def measured(self) -> float | None:
        """Return the rate over the window [Hz]; None before the window is full."""
        begin, end = self._least[0][0], self._least[-1][0]
        if end - begin < self._window.length * (1.0 - 2.0 / PARTS):
            return None
        share = (end - begin) / SHARE
        first = min((entry for entry in self._least if entry[0] <= begin + share), key=_delay)
        last = min((entry for entry in self._least if entry[0] >= end - share), key=_delay)
        passed = last[0] - first[0]
        return self._rate * (1.0 - (last[1] - first[1]) / passed)

    @property
    def agrees(self) -> bool | None:
        """Tell whether the rate is the declared one; None before the window is full."""
        measured = self.measured
        if measured is None:
            return None
        return abs(measured / self._rate - 1.0) <= self._window.tolerance


def _delay(entry: tuple[float, float]) -> float:
    return entry[1]
