"""Whether the rig commands the path that it was sent."""

from __future__ import annotations

import math

from ankle_actuator_driver.safety.rig import Status

LARGEST_PATH_DIFFERENCE = 0.015
"""[rad] Largest difference between the path that was sent and what the rig says it commands: the
clocks of both are known to 2 ms, and the plate is moved at up to 5 rad/s."""
PATH_DIFFERENCE_TIME = 0.025
"""[s] Time for which this difference has to last: two packets; a pulse of the paper lasts 40 ms."""
BRIDGE_TIME = 0.1
"""[s] Time for which a rig that has bridged a gap of the line may be on another path."""
YIELD_TIME = 10.0
"""[s] Time for which a rig that has yielded to a torque may be elsewhere: five of its time
constants of 2 s."""


class PathCheck:
    """Follows the difference between what was sent and what the rig commands."""

    def __init__(self) -> None:
        self._excused_until = -math.inf  # until then the rig may be on a path of its own
        self._elsewhere_since: float | None = None

    def begin(self) -> None:
        """Forget the difference of an earlier path."""
        self._elsewhere_since = None

    def note(self, status: Status, now: float) -> None:
        """Note at a time [s] why a rig may be elsewhere: it yields, or has bridged a gap."""
        if status & Status.YIELDING:
            self._excused_until = now + YIELD_TIME
        elif status & Status.REFERENCE_BRIDGED:
            self._excused_until = max(self._excused_until, now + BRIDGE_TIME)

    def fault(self, difference: float, now: float) -> str | None:
        """Return the sentence for a rig that is elsewhere for too long; None where it is not.

        Parameters
        ----------
        difference
            Of the commanded position from the path that was sent [rad].
        now
            Time of the driver [s].
        """
        if abs(difference) <= LARGEST_PATH_DIFFERENCE or now < self._excused_until:
            self._elsewhere_since = None
        elif self._elsewhere_since is None:
            self._elsewhere_since = now
        elif now - self._elsewhere_since > PATH_DIFFERENCE_TIME:
            return (
                f"the rig commands a position that is {difference:+.3g} rad from the reference "
                "that it was sent"
            )
        return None
