"""The driver without ROS and sockets: references and commands in, packets out; packets in, samples
out. In anybody's time.

Two clocks come in with every call: `now` runs steadily and decides what is late, `ros` dates
samples. What the bridge has to say waits in `outgoing` (packets), `samples` (blocks), `notes`
(sentences) and `states.changes` until the caller takes it.
"""

from __future__ import annotations

import math
from collections import Counter

import numpy as np

from ankle_actuator_driver.link.device_clock import DeviceClock
from ankle_actuator_driver.link.packet import (
    LARGEST_COUNT,
    Heartbeat,
    Reference,
    Refusal,
    StateReport,
    build,
    newer,
    parse,
)
from ankle_actuator_driver.safety.encoder_check import EncoderCheck
from ankle_actuator_driver.safety.limits import Limits
from ankle_actuator_driver.safety.reference_playback import LONGEST_BUFFER
from ankle_actuator_driver.safety.soft_start import blend
from ankle_actuator_driver.safety.states import Answer, SafetyStates, State
from ankle_actuator_driver.safety.torque_yield import OF_DRIVER, TorqueYield
from ankle_actuator_driver.safety.watchdog import HEARTBEAT_PERIOD, LOST_AFTER, Watchdog
from ankle_interfaces.continuity import STEP_TOLERANCE

IN_PACKET = 32
"""Reference samples in a packet: one block of 2048 Hz at 64 Hz."""
assert IN_PACKET <= LARGEST_COUNT
CLOCK_STEP = 0.02
"""[s] A change of ROS time against the steady clock that is no slewing: NTP slews 20 ms in 40 s at
the fastest.
"""
TORQUE_PATIENCE = 0.5
"""[s] For which the torque may stay beyond its limit while the plate yields; the rig's own patience
is shorter.
"""
BEYOND_ANGLE = 0.02
"""[rad] How far the measured position may pass the angle limit: overshoot of the servo (5 %) and
noise.
"""


