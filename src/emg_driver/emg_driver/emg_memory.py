"""The last seconds of EMG, raw and rectified, in one piece."""

from __future__ import annotations

import numpy as np

# Room for this many times the length that is kept: old samples are then moved out seldom.
CAPACITY_RATIO = 4


class EmgMemory:
    """Keeps the times, raw and rectified EMG of the last samples.

    Parameters
    ----------
    kept
        Samples that are always kept.
    channels
        Number of channels m.
    """

    def __init__(self, kept: int, channels: int) -> None:
        self._kept = kept
        self._data = np.empty((CAPACITY_RATIO * kept, 1 + 2 * channels))
        self._channels = channels
        self._first = self._stop = 0

    def __len__(self) -> int:
        return self._stop - self._first

    @property
    def time(self) -> np.ndarray:
        """Return the times [s], shape (n,)."""
        return self._data[self._first : self._stop, 0]

    @property
    def raw(self) -> np.ndarray:
        """Return the raw EMG [V], shape (n, m)."""
        return self._data[self._first : self._stop, 1 : 1 + self._channels]

    @property
    def rectified(self) -> np.ndarray:
        """Return the rectified EMG [V], shape (n, m)."""
        return self._data[self._first : self._stop, 1 + self._channels :]

    def append(self, time: np.ndarray, raw: np.ndarray, rectified: np.ndarray) -> None:
        """Add samples of shapes (k,), (k, m) and (k, m)."""
        count = len(time)
        if self._stop + count > len(self._data):
            keep = min(len(self), self._kept)
            last = self._data[self._stop - keep : self._stop].copy()
            if keep + count > len(self._data):
                self._data = np.empty((keep + CAPACITY_RATIO * count, self._data.shape[1]))
            self._data[:keep] = last
            self._first, self._stop = 0, keep
        new = self._data[self._stop : self._stop + count]
        new[:, 0], new[:, 1 : 1 + self._channels], new[:, 1 + self._channels :] = (
            time,
            raw,
            rectified,
        )
        self._stop += count
        self._first = max(self._first, self._stop - max(self._kept, count))

    def clear(self) -> None:
        """Forget everything."""
        self._first = self._stop = 0
