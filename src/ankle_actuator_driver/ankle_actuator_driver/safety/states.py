"""The states of the driver: what may follow what, who may ask for it, and what the rig is told
meanwhile.

    disabled --link up--> ready --arm--> armed --start--> running
    ready <--disarm, stop-- armed        running --stop, reference lost--> stopping --standstill-->
    ready any state --fault--> fault (through stopping, when the plate may move)     fault
    --reset_fault--> disabled

A pure state machine: it is told the time [s] of any steadily running clock and has none of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ankle_actuator_driver.link.packet import DeviceFault, DeviceState, StateReport, Status, Wanted

CONFIRMATION = 0.5
"""[s] Within which the rig has to do what it was told. Its stop takes 0.25 s at most; the rest is
for packets lost on the way.
"""


class State(Enum):
    """Of the driver."""

    DISABLED = "disabled"
    READY = "ready"
    ARMED = "armed"
    RUNNING = "running"
    STOPPING = "stopping"
    FAULT = "fault"


POWERED = (State.ARMED, State.RUNNING, State.STOPPING)
_WANTED = {State.ARMED: Wanted.HOLD, State.RUNNING: Wanted.FOLLOW}
_ANSWER = {Wanted.HOLD: DeviceState.HOLD, Wanted.FOLLOW: DeviceState.FOLLOW}


@dataclass(frozen=True)
class Answer:
    """To an operator's command: whether it was carried out, and a sentence."""

    done: bool
    sentence: str


