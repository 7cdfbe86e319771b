"""The schedule of sending: packets of the driver as they come, and heartbeats in between.

A pure rule without a clock of its own; `heartbeat_process` gives it a process and a clock of its
own, which nothing that happens in the driver's process can hold up.
"""

from __future__ import annotations

import math

from ankle_actuator_driver.link.protocol.packet import (
    Heartbeat,
    as_heartbeat,
    numbers_of,
    parse,
    renumbered,
    sealed,
)
from ankle_actuator_driver.safety.rig import Wanted
from ankle_actuator_driver.safety.watchdog import HEARTBEAT_PERIOD, LOST_AFTER


class Heartbeats:
    """Schedules heartbeats between the packets of the driver, so that no watchdog expires.

    A driver that has not said that it is alive for 100 ms may only switch off: all its other
    packets, and the heartbeats in its name, stay here.

    Parameters
    ----------
    key
        Shared with the rig; empty for none.

    Attributes
    ----------
    added
        Heartbeats sent between the driver's packets.
    withheld
        Packets of a driver that was not alive.
    """

    def __init__(self, key: bytes) -> None:
        self.added = 0
        self.withheld = 0
        self._key = key
        self._alive = self._sent = -math.inf
        self._template: bytes | None = None
        self._added_to_order = 0

    def alive(self, now: float) -> None:
        """Note that the driver hears its rig, at a time [s]."""
        self._alive = now

    def forward(self, data: bytes, now: float, stamp: int) -> list[bytes]:
        """Return what to send for a packet of the driver.

        Parameters
        ----------
        data
            The packet without its digest.
        now
            Monotonic time [s].
        stamp
            Time of sending to be written into it [ns].

        Returns
        -------
        list of bytes
            What is to be sent: the packet, or nothing.
        """
        heartbeat = as_heartbeat(data)
        parsed = parse(sealed(heartbeat))
        if not isinstance(parsed, Heartbeat):
            return []
        if now - self._alive > LOST_AFTER and parsed.wanted is not Wanted.OFF:
            self.withheld += 1
            return []
        self._template, self._added_to_order, self._sent = heartbeat, 0, now
        return [sealed(renumbered(data, numbers_of(data)[0], stamp), self._key)]

    def due(self, now: float, stamp: int) -> list[bytes]:
        """Return a heartbeat where one is due; see `forward`."""
        if self._template is None or now < self.next_due or now - self._alive > LOST_AFTER:
            return []
        self._added_to_order += 1
        self.added += 1
        self._sent = now
        sequence = (numbers_of(self._template)[0] + self._added_to_order) % 2**32
        return [sealed(renumbered(self._template, sequence, stamp), self._key)]

    @property
    def next_due(self) -> float:
        """Return the time at which the next heartbeat is due [s]."""
        return self._sent + HEARTBEAT_PERIOD
