"""The emulated controller at the pace of its own clock, at the end of a line, with faults on
request.
"""

from __future__ import annotations

import secrets
import threading
import time
from collections.abc import Callable

from ankle_actuator_driver.link.protocol.packet import Heartbeat, Refusal
from ankle_actuator_driver.link.protocol.transport import Transport, UdpTransport
from ankle_actuator_driver.safety.rig import UNPOWERED, DeviceState
from ankle_interfaces.errors import QuantityError
from rig_emulator.emulated_ankle import EmulatedAnkle
from rig_emulator.emulated_device import EmulatedDevice
from rig_emulator.faults import Faults
from rig_emulator.faulty_line import FaultyLine
from rig_emulator.settings import Settings

POLL_PERIOD = 0.002
"""[s] Half a servo cycle."""


class EmulatedRig:
    """Paces an `EmulatedDevice` by its own clock and gives it a line and switches.

    Packets that waited while this process was put aside are obeyed at the time at which they came:
    the watchdogs judge the line, not the scheduling of this computer.

    Parameters
    ----------
    settings
        What it is made of.
    line
        The line to the driver.
    switches
        Where fault switches come in, or None.
    say
        Called with a sentence when something happens that the operator should know.
    """

    def __init__(
        self,
        settings: Settings,
        line: Transport,
        switches: UdpTransport | None = None,
        say: Callable[[str], None] | None = None,
    ) -> None:
        self._line, self._switches = line, switches
        self._say = say or (lambda sentence: None)
        self._drift, self._offset = settings.clock_drift, settings.clock_offset
        self._ankle = EmulatedAnkle(settings.setup, settings.rate, settings.noisy, self._say)
        self._started = time.monotonic()
        self.device = EmulatedDevice(
            self._ankle,
            settings.limits,
            settings.rate,
            secrets.randbelow(2**32 - 1) + 1,
            self.clock(),
            settings.key,
        )
        seed = settings.setup.seed
        self._down, self._up = FaultyLine(seed), FaultyLine(seed + 1)
        self._peer: tuple[str, int] | None = None
        self._shown: tuple[DeviceState, str] | None = None
        self._looked = self.clock()
        self.switch(settings.faults)

    def clock(self) -> float:
        """Return the rig's clock [s]."""
        return self._offset + (time.monotonic() - self._started) * (1.0 + self._drift)

    def run(self, stop_requested: threading.Event) -> None:
        """Run until asked to stop."""
        while not stop_requested.is_set():
            self.turn()

    def turn(self) -> None:
        """Receive what has come, run the servo up to now, send what is due."""
        datagrams = self._line.receive(POLL_PERIOD)
        now = self.clock()
        self.device.look(self._looked, now)
        self._looked = now
        for data, age, sender in datagrams:
            if not self._from_a_stranger(sender):
                self._obey(data, sender, now - age)
        self._pass_on(now)
        for data in self._up.due(now):
            self._line.send(data)
        self._take_switches()
        self._show()

    def _from_a_stranger(self, sender: tuple[str, int] | None) -> bool:
        """Return whether a packet is not of the address that is obeyed while the plate is
        powered.
        """
        if self.device.state in UNPOWERED or sender == self._peer:
            return False
        self.device.refusals[Refusal.PEER] += 1
        return True

    def _obey(self, data: bytes, sender: tuple[str, int] | None, at: float) -> None:
        if isinstance(self.device.read(data), Heartbeat) and self.device.state in UNPOWERED:
            self._peer = sender
            if isinstance(self._line, UdpTransport):
                self._line.answer(sender)
        self._down.send(data, at)
        self._pass_on(at)

    def _pass_on(self, now: float) -> None:
        """Give the device what has come through the line by now, and let it run until then."""
        for data in self._down.due(now):
            for packet in self.device.advance(now):
                self._up.send(packet, now)
            self.device.receive(data, now)
        for packet in self.device.advance(now):
            self._up.send(packet, now)

    def _take_switches(self) -> None:
        for text, _, sender in self._switches.receive(0.0) if self._switches else ():
            assert self._switches is not None
            try:
                faults = self._ankle.faults.with_switches(text.decode(errors="replace"))
            except QuantityError as error:
                answer = f"error: {error}"
            else:
                self.switch(faults)
                answer = faults.line()
            self._switches.answer(sender)
            self._switches.send(answer.encode())

    def switch(self, faults: Faults) -> None:
        """Set all fault switches."""
        if faults.emergency_stop != self._ankle.faults.emergency_stop:
            self.device.press_emergency_stop(bool(faults.emergency_stop), self.clock())
        self._ankle.faults = self._down.faults = self._up.faults = self.device.faults = faults
        self._say(f"fault switches: {faults.line()}")

    def _show(self) -> None:
        present = (self.device.state, self.device.fault.name)
        if present != self._shown:
            self._shown = present
            self._say(f"{present[0].name.lower()}, fault: {present[1].lower()}")

    def close(self) -> None:
        """Close the lines."""
        self._line.close()
        if self._switches is not None:
            self._switches.close()
