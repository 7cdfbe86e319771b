"""A `RigLink` for every line that carries the packets of docs/rig_protocol.md."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Protocol

from ankle_actuator_driver.link.protocol.driver_end import DriverEnd, draw_session
from ankle_actuator_driver.link.protocol.packet import read_key, sealed
from ankle_actuator_driver.link.protocol.transport import Transport
from ankle_actuator_driver.link.rig_link import Arrival, Clocks, RigLink
from ankle_actuator_driver.safety.rig import Order
from ankle_actuator_driver.safety.watchdog import LOST_AFTER
from ankle_interfaces.quantity import Value

ALIVE_PERIOD = LOST_AFTER / 10
"""[s] Between signs of life to whoever sends the heartbeats."""


class Sender(Protocol):
    """Sends the packets of a driver."""

    def send(self, data: bytes) -> None:
        """Send a packet, given without its digest."""

    def alive(self) -> None:
        """Report that the driver hears its rig."""

    def ended(self) -> bool:
        """Return whether nothing is sent any more."""

    def close(self) -> None:
        """Send nothing any more."""


class DirectSender:
    """Sends from the driver's own process, for lines within it.

    Parameters
    ----------
    line
        The line to the rig.
    key
        Shared with the rig.
    """

    def __init__(self, line: Transport, key: bytes) -> None:
        self._line, self._key, self._closed = line, key, False

    def send(self, data: bytes) -> None:
        """See `Sender`."""
        if not self._closed:
            self._line.send(sealed(data, self._key))

    def alive(self) -> None:
        """See `Sender`."""

    def ended(self) -> bool:
        """See `Sender`."""
        return self._closed

    def close(self) -> None:
        """See `Sender`."""
        self._closed = True


class PacketLink(RigLink):
    """Links a driver to a rig by packets over a transport.

    A subclass opens the transport in `open_line` and may have another process send in
    `make_sender`.
    """

    def __init__(self, values: Mapping[str, Value], clocks: Clocks) -> None:
        self.key = read_key(str(values["key_file"]))
        self.clocks = clocks
        self.line = self.open_line(values)
        self.end = DriverEnd(draw_session(), self.key)
        self._sender: Sender | None = self.make_sender()
        self._alive_at = -math.inf

    @abstractmethod
    def open_line(self, values: Mapping[str, Value]) -> Transport:
        """Open the transport."""

    def make_sender(self) -> Sender:
        """Make what sends the packets."""
        return DirectSender(self.line, self.key)

    def send(self, order: Order) -> None:
        """See `RigLink`."""
        if self._sender is not None:
            for data in self.end.unsealed(order, *self.clocks.read()):
                self._sender.send(data)

    def receive(self, timeout: float) -> list[Arrival]:
        """See `RigLink`."""
        found = []
        datagrams = self.line.receive(timeout)
        now, ros = self.clocks.read()
        if self._sender is not None and now - self._alive_at > ALIVE_PERIOD:
            self._alive_at = now
            self._sender.alive()
        for data, age, _ in datagrams:
            for event in self.end.take(data, now - age, ros - age):
                found.append(Arrival(event, now - age, ros - age))
        return found

    def silence(self) -> None:
        """See `RigLink`."""
        sender, self._sender = self._sender, None
        if sender is not None:
            sender.close()

    def speak(self) -> None:
        """See `RigLink`."""
        if self._sender is None:
            self._sender = self.make_sender()

    def alarm(self) -> str | None:
        """See `RigLink`; a process that sends heartbeats is replaced."""
        if self._sender is None or not self._sender.ended():
            return None
        self._sender.close()
        self._sender = self.make_sender()
        return "the process that sends the heartbeats ended; another one was started"

    def ros_time_was_set(self) -> None:
        """See `RigLink`."""
        self.end.restart_clock()

    def figures(self) -> dict[str, str]:
        """See `RigLink`."""
        end = self.end
        return {
            "drift of the rig's clock [ppm]": f"{1e6 * end.clock.drift:.2f}",
            "half of the shortest round trip [ms]": f"{1e3 * end.clock.uncertainty:.3f}",
            "samples lost on the way": str(end.missing),
            "samples without a time": str(end.undated),
            "packets from the rig refused": str(sum(end.refusals.values())),
            "packets refused by the rig": str(end.rig_refused),
        }

    def close(self) -> None:
        """See `RigLink`."""
        self.silence()
        self.line.close()
