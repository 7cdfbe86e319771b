"""What has to come again and again, and how long it may stay away."""

from __future__ import annotations

LOST_AFTER = 0.1
"""[s] Time without a heartbeat after which the rig stops: five heartbeats, six packets of samples.
"""
HEARTBEAT_PERIOD = 0.02
"""[s] Longest time between packets each way."""


class Watchdog:
    """Expires `LOST_AFTER` seconds after it was last fed; it has no clock of its own."""

    def __init__(self) -> None:
        self._fed: float | None = None

    def feed(self, now: float) -> None:
        """Note that what is waited for has come, at a time [s]."""
        self._fed = now

    def forget(self) -> None:
        """Begin again as if nothing had come yet."""
        self._fed = None

    def expired(self, now: float) -> bool:
        """Return whether nothing has come for too long, or ever."""
        return self._fed is None or now - self._fed > LOST_AFTER
