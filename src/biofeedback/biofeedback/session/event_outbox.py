"""Session events on their way from the session's thread to the graph and to the log."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Callable

from ankle_node.session_event import SessionEvent

DISCOVERY, LONGEST_DISCOVERY = 2.0, 10.0
"""[s] A recorder hears a node that was started anew only once the two have found each other. Events
wait so long for it, with the times they have: at least, and where no reader comes."""


class EventOutbox:
    """Keeps events until they may be sent.

    Parameters
    ----------
    log
        Called with the line of each event, at the next `send`.
    publish
        Called with the line of each event, once it may be sent.
    readers
        Gives the number of readers.
    wake
        Called when an event has come, from any thread; `send` is then called in the executor's.
    clock
        Gives monotonic time [s].
    """

    def __init__(
        self,
        log: Callable[[str], object],
        publish: Callable[[str], None],
        readers: Callable[[], int],
        wake: Callable[[], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._log, self._publish, self._readers, self._wake = log, publish, readers, wake
        self._clock = clock
        self._began = clock()
        self._unsent: deque[SessionEvent] = deque()
        self._unlogged: deque[SessionEvent] = deque()

    def put(self, event: SessionEvent) -> None:
        """Take an event, in any thread."""
        self._unlogged.append(event)
        self._unsent.append(event)
        self._wake()

    def send(self) -> None:
        """Log events, and publish them as soon as the readers are there."""
        while self._unlogged:
            self._log(self._unlogged.popleft().line())
        running = self._clock() - self._began
        if running > LONGEST_DISCOVERY or (running > DISCOVERY and self._readers()):
            while self._unsent:
                self._publish(self._unsent.popleft().line())
