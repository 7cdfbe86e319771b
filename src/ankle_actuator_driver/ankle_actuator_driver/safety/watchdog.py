"""What has to come again and again, and how long it may stay away."""

from __future__ import annotations

import math

LOST_AFTER = 0.1
"""[s] Time without a heartbeat after which the rig stops: five heartbeats, six packets of samples.
"""
HEARTBEAT_PERIOD = 0.02
"""[s] Longest time between packets each way."""


LONGEST_SILENCE = 2 * LOST_AFTER
"""[s] Time after which nobody is excused: a fault of the rig is to be noticed within 200 ms."""


class Watchdog:
    """Expires `LOST_AFTER` seconds after it was last fed; it has no clock of its own.

    Who was kept from the line cannot tell the other end's silence from an own pause, least of all
    where one computer runs both ends. After a pause the other end has one period of its heartbeats
    to be heard, as long as it was not silent for `LONGEST_SILENCE`.
    """

    def __init__(self) -> None:
        self._fed: float | None = None
        self._excused_until = -math.inf

    def feed(self, now: float) -> None:
        """Note that what is waited for has come, at a time [s]."""
        self._fed = now

    def look(self, before: float, now: float) -> None:
        """Note when the line was looked at before [s], and that it is looked at now [s]."""
        if now - before > HEARTBEAT_PERIOD:
            self._excused_until = now + HEARTBEAT_PERIOD

    def expired(self, now: float) -> bool:
        """Return whether nothing has come for too long, or ever."""
        if self._fed is None:
            return True
        silence = now - self._fed
        return silence > LOST_AFTER and (now > self._excused_until or silence > LONGEST_SILENCE)
