"""The node's streams: the one that is published, and one that is about to take its place.

A new algorithm, new settings or a new model never stop the stream. Their estimator runs beside the
present one, on the same samples, until it has a valid estimate; then it takes over. What an
algorithm needs is compiled by another process before.
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable

import numpy as np

from ankle_interfaces.block import Block
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.stream import Estimates, EstimateStream

_VALID = ESTIMATE_COLUMNS.index("valid[1]")


class Compilation:
    """Fills the cache on disk for an algorithm, in a process of its own."""

    def __init__(self, algorithm: str) -> None:
        self.algorithm = algorithm
        command = (
            "import sys; from impedance_estimator.stream import compile_estimator; "
            "compile_estimator(sys.argv[1])"
        )
        self._process = subprocess.Popen(
            [sys.executable, "-c", command, algorithm],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
        )

    @property
    def finished(self) -> bool:
        """Tell whether the process has ended."""
        return self._process.poll() is not None

    def stop(self) -> None:
        """End the process where it still runs."""
        if self._process.poll() is None:
            self._process.kill()
            self._process.wait()


class LiveEstimates:
    """Feeds one stream, and a second one while that prepares to take over.

    Parameters
    ----------
    stream
        The stream whose estimates are published.
    """

    def __init__(self, stream: EstimateStream) -> None:
        self.stream = stream
        self._successor: EstimateStream | None = None
        self._prepare: Callable[[], bool] = lambda: True
        self._ready = True

    @property
    def changing(self) -> bool:
        """Tell whether another stream prepares to take over."""
        return self._successor is not None

    def replace(self, successor: EstimateStream, prepare: Callable[[], bool]) -> None:
        """Let another stream take over once it has a valid estimate.

        Parameters
        ----------
        successor
            Fed with the samples that come from now on.
        prepare
            Called with every block until it returns True; the successor is fed from then on.
        """
        self._successor = successor
        self._prepare = prepare
        self._ready = False

    def feed_reference(self, block: Block) -> None:
        """Take in one block of the reference."""
        self.stream.feed_reference(block)
        if self._successor is not None and self._ready:
            self._successor.feed_reference(block)

    def feed(self, block: Block) -> tuple[Estimates, bool]:
        """Process one block of samples; return what became due, and whether the successor took
        over.
        """
        due = self.stream.feed(block)
        if self._successor is None:
            return due, False
        self._ready = self._ready or self._prepare()
        return self._choose(due, lambda successor: successor.feed(block))

    def release(self) -> tuple[Estimates, bool]:
        """Return what became due by a block of the reference, as `feed` does."""
        return self._choose(self.stream.release(), lambda successor: successor.release())

    def _choose(
        self, due: Estimates, advance: Callable[[EstimateStream], Estimates]
    ) -> tuple[Estimates, bool]:
        """Return what the present stream gives, or the successor's where that takes over."""
        if self._successor is None or not self._ready:
            return due, False
        theirs = advance(self._successor)
        valid = bool(np.any(theirs.rows[:, _VALID] > 0.0))
        if not valid and self.stream.estimator is not None:
            return due, False
        self.stream, self._successor = self._successor, None
        return theirs, True
