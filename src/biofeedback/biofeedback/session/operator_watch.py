"""Whether an operator's page watches the session: the operator's dead-man's switch.

Every method receives monotonic time [s].
"""

from __future__ import annotations

import math

MAX_UNWATCHED_TIME = 2.0
"""[s] Time without an operator's page after which the session stops: a page that reloads is back
within one second, and a subject at the rig must not be alone for longer than it takes to notice."""
OPERATOR_HEARTBEAT_AGE = 0.5
"""[s] An operator's page counts as alive for this time after its last sign: it gives one for each
frame, 30 in a second, and a busy browser may pause for 0.3 s.
"""
ALIVE_RATE = 10.0
"""[Hz] Rate of the operator's heartbeat to the driver: many may be lost within its timeout."""


class OperatorWatch:
    """Follows the signs of life of the operators' pages."""

    def __init__(self) -> None:
        self._heard = self._announced = -math.inf
        self._alone_since: float | None = None

    def hear(self, monotonic: float) -> None:
        """Note a sign of life; from any thread."""
        self._heard = monotonic

    def _alive(self, monotonic: float) -> bool:
        return monotonic - self._heard <= OPERATOR_HEARTBEAT_AGE

    def heartbeat_due(self, monotonic: float) -> bool:
        """Tell whether the driver is to be told now that an operator's page is alive."""
        due = self._alive(monotonic) and monotonic - self._announced >= 0.9 / ALIVE_RATE
        if due:
            self._announced = monotonic
        return due

    def answers(self, monotonic: float) -> bool:
        """Tell whether a page was heard recently enough to arm and start."""
        return monotonic - self._heard <= MAX_UNWATCHED_TIME

    def has_left(self, monotonic: float, active: bool) -> bool:
        """Tell whether nobody has watched an active session for `MAX_UNWATCHED_TIME`.

        A session that becomes active without a page is given that time, too.
        """
        if not active or self._alive(monotonic):
            self._alone_since = None
            return False
        if self._alone_since is None:
            self._alone_since = max(self._heard, monotonic - OPERATOR_HEARTBEAT_AGE)
        return monotonic - self._alone_since > MAX_UNWATCHED_TIME
