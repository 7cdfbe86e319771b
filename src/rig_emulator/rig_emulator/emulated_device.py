"""The rig's real-time controller as docs/rig_protocol.md demands it, in virtual time: packets in,
plate motion and packets out.

It relies on no check of the driver: every rule is enforced here again. It has no clock and no
socket of its own; the caller says what time it is by the rig's clock.
"""

from __future__ import annotations

import math
from collections import Counter, deque
from dataclasses import dataclass
from typing import Protocol, Union

import numpy as np

from ankle_actuator_driver.link.protocol.packet import (
    Heartbeat,
    Reference,
    Refusal,
    StateReport,
    build,
    newer,
    parse,
)
from ankle_actuator_driver.safety.continuation import LONGEST_BUFFER
from ankle_actuator_driver.safety.encoder_check import EncoderCheck
from ankle_actuator_driver.safety.limits import Limits
from ankle_actuator_driver.safety.rig import (
    UNPOWERED,
    DeviceFault,
    DeviceState,
    Status,
    Wanted,
)
from ankle_actuator_driver.safety.stop_motion import StopMotion
from ankle_actuator_driver.safety.torque_check import TorqueCheck
from ankle_actuator_driver.safety.torque_yield import RIG_ADMITTANCE, TorqueYield
from ankle_actuator_driver.safety.watchdog import LOST_AFTER, Watchdog
from rig_emulator.command_check import command_passes_limit
from rig_emulator.faults import Faults
from rig_emulator.reference_playback import Empty, Motion, ReferencePlayback

CYCLE = 8
"""Number of servo samples for which the plant is simulated at once: 3.9 ms at 2048 Hz."""
SAMPLES_IN_PACKET = 32
STANDSTILL = 0.05
"""[s] Time for which the command stands still before the drive is off: a 30 Hz servo has come to
rest by then."""
START_PATIENCE = 0.5
"""[s] Longest time from the order to follow to the first reference; the plate is held meanwhile."""
MOST_SESSIONS = 4096
"""Largest number of earlier drivers' sessions that are remembered: what they said is not obeyed
again."""
LARGEST_FOLLOWING_ERROR = 0.08
"""[rad] Largest difference between command and measured position: a 30 Hz servo is 0.037 rad behind
at 5 rad/s; twice that is a broken drive."""


class Plant(Protocol):
    """Describes the interface to the plate with a foot on it."""

    def run(self, command: np.ndarray) -> np.ndarray:
        """Return measured position [rad], velocity [rad/s] and torque [N.m], shape (n, 3).

        They belong to further commands of shape (n, 3).
        """


@dataclass
class _Host:
    """Holds the driver that is obeyed."""

    session: int = 0
    sequence: int = 0
    resets: int = 0
    asked_off: bool = (
        False  # has asked for OFF since the rig was last powered: only then may it ask for HOLD
    )
    echo: int = 0
    echo_received: int = 0


