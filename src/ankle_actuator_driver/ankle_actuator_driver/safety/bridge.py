"""The driver without ROS, packets and sockets: references and commands in, orders out; reports of
the rig in, samples out. It has no clock of its own.

Two clocks come in with every call: `now` runs steadily and decides what is late, `ros` dates
samples. What the bridge has to say waits in `orders`, `samples` (blocks), `notes` (sentences) and
`states.changes` until the caller takes it.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ankle_actuator_driver.safety.continuation import Verdict
from ankle_actuator_driver.safety.limits import Limits
from ankle_actuator_driver.safety.path_check import PathCheck
from ankle_actuator_driver.safety.reference_path import ReferencePath
from ankle_actuator_driver.safety.reference_sources import START_PATIENCE, ReferenceSources
from ankle_actuator_driver.safety.rig import (
    DeviceState,
    Event,
    Interruption,
    Order,
    Purpose,
    Remark,
    RigReport,
)
from ankle_actuator_driver.safety.sensor_supervision import Expectations, SensorSupervision
from ankle_actuator_driver.safety.states import Answer, SafetyStates, State
from ankle_actuator_driver.safety.torque_yield import DRIVER_ADMITTANCE, TorqueYield
from ankle_actuator_driver.safety.watchdog import HEARTBEAT_PERIOD, LOST_AFTER, Watchdog

CLOCK_STEP = 0.02
"""[s] A change of ROS time against the steady clock that is no slewing: NTP slews 20 ms in 40 s at
the fastest.
"""
ANGLE_MARGIN = 0.02
"""[rad] Angle by which the measured position may pass the angle limit: overshoot of the servo (5 %)
and noise."""
STOP_LEAD_TIME = 0.01
"""[s] Time before the end of what was sent at which the plate is stopped: the stop shall reach the
rig before it has nothing to follow."""
COMMANDS_TIMEOUT = 1.0
"""[s] Time for which the thread that takes commands may be silent while the drive is on: it shows
itself every 0.1 s, and a stop that waits longer than this is none."""
USUAL_OPERATOR_TIMEOUT = 2.0
"""[s] The default of the time for which the operator's page may stay away: twenty of its messages,
longer than a page needs to reload, and no longer than an operator takes to look up."""


class Bridge:
    """Holds the safety logic of one driver.

    Parameters
    ----------
    limits
        The limits that every reference must keep.
    soft_start
        Duration of the start [s].
    reference_delay
        How much later than its time a reference is followed [s].
    fault
        A fault that is still to be reset from before; empty for none.

    Attributes
    ----------
    soft_start, operator_timeout
        May be changed at any time; the soft start counts from the next start on.
    limits
        Changed by `change_limits`.
    states
        The state machine; commands go through `command`.
    sensors
        What watches the sensors.
    orders
        To be sent, see `take_orders`.
    samples
        Blocks to publish: t [s], position [rad], velocity [rad/s], torque [N.m], shape (n, 4).
    notes
        Sentences for the operator.
    unused
        Reference samples that came while nothing followed them.
    left_out
        Blocks of the reference that were not followed.
    """

    def __init__(
        self, limits: Limits, soft_start: float, reference_delay: float, fault: str = ""
    ) -> None:
        self.limits, self.soft_start = limits, soft_start
        self.operator_timeout = USUAL_OPERATOR_TIMEOUT
        self.states = SafetyStates(fault)
        self.sensors = SensorSupervision()
        self.orders: list[Order] = []
        self.samples: list[np.ndarray] = []
        self.notes: list[str] = []
        self.unused = 0
        self.left_out = 0
        self._delay = reference_delay
        self._report: RigReport | None = None
        self._rig, self._samples_came = Watchdog(), Watchdog()
        self._listened = -math.inf
        self._next_heartbeat = -math.inf
        self._ros_offset: float | None = None
        self._yield = TorqueYield(DRIVER_ADMITTANCE, limits.torque)
        self._operator: float | None = None  # when the operator's page was heard in this arming
        self._sources = ReferenceSources()
        self._commands_heard: float | None = None  # when the thread that takes them showed itself
        self._path, self._path_check = ReferencePath(self._yield), PathCheck()
        self._started = -math.inf

    @property
    def report(self) -> RigReport | None:
        """Return the newest report of the rig."""
        return self._report

    @property
    def expectations(self) -> Expectations:
        """Return what the sensors are checked against; it may be set at any time."""
        return self.sensors.expectations

    @expectations.setter
    def expectations(self, expectations: Expectations) -> None:
        self.sensors.expectations = expectations

    def change_limits(self, limits: Limits, now: float, ros: float) -> None:
        """Change the limits; a plate that is on its way beyond a new one is stopped.

        Parameters
        ----------
        limits
            That references keep from now on.
        now
            Time of the driver [s].
        ros
            ROS time [s] at `now`.
        """
        self.limits = limits
        if self.states.state is not State.RUNNING:
            return
        ahead = self._path.to_come(ros)
        if len(ahead) and (passed := limits.stated_by(ahead)):
            reason = f"the limits were changed; of what was sent before, {passed}"
            self.states.stop(now, reason)
            self.notes.append(reason)
            self._order(now, Purpose.STOP)

    # Commands

    def command(self, name: str, now: float, ros: float) -> Answer:
        """Carry out ``arm``, ``start``, ``stop``, ``disarm`` or ``reset_fault`` at once."""
        if name in ("arm", "start") and self._sources.several:
            return Answer(False, f"{name} is refused: {self._sources.conflict()}")
        if name == "start" and self.states.state is State.ARMED and self._sources.silent(now):
            return Answer(False, f"start is refused: {self._sources.silence()}")
        answer: Answer = getattr(self.states, name)(now)
        if answer.done and name == "arm":
            self._operator = None
            self.sensors.forget_joint()
        if answer.done and name == "start":
            self._begin(now)
        self._order(now, Purpose.STOP if name in ("stop", "disarm") else Purpose.HEARTBEAT)
        return answer

    def _begin(self, now: float) -> None:
        assert self._report is not None
        self._started = now
        self._yield.forget()
        self.sensors.forget()
        self._path.begin(self._report.commanded, self.soft_start)
        self._path_check.begin()

    def operator_alive(self, now: float) -> None:
        """Note that the operator's page is connected and watched."""
        if self.states.state in (State.ARMED, State.RUNNING):
            self._operator = now

    def reference_sources(
        self, names: Sequence[str], now: float, readers: Sequence[str] = ()
    ) -> None:
        """Note who publishes the reference; it is a sign of life of the thread that takes commands.

        More than one publisher is a fault while the rig is powered, and refused before. Once this
        was called, it has to be called again and again while the drive is on: a driver that no
        longer takes commands stops the plate.

        Parameters
        ----------
        names
            Full names of the publishing nodes.
        now
            Time of the driver [s].
        readers
            Full names of the nodes that read the reference.
        """
        self._commands_heard = now
        self._sources.note(names, readers)
        if self._sources.several and self.states.state in (State.ARMED, State.RUNNING):
            self.states.trip(self._sources.conflict(), now)
            self._order(now, Purpose.STOP)

    # Time

    def advance(self, now: float, ros: float) -> bool:
        """Let time pass for watchdogs and heartbeats.

        Whoever hears the rig calls this every few milliseconds.

        Returns
        -------
        bool
            Whether ROS time was set, so that the mapping of the rig's clock has to begin again.
        """
        for watchdog in (self._rig, self._samples_came):
            watchdog.look(self._listened, now)
        self._listened = now
        was_set = self._follow_ros_clock(now, ros)
        before = self.states.wanted
        if self._report is not None and self._rig.expired(now):
            self.states.lost(f"nothing valid came from the rig for {1e3 * LOST_AFTER:.0f} ms", now)
        state = self.states.state
        if state is State.RUNNING:
            self._watch_reference(now, ros)
        if state in (State.ARMED, State.RUNNING):
            self._watch_operator(now)
            self._watch_commands(now)
            if self._samples_came.expired(now):
                self.states.trip(
                    f"the rig sent no samples for {1e3 * LOST_AFTER:.0f} ms though it is heard", now
                )
        if now >= self._next_heartbeat or self.states.wanted is not before:
            self._order(now, Purpose.HEARTBEAT)
        return was_set

    def _watch_reference(self, now: float, ros: float) -> None:
        end = self._path.end
        if math.isnan(end):
            lost = now - self._started > START_PATIENCE
            reason = f"no valid reference came within {START_PATIENCE:g} s of the start"
        else:
            lost = ros > end - STOP_LEAD_TIME
            reason = "no further reference came in time: what was sent is over"
        if lost:
            self.states.stop(now, reason)
            self.notes.append(reason)

    def _watch_operator(self, now: float) -> None:
        if self._operator is not None and now - self._operator > self.operator_timeout:
            reason = f"the operator's page was not heard for {self.operator_timeout:g} s"
            self.states.stop(now, reason)
            self.notes.append(reason)

    def _watch_commands(self, now: float) -> None:
        if self._commands_heard is not None and now - self._commands_heard > COMMANDS_TIMEOUT:
            reason = f"this driver took no commands for {COMMANDS_TIMEOUT:g} s: no stop would act"
            self.states.stop(now, reason)
            self.notes.append(reason)

    def _follow_ros_clock(self, now: float, ros: float) -> bool:
        offset = ros - now
        was_set = self._ros_offset is not None and abs(offset - self._ros_offset) > CLOCK_STEP
        if was_set:
            sentence = f"ROS time was set by {offset - (self._ros_offset or 0.0):+.3f} s"
            self.notes.append(sentence)
            self.states.lost(sentence, now, silent=False)
        self._ros_offset = offset
        return was_set

    # Orders

    def _order(self, now: float, purpose: Purpose) -> None:
        self._next_heartbeat = now + HEARTBEAT_PERIOD
        if not self.states.silent:
            self.orders.append(Order(self.states.wanted, self.states.resets, purpose))

    def take_orders(self, now: float) -> list[Order]:
        """Return the orders to send, and forget them here.

        A driver that no longer hears the rig sends nothing but a stop: what it would say is not
        founded on anything. References wait; those that are overtaken by a stop are dropped.
        """
        if any(order.purpose is Purpose.STOP for order in self.orders):
            self.orders = [order for order in self.orders if order.purpose is Purpose.STOP]
        elif now - self._listened > LOST_AFTER:
            self.orders = [order for order in self.orders if order.stretch is not None]
            return []
        if self.states.state is not State.RUNNING:
            self.orders = [order for order in self.orders if order.stretch is None]
        orders, self.orders = self.orders, []
        return orders

    def reference(self, time: np.ndarray, motion: np.ndarray, now: float, ros: float) -> None:
        """Take in a stretch of reference.

        Parameters
        ----------
        time
            ROS times [s], shape (n,).
        motion
            Position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 3).
        now
            Time of the driver [s].
        ros
            ROS time [s] at `now`.
        """
        if len(time):
            self._sources.came(now)
        if self.states.state is not State.RUNNING or not len(time):
            self.unused += len(time)
            return
        decision, stretch = self._path.follow(time + self._delay, motion, self.limits, ros)
        if stretch is not None:
            self._next_heartbeat = now + HEARTBEAT_PERIOD
            states = self.states
            self.orders.append(Order(states.wanted, states.resets, Purpose.REFERENCE, stretch))
        elif decision.verdict is Verdict.LEFT_OUT:
            self.left_out += 1
            self.notes.append(f"reference: {decision.sentence}")
        elif decision.verdict is Verdict.STOPS:
            self.states.stop(now, decision.sentence)
            self.notes.append(decision.sentence)
            self._order(now, Purpose.STOP)
        else:
            self.states.trip(decision.sentence, now)
            self._order(now, Purpose.STOP)

    # Reports

    def take(self, event: Event, now: float) -> None:
        """Take in what the link gives; `now` [s] is when it came."""
        if isinstance(event, Remark):
            self.notes.append(event.sentence)
        elif isinstance(event, Interruption):
            self.notes.append(event.sentence)
            self.states.lost(event.sentence, now)
        else:
            self._take_report(event, now)

    def _take_report(self, report: RigReport, now: float) -> None:
        self._rig.feed(now)
        before, confirmed = self.states.wanted, self.states.confirmed
        self.states.heard(report, now)
        self._report = report
        if self.states.confirmed and not confirmed and self.states.state is State.ARMED:
            self._path.hold(report.commanded)
        powered = self.states.state in (State.ARMED, State.RUNNING)
        if report.received or not powered:
            self._samples_came.feed(now)
        if len(report.time):
            self.samples.append(np.column_stack([report.time, report.samples]))
        self._supervise(report, now)
        if self.states.wanted is not before:
            self._order(now, Purpose.HEARTBEAT)

    def _supervise(self, report: RigReport, now: float) -> None:
        """Judge from here what the rig and its sensors say of a powered plate."""
        self._path_check.note(report.status, now)
        settled = (
            self.states.state in (State.ARMED, State.RUNNING)
            and self.states.confirmed
            and report.state in (DeviceState.HOLD, DeviceState.FOLLOW)
        )
        if not settled or not len(report.time):
            self._yield.measure(0.0)
            if not settled:
                self.sensors.forget()
            return
        self._yield.limit = self.limits.torque
        self._yield.measure(float(report.samples[:, 2].mean()))
        sent = self._path.positions(report.time)
        elsewhere = report.commanded - float(sent[-1])
        fault = self._path_check.fault(elsewhere, now) or self._beyond_angle(report)
        fault = fault or self.sensors.fault(
            report.time, sent + elsewhere, report.samples, self.limits.torque
        )
        if fault:
            self.states.trip(fault, now)

    def _beyond_angle(self, report: RigReport) -> str | None:
        position = float(report.samples[-1, 0])
        if abs(position) > self.limits.angle + ANGLE_MARGIN:
            return (
                f"measured position of {position:.3g} rad passes the limit of "
                f"{self.limits.angle:g} rad"
            )
        return None
