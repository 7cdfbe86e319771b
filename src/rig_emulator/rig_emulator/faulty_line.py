"""One direction of a line that loses, doubles, delays and damages packets."""

from __future__ import annotations

import heapq
from itertools import count

import numpy as np

from rig_emulator.faults import Faults

OVERTAKING_DELAY = 0.03
"""[s] Delay of a packet that others overtake: two packets of 15.6 ms."""
MAX_FLIPPED_BITS = 4
"""Largest number of bits that are flipped in a damaged packet."""


class FaultyLine:
    """Takes packets at one end, gives them out at the other.

    Parameters
    ----------
    seed
        Seed of all that is random.

    Attributes
    ----------
    faults
        The present switches.
    """

    def __init__(self, seed: int) -> None:
        self.faults = Faults()
        self._random = np.random.default_rng(seed)
        self._waiting: list[tuple[float, int, bytes]] = []
        self._number = count()

    def send(self, data: bytes, now: float) -> None:
        """Let a packet enter the line at a time [s of any clock]."""
        faults = self.faults
        if faults.freeze or self._happens(faults.drop):
            return
        if self._happens(faults.corrupt):
            data = self._damaged(data)
        due = now
        if now % 1.0 < faults.burst:
            due = now - now % 1.0 + faults.burst
        if self._happens(faults.reorder):
            due += OVERTAKING_DELAY
        for _ in range(1 + self._happens(faults.duplicate)):
            heapq.heappush(self._waiting, (due, next(self._number), data))

    def due(self, now: float) -> list[bytes]:
        """Return the packets that have come through by now."""
        out = []
        while self._waiting and self._waiting[0][0] <= now:
            out.append(heapq.heappop(self._waiting)[2])
        return out

    def _happens(self, part: float) -> bool:
        return part > 0.0 and self._random.random() < part

    def _damaged(self, data: bytes) -> bytes:
        damaged = bytearray(data)
        for place in self._random.integers(
            8 * len(damaged), size=self._random.integers(1, MAX_FLIPPED_BITS + 1)
        ):
            damaged[place // 8] ^= 1 << (place % 8)
        return bytes(damaged)