class EmulatedDevice:
    """Emulates one controller.

    Parameters
    ----------
    plant
        The plate and the ankle that the device drives.
    limits
        The limits that the device enforces.
    rate
        Of servo and samples [Hz].
    session
        Number of this start, not 0.
    begin
        Rig's clock at the first servo sample [s].
    key
        Shared with the driver; empty for none.

    Attributes
    ----------
    state, fault, status
        As it reports them.
    refusals
        Packets refused, by reason.
    command
        Position, velocity, acceleration that the servo is given now.
    faults
        Switches; those of the controller count here.
    """

    def __init__(
        self,
        plant: Plant,
        limits: Limits,
        rate: float,
        session: int,
        begin: float,
        key: bytes = b"",
    ) -> None:
        self.state = DeviceState.OFF
        self.fault = DeviceFault.NONE
        self.status = Status(0)
        self.refusals: Counter[Refusal] = Counter()
        self.command: Motion = (0.0, 0.0, 0.0)
        self.faults = Faults()
        self._plant, self._limits, self._interval = plant, limits, 1.0 / rate
        self._session, self._sequence = session, 0
        self._begin, self._ticks, self._key = begin, 0, key
        self._host = _Host()
        self._retired: deque[int] = deque(maxlen=MOST_SESSIONS)
        self._heartbeats = Watchdog()
        self._referenced_until = -math.inf  # the rig's time until which a reference is not missed
        self._playback = ReferencePlayback()
        self._yield = TorqueYield(RIG_ADMITTANCE, limits.torque)
        self._encoder = EncoderCheck()
        self._last_step = 0.0  # of the command, in the last servo sample [rad]
        self._held = 0.0
        self._stop: StopMotion | None = None
        self._stop_began = 0.0
        self._after_stop = DeviceState.OFF
        self._torque = TorqueCheck()
        self._measured: list[np.ndarray] = []
        self._first = 0
        self._reported = (self.state, self.fault)

    @property
    def host(self) -> int:
        """Return the session of the driver that is obeyed; 0 for none."""
        return self._host.session

    def look(self, before: float, now: float) -> None:
        """Note when the line was looked at before and is looked at now, by the rig's clock [s].

        See `Watchdog.look`: the computer of an emulator may be put aside, a servo's is not.
        """
        self._heartbeats.look(before, now)

    def receive(self, data: bytes, now: float) -> Union[Heartbeat, Refusal]:
        """Process bytes from the line at a time of the rig's clock [s].

        The packet that is obeyed is returned, or the reason why there is none.
        """
        packet = self.read(data)
        if not isinstance(packet, Refusal):
            packet = self._obey(packet, now)
        if isinstance(packet, Refusal):
            self.refusals[packet] += 1
        return packet

    def read(self, data: bytes) -> Union[Heartbeat, Refusal]:
        """Return the driver's packet in some bytes, or why there is none."""
        packet = parse(data, self._key)
        return Refusal.DIRECTION if isinstance(packet, StateReport) else packet

    def _obey(self, packet: Heartbeat, now: float) -> Union[Heartbeat, Refusal]:
        if packet.rig not in (0, self._session):
            return Refusal.START
        host = self._host
        if packet.session != host.session:
            if self.state not in UNPOWERED or packet.session in self._retired:
                return Refusal.SESSION
            if not packet.rig:
                return packet  # a greeting: answered, and nothing more
            self._retired.append(host.session)
            host = self._host = _Host(packet.session, (packet.sequence - 1) % 2**32, packet.resets)
        if not newer(packet.sequence, host.sequence):
            return Refusal.OLD
        if isinstance(packet, Reference) and (reason := self._refuse_reference(packet, now)):
            return reason
        host.sequence = packet.sequence
        host.echo, host.echo_received = packet.sent, round(now * 1e9)
        self._heartbeats.feed(now)
        self._want(packet, now)
        if isinstance(packet, Reference) and self.state is DeviceState.FOLLOW:
            self._playback.add(1e-9 * packet.first, packet.interval, packet.motion)
            end = self._playback.end or now
            self._referenced_until = max(now, end) + LOST_AFTER
        return packet

    def _refuse_reference(self, packet: Reference, now: float) -> Refusal | None:
        first = 1e-9 * packet.first
        if not now < first + (len(packet.motion) - 1) * packet.interval < now + LONGEST_BUFFER:
            return Refusal.TIME
        before = self._playback.follows(first, packet.interval)
        if not self.faults.unchecked and self._limits.passed_by(
            packet.motion, packet.interval, before
        ):
            self._trip(DeviceFault.REFERENCE_BEYOND_LIMIT, now)
            return Refusal.LIMIT
        return None

    def _want(self, packet: Heartbeat, now: float) -> None:
        host = self._host
        if packet.resets != host.resets:
            host.resets = packet.resets
            if (
                self.state is DeviceState.FAULT
                and packet.wanted is Wanted.OFF
                and not self.status & Status.EMERGENCY_STOP_PRESSED
            ):
                self.state, self.fault = DeviceState.OFF, DeviceFault.NONE
        if packet.wanted is Wanted.OFF:
            if not self.faults.ignore_off:
                host.asked_off = True
                self._leave(DeviceState.OFF, now)
        elif packet.wanted is Wanted.HOLD:
            if self.state is DeviceState.OFF and host.asked_off:
                self.state = DeviceState.HOLD
                host.asked_off = False
                self._rest_here()
            elif self.state is DeviceState.FOLLOW:
                self._leave(DeviceState.HOLD, now)
        elif self.state is DeviceState.HOLD:
            self.state = DeviceState.FOLLOW
            self.status &= ~Status.REFERENCE_LOST
            self._rest_here()
            self._referenced_until = now + START_PATIENCE

    def press_emergency_stop(self, pressed: bool, now: float) -> None:
        """Press the button at the rig: a controlled stop, then off.

        This is stop category 1 of IEC 60204-1.
        """
        if not pressed:
            self.status &= ~Status.EMERGENCY_STOP_PRESSED
            return
        self.status |= Status.EMERGENCY_STOP_PRESSED
        self._trip(DeviceFault.EMERGENCY_STOP, now)

    def _trip(self, fault: DeviceFault, now: float) -> None:
        """Enter the fault: stop if the plate may move, then stay off until a reset."""
        if self.fault is DeviceFault.NONE:
            self.fault = fault
        if self.state is DeviceState.OFF:
            self.state = DeviceState.FAULT
        elif self.state is DeviceState.STOPPING:
            self._after_stop = DeviceState.FAULT
        else:
            self._leave(DeviceState.FAULT, now)

    def _leave(self, after: DeviceState, now: float) -> None:
        """Begin the stop that ends in another state."""
        if self.state in (DeviceState.HOLD, DeviceState.FOLLOW):
            position, velocity, _ = self.command
            self._stop = StopMotion.plan(
                position, velocity, self._limits.angle, self._limits.acceleration
            )
            self._stop_began = (
                self._begin + (self._ticks - 1) * self._interval
            )  # the time of the present command
            self._after_stop, self.state = after, DeviceState.STOPPING
        elif self.state is DeviceState.STOPPING and self._after_stop is DeviceState.HOLD:
            self._after_stop = after

    def _rest_here(self) -> None:
        self._held = self.command[0]
        self._yield.forget()
        self._playback.clear()
        self._encoder.forget()
        self._torque.forget()

    def advance(self, now: float) -> list[bytes]:
        """Run the servo up to a time of the rig's clock [s]; return the packets that leave."""
        leaving = []
        while self._begin + (self._ticks + CYCLE - 1) * self._interval <= now:
            self._cycle()
            full = sum(len(part) for part in self._measured) >= SAMPLES_IN_PACKET
            if full or (self.state, self.fault) != self._reported:
                leaving.append(build(self._report(now), self._key))
        return leaving

    def _cycle(self) -> None:
        commands = np.empty((CYCLE, 3))
        for row in commands:
            before = self.command[0]
            row[:] = self.command = self._servo(self._begin + self._ticks * self._interval)
            self._last_step = self.command[0] - before
            self._ticks += 1
        samples = self._plant.run(commands)
        self._measured.append(samples)
        self._look(samples, self._begin + (self._ticks - 1) * self._interval)

    def _servo(self, now: float) -> Motion:
        """Return the command of one servo sample."""
        self._watch(now)
        if self.state is DeviceState.STOPPING:
            return self._stopping(now)
        if self.state not in (DeviceState.HOLD, DeviceState.FOLLOW):
            return self.command[0], 0.0, 0.0
        target: Union[Motion, Empty] = (self._held, 0.0, 0.0)
        if self.state is DeviceState.FOLLOW and not self.faults.ignore_reference:
            bridged = self._playback.bridged
            found = self._playback.at(now)
            if self._playback.bridged != bridged:
                self.status |= Status.REFERENCE_BRIDGED
            target = target if found is Empty.BEFORE else found
        if isinstance(target, Empty):
            self._lose_reference(now)
            return self._stopping(now)
        offset = self._yield.step(self._interval)
        motion = (target[0] + offset[0], target[1] + offset[1], target[2] + offset[2])
        step = motion[0] - self.command[0]
        if not self.faults.unchecked and command_passes_limit(
            motion, step, self._last_step, self._interval, self._limits
        ):
            self._trip(DeviceFault.MOTION_BEYOND_LIMIT, now)
            return self._stopping(now)
        return motion

    def _watch(self, now: float) -> None:
        if self.state not in UNPOWERED and self._heartbeats.expired(now):
            self._trip(DeviceFault.HEARTBEAT_LOST, now)
        if self.state is DeviceState.FOLLOW and now > self._referenced_until:
            self._lose_reference(now)

    def _lose_reference(self, now: float) -> None:
        self.status |= Status.REFERENCE_LOST
        self._leave(DeviceState.OFF, now)

    def _stopping(self, now: float) -> Motion:
        assert self._stop is not None
        passed = now - self._stop_began
        motion = self._stop.at(passed)
        if passed > self._stop.duration + STANDSTILL:
            self.state = self._after_stop
            self._host.asked_off &= self.state is DeviceState.OFF
            self._rest_here()
        return motion

    def _look(self, samples: np.ndarray, now: float) -> None:
        """Judge what the sensors say of a powered plate."""
        torque = float(samples[-1, 2])
        powered = self.state in (DeviceState.HOLD, DeviceState.FOLLOW)
        powered = powered and not self.faults.unchecked
        self._yield.measure(torque if powered else 0.0)
        self.status = (
            self.status | Status.YIELDING if self._yield.excess else self.status & ~Status.YIELDING
        )
        if not powered:
            return
        time = now - self._interval * np.arange(len(samples))[::-1]
        if self._torque.passed(time, samples[:, 2], self._limits.torque):
            self._trip(DeviceFault.TORQUE, now)
        if self._encoder.stuck(now, self.command[0], float(samples[-1, 0])):
            self._trip(DeviceFault.ENCODER, now)
        if abs(samples[-1, 0] - self.command[0]) > LARGEST_FOLLOWING_ERROR:
            self._trip(DeviceFault.FOLLOWING_ERROR, now)

    def _report(self, now: float) -> StateReport:
        samples = np.concatenate(self._measured) if self._measured else np.empty((0, 3))
        if self.faults.no_samples:
            samples = samples[:0]
        first = self._begin + (self._ticks - len(samples)) * self._interval
        self._measured = []
        self._sequence = (self._sequence + 1) % 2**32
        self._reported = (self.state, self.fault)
        host = self._host
        report = StateReport(
            session=self._session,
            sequence=self._sequence,
            sent=round(now * 1e9),
            state=self.state,
            fault=self.fault,
            status=self.status,
            heard=host.sequence,
            host=host.session,
            refused=sum(self.refusals.values()) % 2**32,
            echo=host.echo,
            echo_received=host.echo_received,
            first=round(first * 1e9),
            interval=self._interval,
            commanded=self.command[0],
            samples=samples,
        )
        self.status &= ~Status.REFERENCE_BRIDGED
        return report
