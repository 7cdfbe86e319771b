"""The health of a node, from any of its threads: what is wrong, and figures beside it."""

from __future__ import annotations

import threading
import time

from diagnostic_msgs.msg import DiagnosticStatus, KeyValue

OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR
HEALTH_SHOWN = 10.0
"""[s] Shortest time for which a warning is shown, so that somebody who looks up once sees it."""
NEWS_PERIOD = 0.1
"""[s] Shortest time between reports of a fault that comes and goes with every block."""


class Health:
    """Holds the states and figures of a node by name; safe to use from several threads."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._states: dict[str, tuple[bytes, str, float]] = {}
        self._figures: dict[str, str] = {}
        self._reported_at = 0.0

    def state(self, what: str, level: bytes, message: str) -> bool:
        """Note the health of one thing.

        Parameters
        ----------
        what
            The thing, as ``ankle/samples``.
        level
            `OK`, `WARN` or `ERROR`.
        message
            One sentence that describes the state.

        Returns
        -------
        bool
            Whether this is news that should be published at once.
        """
        now = time.monotonic()
        with self._lock:
            before = self._states.get(what)
            self._states[what] = (level, message, now)
            fresh = before is None or before[0] == OK or now - before[2] > HEALTH_SHOWN
            return level != OK and fresh and now - self._reported_at > NEWS_PERIOD

    def count(self, what: str, value: object) -> None:
        """Note a figure that is shown with the health."""
        with self._lock:
            self._figures[what] = str(value)

    def status(self, name: str, hardware_id: str) -> DiagnosticStatus:
        """Return the present state as a message.

        It has the worst level, every sentence that is still shown, and all figures.

        Parameters
        ----------
        name
            Full name of the node.
        hardware_id
            The device or computer that it speaks for.
        """
        with self._lock:
            now = self._reported_at = time.monotonic()
            wrong = [
                (level, f"{what}: {message}")
                for what, (level, message, when) in self._states.items()
                if level != OK and now - when < HEALTH_SHOWN
            ]
            figures = [KeyValue(key=key, value=value) for key, value in self._figures.items()]
        level = max((entry[0] for entry in wrong), default=OK)
        text = "; ".join(message for _, message in sorted(wrong, reverse=True)) or "running"
        return DiagnosticStatus(
            level=level, name=name, message=text, hardware_id=hardware_id, values=figures
        )
