"""The driver's line to an emulated rig inside its own process: no network, no second process.

The driver finds it as `link:=emulated` wherever this package is installed.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Mapping

from ankle_actuator_driver.link.protocol.packet_link import PacketLink
from ankle_actuator_driver.link.protocol.transport import Datagram, Transport
from ankle_actuator_driver.link.rig_link import Clocks
from ankle_interfaces.quantity import Value
from rig_emulator.emulated_rig import EmulatedRig
from rig_emulator.settings import Settings


class QueueEnd:
    """Carries packets between the two ends of a line within a process.

    Parameters
    ----------
    outgoing, incoming
        Queues of packets.
    """

    def __init__(self, outgoing: queue.SimpleQueue[bytes], incoming: queue.SimpleQueue[bytes]):
        self._outgoing, self._incoming = outgoing, incoming

    def send(self, packet: bytes) -> None:
        """See `Transport`."""
        self._outgoing.put(packet)

    def receive(self, timeout: float) -> list[Datagram]:
        """See `Transport`."""
        found = []
        try:
            found.append(Datagram(self._incoming.get(timeout=max(timeout, 1e-4)), 0.0))
            while True:
                found.append(Datagram(self._incoming.get_nowait(), 0.0))
        except queue.Empty:
            return found

    def close(self) -> None:
        """See `Transport`."""


class Link(PacketLink):
    """Queues to an emulated rig that runs in a thread."""

    def __init__(self, values: Mapping[str, Value], clocks: Clocks) -> None:
        self._ended = threading.Event()
        super().__init__(values, clocks)

    def open_line(self, values: Mapping[str, Value]) -> Transport:
        """Start the rig."""
        down: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        up: queue.SimpleQueue[bytes] = queue.SimpleQueue()
        rig = EmulatedRig(Settings.defaults(key=self.key), QueueEnd(up, down))
        self._thread = threading.Thread(
            target=rig.run, args=(self._ended,), name="emulated rig", daemon=True
        )
        self._thread.start()
        return QueueEnd(down, up)

    def close(self) -> None:
        """See `RigLink`."""
        super().close()
        self._ended.set()
        self._thread.join(timeout=2.0)
