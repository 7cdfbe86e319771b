"""Switch faults of a rig emulator that runs."""

from __future__ import annotations

import time

from ankle_actuator_driver.link.protocol.transport import UdpTransport, address_towards
from ankle_interfaces.errors import QuantityError

PATIENCE = 3.0
"""[s] Longest wait for an answer; the question is repeated meanwhile."""


def switch_faults(switches: str, address: str, port: int) -> str:
    """Set switches of a running rig emulator, and return those that are on afterwards.

    Parameters
    ----------
    switches
        As `faults.Faults.with_switches` takes them; empty only asks.
    address, port
        Of the emulator's line; its switches are at the next port.

    Raises
    ------
    QuantityError
        Refused; the message is the emulator's.
    OSError
        No emulator answers.
    """
    remote = (address, port + 1)
    line = UdpTransport((address_towards(remote), 0), remote)
    try:
        deadline = time.monotonic() + PATIENCE
        while time.monotonic() < deadline:
            line.send(switches.encode())
            for answer in line.receive(0.5):
                text = answer.data.decode(errors="replace")
                if text.startswith("error: "):
                    raise QuantityError(text.removeprefix("error: "))
                return text
    finally:
        line.close()
    raise OSError(f"no rig emulator answers at UDP {address}:{port + 1} within {PATIENCE:g} s")
