"""The last half minute of every signal, decimated to the least and the largest value of each pixel.

A plain thinning would lose the perturbation's edges of 24 ms and every spike; minimum and maximum
keep them.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

WINDOW = 30.0
"""[s] Length of the traces that are shown."""
BINS = 600
"""Number of bins: about one for each pixel of the operator's page."""
DIGITS = 4
"""Number of significant digits that are sent; a trace is 100 pixels high."""


class MinMaxTraces:
    """Keeps the extremes of several channels with common times.

    Bin number k holds the samples with ``k <= t / width < k + 1``; bins are counted from the epoch,
    so that those of different traces lie under each other. Samples that are older than the window
    are left out.

    Parameters
    ----------
    names
        Names of the channels.
    window
        Length of time that is kept [s].
    bins
        Number of bins in the window.
    """

    def __init__(self, names: Sequence[str], window: float = WINDOW, bins: int = BINS) -> None:
        self.names = tuple(names)
        self.width = window / bins
        self._bins = bins
        self._low = np.full((bins, len(self.names)), np.nan)
        self._high = self._low.copy()
        self.newest: int | None = None

    def feed(self, time: np.ndarray, values: np.ndarray) -> None:
        """Process samples.

        Parameters
        ----------
        time
            [s], shape (n,), in any order within the window.
        values
            Shape (n, channels); NaN leaves a channel out.
        """
        known = np.isfinite(time)
        time, values = time[known], values[known]
        if not len(time):
            return
        number = np.floor(time / self.width).astype(np.int64)
        newest = int(number.max())
        if self.newest is None or newest < self.newest - self._bins:
            self._low[:], self._high[:] = np.nan, np.nan
            self.newest = newest
        elif newest > self.newest:
            empty = (
                np.arange(self.newest + 1, min(newest, self.newest + self._bins) + 1) % self._bins
            )
            self._low[empty], self._high[empty] = np.nan, np.nan
            self.newest = newest
        kept = number > self.newest - self._bins
        number, values = number[kept], values[kept]
        if not len(number):
            return
        starts = np.concatenate([[0], np.flatnonzero(np.diff(number)) + 1])
        places = number[starts] % self._bins
        low, high = (reduce.reduceat(values, starts, axis=0) for reduce in (np.fmin, np.fmax))
        for place, least, largest in zip(places, low, high, strict=True):
            self._low[place] = np.fmin(self._low[place], least)
            self._high[place] = np.fmax(self._high[place], largest)

    def since(self, seen: int | None) -> dict[str, Any] | None:
        """Return complete bins after number `seen` (all for None), ready for JSON.

        The result is None where there is nothing new.

        Returns
        -------
        dict[str, Any] | None
            ``first``: number of the first bin; ``low``, ``high``: for each name a list of values,
            None where a bin is empty.
        """
        if self.newest is None:
            return None
        last = self.newest - 1
        first = max(self.newest - self._bins + 1, -1 if seen is None else seen + 1)
        if first > last:
            return None
        places = np.arange(first, last + 1) % self._bins
        return {
            "first": first,
            "low": {
                name: _rounded(self._low[places, index]) for index, name in enumerate(self.names)
            },
            "high": {
                name: _rounded(self._high[places, index]) for index, name in enumerate(self.names)
            },
        }


def _rounded(values: np.ndarray) -> list[float | None]:
    return [
        float(f"{value:.{DIGITS}g}") if np.isfinite(value) else None for value in values.tolist()
    ]
