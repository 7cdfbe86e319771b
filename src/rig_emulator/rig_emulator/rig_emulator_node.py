"""The other end of the line as a process of its own: the simulated ankle behind the protocol, with
its own clock and faults.

    rig_emulator --ros-args -p port:=20480 -p clock_drift:=5e-5 -p K:=80.0 -p faults:=drop=0.01

Knows no ROS; takes its parameters as every other executable does (`rig_emulator.settings`). At the
next port it takes fault switches while it runs (`rig_emulator.faults`), one datagram of text each,
and answers with the switches that are on, or with what was wrong.
"""

from __future__ import annotations

import secrets
import signal
import sys
import threading
import time
from collections.abc import Sequence

from ankle_actuator_driver.link.packet import DeviceState, Heartbeat, parse
from ankle_actuator_driver.link.transport import UdpTransport
from ankle_actuator_driver.safety.limits import limits_from
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Value
from ankle_sim.live_rig import Setup
from rig_emulator.emulated_ankle import EmulatedAnkle
from rig_emulator.emulated_device import EmulatedDevice
from rig_emulator.faults import Faults
from rig_emulator.faulty_line import FaultyLine
from rig_emulator.settings import settings_from

POLL = 0.002
"""[s] Half a servo cycle."""


class RigEmulator:
    """Paces an `EmulatedDevice` by its own clock and gives it a line and switches.

    Parameters
    ----------
    values
        Parameters by name.
    setup
        Rig and joint.
    """

    def __init__(self, values: dict[str, Value], setup: Setup) -> None:
        address, port = str(values["address"]), int(values["port"])
        faults = Faults().with_switches(str(values["faults"]))
        self._line = UdpTransport((address, port), None)
        self._switches = UdpTransport((address, port + 1), None)
        self._drift, self._offset = float(values["clock_drift"]), float(values["clock_offset"])
        self._ankle = EmulatedAnkle(setup, float(values["rate"]), bool(values["noise"]), _say)
        self._started = time.monotonic()
        session = secrets.randbelow(2**32 - 1) + 1
        self._device = EmulatedDevice(
            self._ankle, limits_from(values), float(values["rate"]), session, self.clock()
        )
        seed = int(values["seed"])
        self._down, self._up = FaultyLine(seed), FaultyLine(seed + 1)
        self._shown: tuple[DeviceState, str] | None = None
        self._switch(faults)

    def clock(self) -> float:
        """The rig's clock [s]."""
        return self._offset + (time.monotonic() - self._started) * (1.0 + self._drift)

    def run(self, told_to_stop: threading.Event) -> None:
        """Work until told to stop."""
        while not told_to_stop.is_set():
            for data in self._line.receive(POLL):
                self._answer_to(data)
                self._down.send(data, self.clock())
            now = self.clock()
            for data in self._down.due(now):
                self._device.receive(data, now)
            for data in self._device.advance(now):
                self._up.send(data, now)
            for data in self._up.due(now):
                self._line.send(data)
            for text in self._switches.receive(0.0):
                self._take_switches(text)
            self._show()
        self._line.close()
        self._switches.close()

    def _answer_to(self, data: bytes) -> None:
        """A driver is answered that is obeyed, or that could be."""
        packet = parse(data)
        free = self._device.state in (DeviceState.OFF, DeviceState.FAULT)
        if isinstance(packet, Heartbeat) and (free or packet.session == self._device.host):
            self._line.answer()

    def _take_switches(self, text: bytes) -> None:
        try:
            faults = self._ankle.faults.with_switches(text.decode(errors="replace"))
        except QuantityError as error:
            answer = f"error: {error}"
        else:
            self._switch(faults)
            answer = faults.line()
        self._switches.answer()
        self._switches.send(answer.encode())

    def _switch(self, faults: Faults) -> None:
        if faults.emergency_stop != self._ankle.faults.emergency_stop:
            self._device.press_emergency_stop(bool(faults.emergency_stop), self.clock())
        self._ankle.faults = self._down.faults = self._up.faults = faults
        _say(f"fault switches: {faults.line()}")

    def _show(self) -> None:
        present = (self._device.state, self._device.fault.name)
        if present != self._shown:
            self._shown = present
            _say(f"{present[0].name.lower()}, fault: {present[1].lower()}")


def _say(sentence: str) -> None:
    print(f"rig_emulator: {sentence}", flush=True)


def main(arguments: Sequence[str] | None = None) -> int:
    """Run until SIGINT or SIGTERM; errors that a user can act on are one line and exit code 1."""
    told_to_stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: told_to_stop.set())
    try:
        values, setup = settings_from(sys.argv[1:] if arguments is None else arguments)
        _say("preparing (compiles the simulation at the first start, about 20 s)")
        emulator = RigEmulator(values, setup)
        _say(f"listening at UDP {values['address']}:{values['port']}")
        emulator.run(told_to_stop)
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return 1
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