class Bridge:
    """One driver.

    Parameters
    ----------
    limits
        That references keep.
    soft_start
        Duration of the start [s].
    reference_delay
        How much later than its time a reference is followed [s].
    session
        Number of this start, not 0.

    Attributes
    ----------
    limits, soft_start
        May be changed at any time; the latter counts from the next start on.
    states
        The state machine; commands go through `command`.
    clock
        The rig's clock.
    outgoing
        Packets to send.
    samples
        Blocks to publish: t [s], position [rad], velocity [rad/s], torque [N.m], shape (n, 4).
    notes
        Sentences that a person should know.
    refusals
        Packets from the rig that were refused, by reason.
    missing
        Samples lost on the way from the rig.
    undated
        Samples that came while the rig's clock was not known.
    unused
        Reference samples that came while nothing followed them.
    """

    def __init__(
        self, limits: Limits, soft_start: float, reference_delay: float, session: int
    ) -> None:
        self.limits, self.soft_start = limits, soft_start
        self.states = SafetyStates()
        self.clock = DeviceClock()
        self.outgoing: list[bytes] = []
        self.samples: list[np.ndarray] = []
        self.notes: list[str] = []
        self.refusals: Counter[Refusal] = Counter()
        self.missing = 0
        self.undated = 0
        self.unused = 0
        self._delay, self._session, self._sequence = reference_delay, session, 0
        self._report: StateReport | None = None
        self._rig, self._references = Watchdog(), Watchdog()
        self._next_heartbeat = -math.inf
        self._ros_offset: float | None = None
        self._next_first: float | None = (
            None  # the rig's time at which the next sample from it is due [s]
        )
        self._next_time = 0.0
        self._yield = TorqueYield(OF_DRIVER, limits.torque)
        self._torque_since: float | None = None
        self._encoder = EncoderCheck()
        # Of the reference that is followed: where it began, and the last sample sent.
        self._held, self._began, self._ramp, self._last = 0.0, 0.0, soft_start, (0.0, 0.0)

    def command(self, name: str, now: float, ros: float) -> Answer:
        """Carry out ``arm``, ``start``, ``stop``, ``disarm`` or ``reset_fault``; the rig is told at
        once.
        """
        answer: Answer = getattr(self.states, name)(now)
        if answer.done and self.states.state is State.RUNNING:
            self._begin(now)
        self._beat(now, ros)
        return answer

    def _begin(self, now: float) -> None:
        assert self._report is not None
        self._references.feed(now)
        self._yield.forget()
        self._encoder.forget()
        self._torque_since = None
        self._held, self._began, self._ramp = self._report.commanded, math.nan, self.soft_start
        self._last = (math.nan, self._held)

    def advance(self, now: float, ros: float) -> None:
        """Let time pass: watchdogs and heartbeats. To be called every few milliseconds."""
        self._follow_ros_clock(now, ros)
        before = self.states.wanted
        if self._rig.expired(now) and self._report is not None:
            self.states.lost(f"nothing valid came from the rig for {1e3 * LOST_AFTER:.0f} ms", now)
        if self.states.state is State.RUNNING and self._references.expired(now):
            self.states.stop(now, f"no valid reference for {1e3 * LOST_AFTER:.0f} ms")
            self.notes.append(self.states.reason)
        if now >= self._next_heartbeat or self.states.wanted is not before:
            self._beat(now, ros)

    def _follow_ros_clock(self, now: float, ros: float) -> None:
        offset = ros - now
        if self._ros_offset is not None and abs(offset - self._ros_offset) > CLOCK_STEP:
            sentence = f"ROS time was set by {offset - self._ros_offset:+.3f} s"
            self.notes.append(sentence)
            self.clock.restart()
            self._next_first = None
            self.states.lost(sentence, now)
        self._ros_offset = offset

    def _next_sequence(self) -> int:
        self._sequence = (self._sequence + 1) % 2**32
        return self._sequence

    @property
    def _heard(self) -> int:
        return self._report.sequence if self._report is not None else 0

    def _beat(self, now: float, ros: float) -> None:
        self._next_heartbeat = now + HEARTBEAT_PERIOD
        packet = Heartbeat(
            self._session,
            self._next_sequence(),
            round(ros * 1e9),
            self.states.wanted,
            self.states.resets,
            self._heard,
        )
        self.outgoing.append(build(packet))

    def reference(self, time: np.ndarray, motion: np.ndarray, now: float, ros: float) -> None:
        """Take in a stretch of reference.

        Parameters
        ----------
        time
            ROS times [s], shape (n,).
        motion
            Position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 3).
        """
        if self.states.state is not State.RUNNING or not len(time):
            self.unused += len(time)
            return
        time = time + self._delay
        interval = self._spacing(time)
        if not (np.isfinite(time).all() and np.isfinite(motion).all()) or interval is None:
            self.notes.append(
                "a block of the reference that is not finite or not evenly spaced is not followed"
            )
            return
        ahead = float(time[-1]) - ros
        if not 0.0 < ahead < LONGEST_BUFFER:
            early = (
                f"is {1e3 * -ahead:.0f} ms late"
                if ahead <= 0
                else f"is {ahead:.3g} s ahead of its time"
            )
            self.notes.append(
                f"a block of the reference {early} and is not followed; see "
                "perturbation_generator.lead and reference_delay"
            )
            return
        if math.isnan(self._began):
            self._began = float(time[0])
        shaped = blend(motion, np.maximum(time - self._began, 0.0), self._ramp, self._held)
        shaped = shaped + self._yield.stretch(len(time), interval)
        at, position = self._last
        contiguous = (
            math.isnan(at) or abs(float(time[0]) - at - interval) < STEP_TOLERANCE * interval
        )
        passed = self.limits.passed_by(shaped, interval, position if contiguous else None)
        if passed:
            self.states.trip(f"reference refused: {passed}", now)
            self._beat(now, ros)
            return
        self._last = (float(time[-1]), float(shaped[-1, 0]))
        self._references.feed(now)
        self._send(time, shaped, ros)

    def _spacing(self, time: np.ndarray) -> float | None:
        """The interval between samples [s]; None where they are not evenly spaced, or one sample
        does not tell.
        """
        if len(time) < 2:
            return None
        steps = np.diff(time)
        interval = float(time[-1] - time[0]) / len(steps)
        return (
            interval
            if interval > 0 and np.abs(steps - interval).max() < STEP_TOLERANCE * interval
            else None
        )

    def _send(self, time: np.ndarray, motion: np.ndarray, ros: float) -> None:
        first, end = self.clock.to_device(float(time[0])), self.clock.to_device(float(time[-1]))
        interval = (end - first) / (len(time) - 1)
        for k in range(0, len(time), IN_PACKET):
            packet = Reference(
                self._session,
                self._next_sequence(),
                round(ros * 1e9),
                self.states.wanted,
                self.states.resets,
                self._heard,
                round((first + k * interval) * 1e9),
                interval,
                motion[k : k + IN_PACKET],
            )
            self.outgoing.append(build(packet))

    def take(self, data: bytes, now: float, ros: float) -> None:
        """Take in bytes from the line."""
        packet = parse(data)
        if isinstance(packet, Heartbeat):
            packet = Refusal.DIRECTION
        if isinstance(packet, StateReport):
            last = self._report
            if last is not None and packet.session != last.session:
                if not self._rig.expired(now):
                    packet = Refusal.SESSION
                else:
                    self._new_rig(now)
            elif last is not None and not newer(packet.sequence, last.sequence):
                packet = Refusal.OLD
        if isinstance(packet, Refusal):
            self.refusals[packet] += 1
            return
        self._rig.feed(now)
        ours = packet.host == self._session
        echo = 1e-9 * packet.echo if ours else math.nan
        note = self.clock.exchange(1e-9 * packet.sent, ros, echo, 1e-9 * packet.echo_received)
        if note:
            self.notes.append(note)
            self._next_first = None
            self.states.lost(note, now)
        before = self.states.wanted
        self.states.heard(packet, self.clock.ready, ours, now)
        self._report = packet
        self._give_out(packet)
        self._look(packet, now)
        if self.states.wanted is not before:
            self._beat(now, ros)

    def _new_rig(self, now: float) -> None:
        self.notes.append("the rig has started anew")
        self.clock.restart()
        self._report, self._next_first = None, None
        self.states.lost("the rig has started anew", now)

    def _give_out(self, report: StateReport) -> None:
        """Publish the samples of a packet in ROS time."""
        count = len(report.samples)
        if not count or not self.clock.ready:
            self.undated += count
            return
        first = 1e-9 * report.first
        if self._next_first is not None:
            lost = round((first - self._next_first) / report.interval)
            if lost < 0:
                self.refusals[Refusal.TIME] += 1
                return
            if lost:
                self.missing += lost
                self.notes.append(
                    f"{lost} samples ({lost * report.interval:.3f} s) from the rig were lost on "
                    "the way"
                )
        self._next_first = first + count * report.interval
        start, end = self.clock.to_ros(first), self.clock.to_ros(self._next_first)
        time = start + (end - start) * np.arange(count) / count
        self.samples.append(np.column_stack([time, report.samples]))

    def _look(self, report: StateReport, now: float) -> None:
        """What the sensors say of a powered plate, seen from here."""
        powered = self.states.state in (State.ARMED, State.RUNNING)
        if not powered or not len(report.samples):
            self._yield.measure(0.0)
            return
        position, torque = float(report.samples[-1, 0]), float(report.samples[:, 2].mean())
        self._yield.limit = self.limits.torque
        self._yield.measure(torque)
        if not self._yield.excess:
            self._torque_since = None
        elif self._torque_since is None:
            self._torque_since = now
        elif now - self._torque_since > TORQUE_PATIENCE:
            self.states.trip(
                f"torque of {torque:.3g} N.m stays beyond the limit of {self.limits.torque:g} N.m",
                now,
            )
        if abs(position) > self.limits.angle + BEYOND_ANGLE:
            self.states.trip(
                f"measured position of {position:.3g} rad passes the limit of "
                f"{self.limits.angle:g} rad",
                now,
            )
        if self._encoder.stuck(1e-9 * report.first, report.commanded, position):
            self.states.trip(
                "the measured position does not move though the plate was told to: encoder stuck",
                now,
            )

    def take_outgoing(self) -> list[bytes]:
        """The packets to send, which are then forgotten here."""
        packets, self.outgoing = self.outgoing, []
        return packets

    @property
    def report(self) -> StateReport | None:
        """The newest packet from the rig."""
        return self._report
