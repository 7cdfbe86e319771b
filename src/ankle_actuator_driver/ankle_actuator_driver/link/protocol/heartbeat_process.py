"""The process that sends the driver's packets, and heartbeats in between.

Started by `HeartbeatProcess`; gets the line's socket and one end of a pair of sockets. The messages
on the pair: ``K`` key and the rig's address, once; ``A`` the driver is alive; ``P`` and a packet
without its digest. It ends with the driver: the pair is closed then, and Linux reports it.
"""

from __future__ import annotations

import contextlib
import gc
import json
import select
import signal
import socket
import subprocess
import sys
import time

from ankle_actuator_driver.link.protocol.heartbeats import Heartbeats
from ankle_node.parent_process import end_with_parent
from ankle_node.real_time import HEARTBEATS_PRIORITY, take_priority

LARGEST_MESSAGE = 4096
"""[bytes] Longest message to the process: any packet and the letter before it."""
POLL_PERIOD = 0.005
"""[s] Longest wait of the process for a message: a quarter of the time between heartbeats."""


class HeartbeatProcess:
    """Starts the process that sends heartbeats, and hands it what to send.

    Parameters
    ----------
    line
        The UDP socket that the driver receives at; packets leave by it.
    remote
        Address of the rig.
    key
        Shared with the rig.
    """

    def __init__(self, line: socket.socket, remote: tuple[str, int], key: bytes) -> None:
        self._pair, theirs = socket.socketpair(socket.AF_UNIX, socket.SOCK_SEQPACKET)
        with theirs:
            self._process = subprocess.Popen(
                [sys.executable, "-m", __name__, str(line.fileno()), str(theirs.fileno())],
                pass_fds=(line.fileno(), theirs.fileno()),
                stdin=subprocess.DEVNULL,
            )
        self._pair.setblocking(False)
        settings = {"key": key.hex(), "address": remote[0], "port": remote[1]}
        self._tell(b"K" + json.dumps(settings).encode())

    @property
    def pid(self) -> int:
        """Return the process id."""
        return self._process.pid

    def ended(self) -> bool:
        """Return whether the process is gone."""
        return self._process.poll() is not None

    def alive(self) -> None:
        """Report that the driver hears its rig."""
        self._tell(b"A")

    def send(self, data: bytes) -> None:
        """Send a packet, given without its digest."""
        self._tell(b"P" + data)

    def _tell(self, message: bytes) -> None:
        # A process that is gone or hangs sends nothing, which the rig's watchdog answers.
        with contextlib.suppress(OSError):
            self._pair.send(message)

    def close(self) -> None:
        """End the process."""
        self._pair.close()
        try:
            self._process.wait(timeout=1.0)
        except subprocess.TimeoutExpired:
            self._process.kill()
            self._process.wait()


def _send(line: socket.socket, packets: list[bytes], remote: tuple[str, int]) -> None:
    for packet in packets:
        with contextlib.suppress(OSError):  # a line that is down loses it
            line.sendto(packet, remote)


def main() -> int:
    """Work until the driver is gone."""
    end_with_parent()
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)  # the driver ends it, after the rig is off
    take_priority(HEARTBEATS_PRIORITY)
    line, pair = (socket.socket(fileno=int(number)) for number in sys.argv[1:3])
    pair.setblocking(True)
    settings = json.loads(pair.recv(LARGEST_MESSAGE)[1:])
    remote = (settings["address"], settings["port"])
    heartbeats = Heartbeats(bytes.fromhex(settings["key"]))
    pair.setblocking(False)
    gc.disable()
    while True:
        readable, _, _ = select.select([pair], [], [], POLL_PERIOD)
        while readable:
            try:
                message = pair.recv(LARGEST_MESSAGE)
            except BlockingIOError:
                break
            except OSError:
                return 0
            if not message:
                return 0
            now = time.monotonic()
            if message[:1] == b"A":
                heartbeats.alive(now)
            else:
                _send(line, heartbeats.forward(message[1:], now, time.time_ns()), remote)
        _send(line, heartbeats.due(time.monotonic(), time.time_ns()), remote)


if __name__ == "__main__":
    raise SystemExit(main())