class SafetyStates:
    """Follows commands and the rig.

    Attributes
    ----------
    state
        Now.
    reason
        Why it is so, in words; empty where nothing needs a reason.
    resets
        Number of fault resets, modulo 256, which the rig is told.
    changes
        Every (state, reason) entered since the caller last emptied the list.
    """

    def __init__(self) -> None:
        self.state = State.DISABLED
        self.reason = "no rig was heard yet"
        self.resets = 0
        self.changes: list[tuple[State, str]] = []
        self._since = 0.0
        self._confirmed = False
        self._fault = ""  # what `stopping` ends in: a fault, or `ready` where empty
        self._cause: str | None = None  # of a fault that is still there

    @property
    def wanted(self) -> Wanted:
        """What the rig is told to do."""
        return _WANTED.get(self.state, Wanted.OFF)

    def _enter(self, state: State, now: float, reason: str = "") -> None:
        if (state, reason) != (self.state, self.reason):
            self.changes.append((state, reason))
        self.state, self.reason, self._since, self._confirmed = state, reason, now, False

    def _refuse(self, command: str) -> Answer:
        why = f" ({self.reason})" if self.reason else ""
        return Answer(False, f"{command} is refused: the driver is {self.state.value}{why}")

    def arm(self, now: float) -> Answer:
        """Let the drive hold the plate; from `ready` only."""
        if self.state is not State.READY:
            return self._refuse("arm")
        self._enter(State.ARMED, now)
        return Answer(True, "armed: the drive holds the plate")

    def start(self, now: float) -> Answer:
        """Let the plate follow the reference; from `armed` only, once the rig has confirmed that it
        holds.
        """
        if self.state is not State.ARMED:
            return self._refuse("start")
        if not self._confirmed:
            return Answer(
                False,
                "start is refused: the rig has not confirmed yet that it holds the plate; try "
                "again",
            )
        self._enter(State.RUNNING, now)
        return Answer(True, "running: the plate follows the reference")

    def stop(self, now: float, reason: str = "stopped by the operator") -> Answer:
        """Bring the plate to rest and switch the drive off; from any state, never refused."""
        if self.state is State.RUNNING:
            self._fault = ""
            self._enter(State.STOPPING, now, reason)
        elif self.state is State.ARMED:
            self._enter(State.READY, now, reason)
        return Answer(True, f"stop: the driver is {self.state.value}")

    def disarm(self, now: float) -> Answer:
        """Switch the drive off; a running rig is stopped first."""
        return self.stop(now, "disarmed by the operator")

    def reset_fault(self, now: float) -> Answer:
        """Leave `fault`; refused while the cause is still there."""
        if self.state is not State.FAULT:
            return self._refuse("reset_fault")
        if self._cause is not None:
            return Answer(False, f"reset_fault is refused: {self._cause}")
        self.resets = (self.resets + 1) % 256
        self._enter(State.DISABLED, now, "the fault was reset")
        return Answer(True, "reset; the driver is ready again once the rig confirms it")

    def trip(self, fault: str, now: float) -> None:
        """Something that must not be: the plate is brought to rest, and only a reset leads on."""
        if self.state in (State.ARMED, State.RUNNING):
            self._fault = fault
            self._enter(State.STOPPING, now, fault)
        elif self.state is State.STOPPING:
            self._fault = self._fault or fault
        elif self.state is not State.FAULT:
            self._enter(State.FAULT, now, fault)

    def lost(self, what: str, now: float) -> None:
        """The rig is not heard, or its clock is not known any more."""
        self._cause = None
        if self.state is State.READY:
            self._enter(State.DISABLED, now, what)
        elif self.state is State.DISABLED:
            self.reason = what
        else:
            self.trip(what, now)
            if self.state is State.STOPPING and now - self._since > CONFIRMATION:
                self._enter(State.FAULT, now, self._fault)

    def heard(self, report: StateReport, clock_ready: bool, ours: bool, now: float) -> None:
        """Take in what the rig says.

        Parameters
        ----------
        report
            Its packet.
        clock_ready
            Whether the rig's time can be told in ROS time.
        ours
            Whether the rig obeys this driver.
        now
            [s].
        """
        self._cause = None
        if report.status & Status.EMERGENCY_STOP_PRESSED:
            self._cause = "the rig's emergency stop is pressed"
        if self.state is State.DISABLED:
            self._enable(report, clock_ready, ours, now)
        elif report.fault is not DeviceFault.NONE and self.state is not State.FAULT:
            self.trip(f"the rig reports {describe(report.fault)}", now)
        if self.state is State.STOPPING:
            if report.state in (DeviceState.OFF, DeviceState.FAULT):
                self._enter(State.FAULT, now, self._fault) if self._fault else self._enter(
                    State.READY, now, self.reason
                )
            elif now - self._since > CONFIRMATION:
                self._enter(
                    State.FAULT, now, self._fault or "the rig did not confirm that it stopped"
                )
        elif self.state in (State.ARMED, State.RUNNING):
            self._compare(report, ours, now)

    def _enable(self, report: StateReport, clock_ready: bool, ours: bool, now: float) -> None:
        if report.fault is not DeviceFault.NONE:
            # A fault that began before this driver, or that the last reset has not reached yet.
            if now - self._since > CONFIRMATION:
                self._enter(State.FAULT, now, f"the rig reports {describe(report.fault)}")
        elif not ours:
            self.reason = "the rig does not obey this driver (yet)"
        elif not clock_ready:
            self.reason = "the rig's clock is being measured"
        elif report.state is DeviceState.OFF:
            self._enter(State.READY, now)

    def _compare(self, report: StateReport, ours: bool, now: float) -> None:
        """Whether an armed or running rig does what it was told."""
        if not ours:
            self.trip("the rig obeys another driver", now)
        elif report.state is _ANSWER[self.wanted]:
            self._confirmed = True
        elif (
            self.state is State.RUNNING
            and self._confirmed
            and report.status & Status.REFERENCE_LOST
        ):
            self.stop(now, "the rig got no reference in time")
        elif self._confirmed or now - self._since > CONFIRMATION:
            self.trip(
                f"the rig is {report.state.name.lower()} where it should "
                f"{self.wanted.name.lower()}",
                now,
            )


def describe(fault: DeviceFault) -> str:
    """A fault of the rig in words."""
    return fault.name.lower().replace("_", " ")
