"""How packets travel: a line that carries bytes, and UDP."""

from __future__ import annotations

import contextlib
import select
import socket
import struct
import time
from typing import NamedTuple, Protocol

from ankle_actuator_driver.link.protocol.port_holder import holder_of

LARGEST_PACKET = 2048
"""[bytes] Room for any packet of the protocol; a longer datagram is cut off, and refused by its
digest.
"""
MAX_PACKETS_AT_ONCE = 256
"""Largest number of packets received in one call, so that a flood leaves time for everything else.
"""
_SO_TIMESTAMPNS = 35  # Linux; the socket module does not name it
_TIMESPEC = struct.Struct("@qq")
LONGEST_WAIT = 1.0
"""[s] Longest time for which a packet can have waited for this process; more is a clock that was
set."""


class Datagram(NamedTuple):
    """Holds a packet that has come.

    Attributes
    ----------
    data
        Its bytes.
    age
        For how long it has waited for this process [s]: a process that was put aside still knows
        when its packets came.
    sender
        Address of the other end, where the line knows it.
    """

    data: bytes
    age: float
    sender: tuple[str, int] | None = None


class Transport(Protocol):
    """Carries packets to and from the other end of a line."""

    def send(self, packet: bytes) -> None:
        """Send one packet; a line that is down loses it."""

    def receive(self, timeout: float) -> list[Datagram]:
        """Return packets that have come, oldest first, waiting up to so many seconds for the first.

        The list is empty where none came.
        """

    def close(self) -> None:
        """Close the line."""


def address_towards(remote: tuple[str, int]) -> str:
    """Return this computer's address on the way to another one.

    Raises
    ------
    OSError
        There is no way; names the other one.
    """
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as probe:
        try:
            probe.connect(remote)  # UDP: nothing is sent
        except OSError as error:
            raise OSError(f"{remote[0]}:{remote[1]} cannot be reached: {error}") from None
        return str(probe.getsockname()[0])


class UdpTransport:
    """Carries packets by UDP between two addresses; datagrams from any other address are ignored.

    Parameters
    ----------
    local
        Address to receive at, as ``("127.0.0.1", 20480)``; port 0 takes a free one.
    remote
        The other end, pinned; None: nobody yet, see `answer`.

    Raises
    ------
    OSError
        The address cannot be used; names it, and who uses it.
    """

    def __init__(self, local: tuple[str, int], remote: tuple[str, int] | None) -> None:
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self.socket.bind(local)
            self.remote = None if remote is None else (socket.gethostbyname(remote[0]), remote[1])
        except OSError as error:
            self.socket.close()
            raise OSError(
                f"UDP {local[0]}:{local[1]} or {remote}: {error}{holder_of('udp', local[1])}"
            ) from None
        self.socket.setblocking(False)
        with contextlib.suppress(OSError):
            self.socket.setsockopt(socket.SOL_SOCKET, _SO_TIMESTAMPNS, 1)
        self._fixed = remote is not None

    @property
    def local(self) -> tuple[str, int]:
        """Return the address at which packets come in."""
        address = self.socket.getsockname()
        return str(address[0]), int(address[1])

    def send(self, packet: bytes) -> None:
        """Send one packet; a line that is down loses it, which the other end's watchdog sees."""
        if self.remote is not None:
            with contextlib.suppress(OSError):
                self.socket.sendto(packet, self.remote)

    def receive(self, timeout: float) -> list[Datagram]:
        """See `Transport`."""
        select.select([self.socket], [], [], max(timeout, 0.0))
        packets: list[Datagram] = []
        while len(packets) < MAX_PACKETS_AT_ONCE:
            try:
                data, ancillary, _, sender = self.socket.recvmsg(LARGEST_PACKET, 64)
            except OSError:  # nothing left, or ICMP's "port unreachable"
                break
            if not self._fixed or sender == self.remote:
                packets.append(Datagram(data, _age(ancillary), sender))
        return packets

    def answer(self, sender: tuple[str, int] | None) -> None:
        """Send to this address from now on."""
        self.remote = sender

    def close(self) -> None:
        """See `Transport`."""
        self.socket.close()


def _age(ancillary: list[tuple[int, int, bytes]]) -> float:
    """Return how long a packet has waited [s], by the kernel's time of its arrival."""
    for level, kind, data in ancillary:
        if level == socket.SOL_SOCKET and kind == _SO_TIMESTAMPNS and len(data) >= _TIMESPEC.size:
            seconds, nanoseconds = _TIMESPEC.unpack_from(data)
            age = time.time() - seconds - 1e-9 * nanoseconds
            return age if 0.0 <= age <= LONGEST_WAIT else 0.0
    return 0.0
