"""The rig's clock in ROS time, from packets that go both ways.

The jitter of the packets' arrival never reaches a sample's time.

Each packet from the rig carries the rig's time at sending, and the rig's time at which it received
the driver's last packet with the driver's own time of sending it (as in NTP, RFC 5905, section 8).
With ROS time = rig's time + o:

    arrival of the rig's packet  - its sending        = o + delay up    >= o
    sending of the driver's      - its arrival there  = o - delay down  <= o

So o lies between the smallest of the first and the largest of the second kind in a window of time:
packets that waited drop out, and what is left is half the difference of the two shortest delays. A
weighted straight line through the windows' middles gives offset and drift. The times that are
handed out follow that line by changing their rate, never by a jump.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

WINDOW = 0.5
"""[s] Length of a window: it holds 32 packets each way at 64 a second, some of which have not
waited."""
MEMORY = 120
"""Number of windows that the line is fitted to: a minute, in which the drift of a crystal changes
by less than 1e-6."""
MIN_WINDOWS = 2
"""Number of windows after which times are converted."""
LEAST_UNCERTAINTY = 50e-6
"""[s] Uncertainty of a window whose delays are the shortest seen; it comes from the scheduling of
the receiving processes."""
LARGEST_DRIFT = 200e-6
"""[1] Standard deviation of the drift before anything is known: crystals are within 100e-6, NTP
slews by up to 500e-6.
"""
SLEW_TIME = 5.0
"""[s] Time in which an error of the times handed out is corrected ..."""
SLEW_LIMIT = 200e-6
"""[1] ... changing the interval between samples by no more than this: a fifth of what readers take
for another rate.
"""
CLOCK_JUMP = 10e-3
"""[s] A window that contradicts the line by more: one of the clocks was set."""


@dataclass
class _Window:
    begin: float
    upper: float = math.inf  # smallest arrival - sending [s]
    upper_at: float = 0.0  # by the rig's clock [s]
    lower: float = -math.inf
    lower_at: float = 0.0


class DeviceClock:
    """Follows one rig's clock.

    Attributes
    ----------
    drift
        ROS seconds gained by ROS time per second of the rig's clock [1].
    uncertainty
        Half the shortest round trip of the last window [s]; the mapping is no worse where delays
        are symmetric.
    """

    def __init__(self) -> None:
        self.restart()

    def restart(self) -> None:
        """Forget everything, because the rig has started anew or a clock was set."""
        self.drift = 0.0
        self.uncertainty = math.inf
        self._window: _Window | None = None
        self._middles: deque[tuple[float, float, float]] = deque(
            maxlen=MEMORY
        )  # rig's time, offset, round trip [s]
        self._origin = self._offset = 0.0  # offset at the origin [s] by the line
        # The times handed out: anchored at a rig's time, with an offset there and a rate.
        self._anchor, self._anchor_offset, self._rate = 0.0, 0.0, 0.0
        self._last_echo = -math.inf

    @property
    def ready(self) -> bool:
        """Tell whether the clock is known well enough to convert times."""
        return len(self._middles) >= MIN_WINDOWS

    def exchange(
        self, sent: float, arrived: float, echo: float, echo_received: float
    ) -> str | None:
        """Take in a packet from the rig.

        Parameters
        ----------
        sent
            Rig's clock at its sending [s].
        arrived
            ROS time of its arrival [s].
        echo
            ROS time at which the driver sent the packet that the rig heard last [s]; NaN where it
            heard none.
        echo_received
            Rig's clock when that one came [s].

        Returns
        -------
        str | None
            A sentence where a clock was set and the mapping begins again, else None.
        """
        if self._window is None:
            self._window = _Window(sent)
        window = self._window
        if arrived - sent < window.upper:
            window.upper, window.upper_at = arrived - sent, sent
        if echo > self._last_echo:
            self._last_echo = echo
            if echo - echo_received > window.lower:
                window.lower, window.lower_at = echo - echo_received, echo_received
        if sent - window.begin < WINDOW or window.lower == -math.inf:
            return None
        self._window = None
        return self._close(window, sent)

    def _close(self, window: _Window, now: float) -> str | None:
        at = 0.5 * (window.upper_at + window.lower_at)
        if self.ready:
            line = self._line(at)
            beyond = max(line - window.upper, window.lower - line)
            if beyond > CLOCK_JUMP:
                self.restart()
                return (
                    f"a clock was set: the rig's is off by {1e3 * beyond:.1f} ms from what it "
                    "was; its mapping to ROS time begins again"
                )
        self._middles.append(
            (at, 0.5 * (window.upper + window.lower), max(window.upper - window.lower, 0.0))
        )
        self.uncertainty = 0.5 * max(window.upper - window.lower, 0.0)
        self._fit(at)
        handed = self._anchor_offset + self._rate * (now - self._anchor)
        if len(self._middles) <= MIN_WINDOWS:
            handed = self._line(now)
        correction = min(max((self._line(now) - handed) / SLEW_TIME, -SLEW_LIMIT), SLEW_LIMIT)
        self._anchor, self._anchor_offset, self._rate = now, handed, self.drift + correction
        return None

    def _fit(self, origin: float) -> None:
        at, offset, trip = np.array(self._middles).T
        weight = 1.0 / (LEAST_UNCERTAINTY + trip - trip.min()) ** 2
        base = offset[-1]
        x, y = at - origin, offset - base
        # Normal equations of a straight line; the drift is expected to be 0 +- LARGEST_DRIFT before
        # it is known, so the determinant is positive for any times.
        total, first, second = weight.sum(), weight @ x, weight @ x**2 + LARGEST_DRIFT**-2
        level, moment = weight @ y, weight @ (x * y)
        determinant = total * second - first * first
        constant = (level * second - moment * first) / determinant
        slope = (total * moment - first * level) / determinant
        self._origin, self._offset, self.drift = origin, base + float(constant), float(slope)

    def _line(self, device: float) -> float:
        return self._offset + self.drift * (device - self._origin)

    def to_ros(self, device: float) -> float:
        """Convert a time of the rig [s] to ROS time [s]; the result is meaningful once `ready`."""
        return device + self._anchor_offset + self._rate * (device - self._anchor)

    def to_device(self, ros: float) -> float:
        """Convert a ROS time [s] to the rig's time [s]; the inverse of `to_ros`."""
        return self._anchor + (ros - self._anchor - self._anchor_offset) / (1.0 + self._rate)

    def interval(self, device: float) -> float:
        """Convert a duration on the rig's clock [s] to ROS seconds."""
        return device * (1.0 + self._rate)
