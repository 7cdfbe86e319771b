"""The line of docs/rig_protocol.md: UDP to the rig's own computer.

Packets leave by a process of their own, so that nothing that happens in the driver's process keeps
the rig without heartbeats.
"""

from __future__ import annotations

from collections.abc import Mapping

from ankle_actuator_driver.link.protocol.heartbeat_process import HeartbeatProcess
from ankle_actuator_driver.link.protocol.packet_link import PacketLink, Sender
from ankle_actuator_driver.link.protocol.transport import UdpTransport, address_towards
from ankle_interfaces.quantity import Value


class Link(PacketLink):
    """Sends packets by UDP to one pinned address, and receives them from there."""

    line: UdpTransport

    def open_line(self, values: Mapping[str, Value]) -> UdpTransport:
        """Open the socket."""
        rig = (str(values["rig_address"]), int(values["rig_port"]))
        local = str(values["local_address"]) or address_towards(rig)
        return UdpTransport((local, int(values["local_port"])), rig)

    def make_sender(self) -> Sender:
        """Start the process that sends."""
        assert self.line.remote is not None
        return HeartbeatProcess(self.line.socket, self.line.remote, self.key)

    def describe(self) -> str:
        """See `RigLink`."""
        assert self.line.remote is not None
        rig, own = self.line.remote, self.line.local
        keyed = "with a key" if self.key else "without a key: the line has to be a dedicated one"
        return f"the rig is at {rig[0]}:{rig[1]}, this side at {own[0]}:{own[1]}, {keyed}"
