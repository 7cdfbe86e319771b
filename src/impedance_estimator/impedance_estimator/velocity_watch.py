"""The velocity channel is held against the change of position: wrong units and signs make a gain
that no residual shows.

Over pieces of 20 ms the mean velocity is compared with the distance moved. The encoder's noise is
small beside what moves within that time, and a lag of some milliseconds shifts little of it to the
next piece.
"""

from __future__ import annotations

import math

import numpy as np

from impedance_estimator.validity import LEAST_VELOCITY

PIECE_DURATION = 0.02
"""[s] Pulses and steps rise within 20 to 60 ms."""
WATCHED_DURATION = 10.0
"""[s] Older pieces count less, by ``exp(-age / WATCHED_DURATION)``: as long as the estimator's
memory."""
FEWEST_PIECES = 20
"""So many pieces with motion tell: one perturbation has two or three."""
LEAST_CORRELATION = 0.5
"""[1] A velocity of the same movement that is 10 ms late reaches 0.6."""
GAINS = (0.5, 2.0)
"""[1] Velocity over the change of position. What is left of a late one is more than half, and a
wrong unit makes 57 or 0.017."""


class VelocityWatch:
    """Collects samples and tells whether their velocity is that of their position.

    Parameters
    ----------
    rate
        Sampling rate [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._size = max(round(PIECE_DURATION * rate), 1)
        self._rate = rate
        self._fade = math.exp(-self._size / rate / WATCHED_DURATION)
        self._open: np.ndarray = np.empty((0, 2))
        # Pieces with motion; power of the change of position, of the velocity, and of both.
        self._sums = np.zeros(4)

    def add(self, samples: np.ndarray) -> None:
        """Take in samples.

        Parameters
        ----------
        samples
            Shape (n, 3) and more: time [s], position [rad], velocity [rad/s].
        """
        waiting = np.concatenate([self._open, samples[:, 1:3]])
        size, count = self._size, max((len(waiting) - 1) // self._size, 0)
        self._open = waiting[count * size :]
        if not count:
            return
        # Neighbouring pieces share the sample between them.
        moved = np.diff(waiting[: count * size + 1 : size, 0]) * self._rate / size
        read = waiting[: count * size, 1].reshape(count, size).mean(axis=1)
        whole = np.isfinite(moved) & np.isfinite(read)
        moved, read = moved[whole], read[whole]
        age = self._fade ** np.arange(len(moved) - 1, -1, -1)
        weight = age * (np.maximum(np.abs(moved), np.abs(read)) > LEAST_VELOCITY)
        self._sums *= self._fade ** len(moved)
        self._sums += [weight.sum(), weight @ moved**2, weight @ read**2, weight @ (moved * read)]

    @property
    def complaint(self) -> str:
        """Return how velocity contradicts position, in one sentence; empty where it does not, or
        where too little has moved to tell.
        """
        pieces, moved, read, both = self._sums
        if pieces < FEWEST_PIECES or min(moved, read) <= 0.0:
            return ""
        gain = both / moved
        if both < LEAST_CORRELATION * math.sqrt(moved * read):
            return "velocity is not that of the position (another sign, or another channel?)"
        if not GAINS[0] < gain < GAINS[1]:
            return f"velocity is {gain:.3g} times the change of position (another unit?)"
        return ""
