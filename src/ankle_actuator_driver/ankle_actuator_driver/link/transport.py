"""How packets travel. Another fieldbus is another class with these three methods."""

from __future__ import annotations

import contextlib
import select
import socket
from typing import Protocol

LARGEST_PACKET = 2048
"""[bytes] Room for any packet of the protocol; a longer datagram is cut off, and refused by its
checksum.
"""
MOST_AT_ONCE = 256
"""Packets taken in one call, so that a flood leaves time for everything else."""


class Transport(Protocol):
    """A line to the other end."""

    def send(self, packet: bytes) -> None:
        """Send one packet; a line that is down loses it."""

    def receive(self, timeout: float) -> list[bytes]:
        """Packets that have come, waiting up to so many seconds for the first; empty where none
        came.
        """

    def close(self) -> None:
        """Give the line back."""


def address_towards(remote: tuple[str, int]) -> str:
    """This computer's address on the way to another one.

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
    """UDP between two addresses; datagrams from any other address are not taken.

    Parameters
    ----------
    local
        Address to receive at, as ``("127.0.0.1", 20480)``; port 0 takes a free one.
    remote
        The other end; None: whoever sends first, and after that whoever `answer` names.

    Raises
    ------
    OSError
        The address cannot be used; names it.
    """

    def __init__(self, local: tuple[str, int], remote: tuple[str, int] | None) -> None:
        self._socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        try:
            self._socket.bind(local)
            self.remote = None if remote is None else (socket.gethostbyname(remote[0]), remote[1])
        except OSError as error:
            self._socket.close()
            raise OSError(f"UDP {local[0]}:{local[1]} or {remote}: {error}") from None
        self._socket.setblocking(False)
        self._fixed = remote is not None
        self._last_sender: tuple[str, int] | None = None

    @property
    def local(self) -> tuple[str, int]:
        """The address at which packets come in."""
        address = self._socket.getsockname()
        return str(address[0]), int(address[1])

    def send(self, packet: bytes) -> None:
        """Send one packet; a line that is down loses it, which the other end's watchdog sees."""
        if self.remote is not None:
            with contextlib.suppress(OSError):
                self._socket.sendto(packet, self.remote)

    def receive(self, timeout: float) -> list[bytes]:
        """See `Transport`."""
        select.select([self._socket], [], [], max(timeout, 0.0))
        packets: list[bytes] = []
        # One by one where `answer` may be asked about the sender.
        while len(packets) < (MOST_AT_ONCE if self._fixed else 1):
            try:
                data, sender = self._socket.recvfrom(LARGEST_PACKET)
            except OSError:  # nothing left, or ICMP's "port unreachable"
                break
            if self._fixed and sender != self.remote:
                continue
            self._last_sender = sender
            packets.append(data)
        return packets

    def answer(self) -> None:
        """Send to whoever sent the last packet from now on."""
        self.remote = self._last_sender

    def close(self) -> None:
        """See `Transport`."""
        self._socket.close()
