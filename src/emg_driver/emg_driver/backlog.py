"""Blocks that wait until readers can take them.

A stream is looked at for seconds before its first block is given out. All of it sent at once would
be lost at readers of others with short queues, and would hold up those with long ones.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable

import numpy as np

MAX_BLOCKS_AT_ONCE = 16
"""Largest number of blocks sent at once: a quarter of a short queue of 64 blocks."""
CATCH_UP_RATE = 128.0
"""[1/s] Rate of blocks while there is a backlog: twice as fast as they come, which readers manage
on a busy computer too."""


class Backlog:
    """Hands out queued blocks in order, never faster than readers can process them."""

    def __init__(self) -> None:
        self._blocks: deque[np.ndarray] = deque()
        self._allowed = float(MAX_BLOCKS_AT_ONCE)
        self._asked: float | None = None

    def __len__(self) -> int:
        return len(self._blocks)

    def add(self, blocks: Iterable[np.ndarray]) -> None:
        """Append blocks."""
        self._blocks.extend(blocks)

    def due(self, now: float) -> list[np.ndarray]:
        """Return the blocks that may be sent at a time of the steady clock [s]."""
        passed = 0.0 if self._asked is None else now - self._asked
        self._asked = now
        self._allowed = min(self._allowed + CATCH_UP_RATE * passed, float(MAX_BLOCKS_AT_ONCE))
        count = min(int(self._allowed), len(self._blocks))
        self._allowed -= count
        return [self._blocks.popleft() for _ in range(count)]
