"""Driver, line and emulated rig of the fault campaign: references that are tampered with, strangers
on the line, an operator and a commanding thread that can fall silent.
"""

from __future__ import annotations

import copy

import numpy as np
from virtual_laboratory import BLOCK, EPOCH, RATE, STEP, SpringPlant, VirtualLaboratory

from ankle_actuator_driver.link.protocol.driver_end import DriverEnd
from ankle_actuator_driver.safety.rig import UNPOWERED, Order, Wanted
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings
from rig_emulator.emulated_device import EmulatedDevice

SIGNS_OF_LIFE = 50  # steps of virtual time between two signs of life of operator and commands
MOST_RECORDED = 400  # packets each way that an eavesdropper keeps
REST = 1e-3  # rad/s; of a plate that rests
NOISE = 5.0  # s of pseudo-random bytes


class Campaign(VirtualLaboratory):
    """A laboratory whose reference, line and clocks can be tampered with.

    Attributes
    ----------
    tampering
        What happens to blocks of the reference: ``doubled``, ``lost``, ``reordered``, ``delayed``,
        ``cut`` (their first samples are missing), ``not finite``, ``slow`` (of a clock that is
        slow by 1 %), ``beyond`` (the angle limit), ``second generator`` (its blocks as well),
        ``second generator in step`` (at the same times).
    delay_of_blocks
        Of ``delayed`` [s].
    reference_shift
        Of the generator's clock [s].
    operator, commands
        Whether they are there (None where nobody ever was).
    sources
        Who publishes the reference, as the commanding thread sees it.
    strangers
        Called at each step of time.
    seen
        States of the rig since the set was emptied.
    moved
        Last time at which servo or plate moved [s].
    """

    def __init__(self) -> None:
        super().__init__(lead=0.5)
        self.tampering, self.delay_of_blocks = "", 0.0
        self.reference_shift, self.bridge_number = 0.0, 4711
        self.operator: bool | None = None
        self.commands_come: bool | None = None
        self.sources = ["/perturbation_generator"]
        self.strangers = []
        self.seen = set()
        self.moved = 0.0
        self.to_rig, self.to_driver = [], []
        self._kept, self._delayed = (), []
        self._second = PulseStep(Settings(rate=RATE, seed=9))
        self._steps = 0

    def _step(self) -> None:
        self._steps += 1
        if not self._steps % SIGNS_OF_LIFE:
            if self.operator:
                self.bridge.operator_alive(self.now)
            if self.commands_come:
                self.bridge.reference_sources(self.sources, self.now)
        super()._step()
        for stranger in self.strangers:
            stranger(self)
        self.seen.add(self.device.state)
        speed = abs(self.plant.velocity[-1]) if len(self.plant.velocity) else 0.0
        if self.device.command[1] or speed > REST:
            self.moved = self.now

    def take(self, data: bytes) -> None:
        """Bytes that come to the driver, kept for whoever repeats them later."""
        self.to_driver = [*self.to_driver[1 - MOST_RECORDED :], data]
        super().take(data)

    def deliver(self, data: bytes) -> object:
        """Bytes that come to the rig, kept for whoever repeats them later."""
        self.to_rig = [*self.to_rig[1 - MOST_RECORDED :], data]
        return super().deliver(data)

    def _refer(self) -> None:
        while self._count * BLOCK / RATE < self.now + self.lead:
            time = EPOCH + self.reference_shift + (self._count * BLOCK + np.arange(BLOCK)) / RATE
            motion = self.signal.next(BLOCK)
            self._count += 1
            for block in self._tampered(time, motion) if self.sending else ():
                self._delayed.append((self.now, block))
        held = self.delay_of_blocks if self.tampering == "delayed" else 0.0
        while self._delayed and self._delayed[0][0] + held <= self.now:
            _, block = self._delayed.pop(0)
            self.bridge.reference(*block, self.now, self.ros)

    def _tampered(self, time: np.ndarray, motion: np.ndarray) -> tuple:
        second = self._second.next(BLOCK)
        kind, block = self.tampering, (time, motion)
        if kind == "lost" and not self._count % 20:
            return ()
        if kind == "reordered":
            kept, self._kept = self._kept, () if self._kept else (block,)
            return (block, *kept) if kept else ()
        if kind == "not finite":
            motion[BLOCK // 2, 0] = np.nan
        return {
            "doubled": (block, block),
            "cut": ((time[3:], motion[3:]),),
            "slow": ((time[0] + 1.01 * (time - time[0]), motion),),
            "beyond": ((time, motion + np.array([0.2, 0.0, 0.0])),),
            "second generator": (block, (time + 0.4 * BLOCK / RATE, second)),
            "second generator in step": (block, (time, second)),
        }.get(kind, (block,))

    def eavesdropper(self) -> None:
        """Let somebody repeat what was said on the line until now, one packet at each step."""
        to_rig, to_driver = list(self.to_rig), list(self.to_driver)

        def repeat(lab: Campaign) -> None:
            VirtualLaboratory.deliver(lab, to_rig[lab._steps % len(to_rig)])
            VirtualLaboratory.take(lab, to_driver[lab._steps % len(to_driver)])

        self.strangers.append(repeat)

    def another_driver(self, wanted: Wanted) -> None:
        """Let another driver want something of the same rig."""
        end = DriverEnd(999)

        def speak(lab: Campaign) -> None:
            end.take(lab.to_driver[-1], lab.now, lab.ros)
            if not lab._steps % 10:
                for data in end.packets(Order(wanted, 0), lab.now, lab.ros):
                    lab.device.receive(data, lab.rig_time)

        self.strangers.append(speak)

    def another_rig(self) -> None:
        """Let the reports of another rig come to the driver."""
        other = EmulatedDevice(SpringPlant(), self.limits, RATE, 78, self.rig_time)

        def speak(lab: Campaign) -> None:
            for data in other.advance(lab.rig_time):
                VirtualLaboratory.take(lab, data)

        self.strangers.append(speak)

    def noise(self, seed: int) -> None:
        """Let any bytes come to both ends."""
        random = np.random.default_rng(seed)
        lines = [random.bytes(int(random.integers(1, 1400))) for _ in range(int(NOISE / STEP))]

        def speak(lab: Campaign) -> None:
            data = lines[lab._steps % len(lines)]
            VirtualLaboratory.deliver(lab, data)
            VirtualLaboratory.take(lab, data)

        self.strangers.append(speak)

    @property
    def powered(self) -> bool:
        """Whether the rig's drive has power."""
        return self.device.state not in UNPOWERED

    def copied(self) -> Campaign:
        """Return this laboratory at this moment, without what was recorded before."""
        lab = copy.deepcopy(self)
        lab.device.commands, lab.device.velocities = lab.device.commands[-1:], []
        lab.stretches, lab.sent, lab.packets = [], [], []
        lab.blocks = lab.blocks[-1:]
        return lab


def at_each_moment() -> dict[str, Campaign]:
    """Return laboratories in which the drive is off, held and running; the others follow."""
    ready = Campaign().until("ready").run(0.3)
    armed = ready.copied().armed()
    running = armed.copied()
    assert running.command("start").done
    return {"ready": ready, "armed": armed, "running": running.run(2.0)}


def at_moment(name: str, prepared: dict[str, Campaign], random: np.random.Generator) -> Campaign:
    """Return a laboratory at a random moment of a kind.

    Parameters
    ----------
    name
        ``ready``, ``arming``, ``armed``, ``starting``, ``running``, ``stopping`` or ``fault``.
    prepared
        As `at_each_moment` returns them.
    random
        Of the moment.
    """
    origin = {"arming": "ready", "starting": "armed"}.get(name, name)
    lab = prepared[origin if origin in prepared else "running"].copied()
    if lab.state == "running":
        lab.run(float(random.uniform(0.0, 0.6))).until_moving(0.2)
    else:
        lab.run(float(random.uniform(0.0, 0.05)))
    if name in ("arming", "starting"):
        assert lab.command("arm" if name == "arming" else "start").done
        lab.run(float(random.uniform(0.0, 0.03)))
    if name == "stopping":
        lab.command("stop")
        lab.run(float(random.uniform(0.0, 0.01)))
    if name == "fault":
        lab.bridge.states.trip("a fault from before", lab.now)
        lab.run(0.5)
    lab.seen.clear()
    return lab
