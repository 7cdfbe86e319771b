"""The reference at the times of the samples, whichever of both comes first."""

from __future__ import annotations

import numpy as np

LONGEST_WAIT = 2.0
"""Samples wait for so long [s of sample time] for a reference which has come before: a replay at
full speed sends up to 32 blocks, half a second, of one topic before the other."""
LARGEST_STEP = 0.05
"""A longer step [s] between two samples of a reference is a gap, in which there is no reference."""


class ReferenceTrack:
    """Joins samples with the reference position at their own times.

    The result depends on the times in both streams, not on which block came first, as long as the
    reference is at most `LONGEST_WAIT` behind the samples.
    """

    def __init__(self) -> None:
        self._times: np.ndarray = np.empty(0)
        self._positions: np.ndarray = np.empty(0)
        self._later: list[tuple[np.ndarray, np.ndarray]] = []
        self._newest = -np.inf
        self._held: list[np.ndarray] = []
        self._expected = True

    def feed_reference(self, times: np.ndarray, positions: np.ndarray) -> None:
        """Take in a stretch of the reference: times [s] and positions [rad], shape (n,).

        A stretch that begins before the last one ended replaces what is later.
        """
        usable = np.isfinite(times) & np.isfinite(positions)
        times, positions = times[usable], positions[usable]
        if not len(times):
            return
        if times[0] <= self._newest:
            self._take_later()
            kept = self._times < times[0]
            self._times, self._positions = self._times[kept], self._positions[kept]
        self._later.append((times, positions))
        self._newest = float(np.max(times))
        self._expected = True

    def _take_later(self) -> None:
        """Put the stretches that came since behind the others: a whole recording's in one go."""
        if self._later:
            times, positions = zip(*self._later, strict=True)
            self._times = np.concatenate([self._times, *times])
            self._positions = np.concatenate([self._positions, *positions])
            self._later = []

    def join(self, samples: np.ndarray) -> np.ndarray:
        """Return samples that are ready, with the reference's position as their last column.

        Parameters
        ----------
        samples
            Shape (n, k), time [s] in the first column.

        Returns
        -------
        np.ndarray
            Shape (j, k + 1); the reference is NaN where there is none. Samples for which a
            reference may still come are held back and come first in a later call.
        """
        self._take_later()
        if self._held:
            samples = np.concatenate([*self._held, samples])
            self._held = []
        times = samples[:, 0]
        ready = len(samples)
        if self._expected and np.any(np.isfinite(times)):
            covered = self._times[-1] if len(self._times) else -np.inf
            newest = float(np.nanmax(times))
            late = np.flatnonzero(times > covered)
            if len(late):
                if newest - float(times[late[0]]) < LONGEST_WAIT:
                    ready = int(late[0])
                    self._held = [samples[ready:]]
                else:
                    self._expected = False
        joined = np.column_stack([samples[:ready], self._at(times[:ready])])
        if ready and len(self._times):
            self._forget(times[ready - 1])
        return joined

    def release(self) -> np.ndarray:
        """Return held samples whose reference has come since, as `join` does: shape (j, k + 1), or
        (0, 0) where none is held.
        """
        if not self._held:
            return np.empty((0, 0))
        return self.join(np.empty((0, self._held[0].shape[1])))

    def _at(self, times: np.ndarray) -> np.ndarray:
        if len(self._times) < 2 or not len(times):
            return np.full(len(times), np.nan)
        first = int(np.searchsorted(self._times, times[0]))
        same = slice(first, first + len(times))
        if np.array_equal(self._times[same], times) and np.all(times[:-1] < times[1:]):
            # A rig that samples its own reference states both at the same times.
            return self._positions[same]
        after = np.clip(np.searchsorted(self._times, times), 1, len(self._times) - 1)
        values = np.interp(times, self._times, self._positions, left=np.nan, right=np.nan)
        gap = self._times[after] - self._times[after - 1] > LARGEST_STEP
        inside = (times != self._times[after - 1]) & (times != self._times[after])
        return np.where(gap & inside, np.nan, values)

    def _forget(self, time: float) -> None:
        first = int(np.searchsorted(self._times, time - LARGEST_STEP))
        if first > 1:
            self._times, self._positions = self._times[first - 1 :], self._positions[first - 1 :]
