"""How far a replay may run ahead of its readers.

A reader's DDS queue is limited: what comes when it is full overwrites the oldest message that the
reader has not got to. So at most `WINDOW` messages of a topic are under way: sent, and not yet
acknowledged by the slowest reader. Readers say which message they have acknowledged by the time it
was sent, which the middleware stamps on it, so a count that began with an earlier replay cannot
confuse it.
"""

from __future__ import annotations

import threading
import time
from bisect import bisect_right
from collections.abc import Callable

WINDOW = 32
"""Messages under way: a sixteenth of the queue of this project's readers, so that a reader of
somebody else's with a queue of 64 loses nothing either."""


class Flow:
    """Follows the messages of one topic on their way to its readers; safe to use from two threads.

    Parameters
    ----------
    readers
        How many readers report what they have acknowledged.
    window
        Messages that may be under way.

    Attributes
    ----------
    sent
        Messages sent so far.
    """

    def __init__(self, readers: int, window: int = WINDOW) -> None:
        self.readers = readers
        self.window = window
        self._sent_at: list[int] = []
        self._done: dict[str, int] = {}
        self._changed = threading.Condition()

    @property
    def sent(self) -> int:
        """Return the number of messages sent so far."""
        return len(self._sent_at)

    def sending(self, now_ns: int) -> None:
        """Note that a message will be sent; its stamp will not be before `now_ns` [ns]."""
        with self._changed:
            self._sent_at.append(now_ns)

    def acknowledged(self, reader: str, stamp_ns: int) -> None:
        """Note that a reader has processed the message of `stamp_ns` [ns] and all before it."""
        with self._changed:
            self._done[reader] = max(
                self._done.get(reader, 0), bisect_right(self._sent_at, stamp_ns)
            )
            self._changed.notify_all()

    def _under_way(self) -> int:
        """Return the number of messages that the slowest reader has not acknowledged.

        It is 0 without readers that report it.
        """
        if self.readers == 0:
            return 0
        slowest = min(self._done.values()) if len(self._done) >= self.readers else 0
        return len(self._sent_at) - slowest

    def wait(self, at_most: int, patience: float, going_on: Callable[[], bool]) -> bool:
        """Wait until at most so many messages are under way.

        Parameters
        ----------
        at_most
            Messages; 0 waits until everything is acknowledged.
        patience
            Longest time [s] without any progress of the slowest reader.
        going_on
            Asked ten times a second; False ends the wait.

        Returns
        -------
        bool
            False when no reader made progress for `patience`, or the wait was ended.
        """
        with self._changed:
            before = self._under_way()
            since = time.monotonic()
            while before > at_most:
                self._changed.wait(0.1)
                now = self._under_way()
                if now < before:
                    since = time.monotonic()
                elif time.monotonic() - since > patience:
                    return False
                if not going_on():
                    return False
                before = now
            return True

    def laggards(self) -> str:
        """Return how far each reader is, for an error message."""
        with self._changed:
            known = [
                f"{reader.split()[0]} acknowledged {done} of {len(self._sent_at)}"
                for reader, done in sorted(self._done.items())
            ]
            silent = self.readers - len(self._done)
            return ", ".join(known + ([f"{silent} reader(s) never answered"] if silent > 0 else []))
