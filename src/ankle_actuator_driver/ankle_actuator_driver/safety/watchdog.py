"""What has to come again and again, and how long it may stay away."""

from __future__ import annotations

LOST_AFTER = 0.1
"""[s] Without a heartbeat, after which the rig stops: five heartbeats, six packets of samples."""
HEARTBEAT_PERIOD = 0.02
"""[s] Between packets each way, at the most."""


class Watchdog:
    """Expires `LOST_AFTER` seconds after it was last fed. Knows no clock of its own."""

    def __init__(self) -> None:
        self._fed: float | None = None

    def feed(self, now: float) -> None:
        """What was waited for has come [s]."""
        self._fed = now

    def forget(self) -> None:
        """Nothing has come yet."""
        self._fed = None

    def expired(self, now: float) -> bool:
        """Whether nothing has come for too long, or ever."""
        return self._fed is None or now - self._fed > LOST_AFTER
