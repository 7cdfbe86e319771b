"""The states of the driver: what may follow what, who may ask for it, and what the rig is ordered
meanwhile.

    disabled --rig heard, its clock known--> ready --arm--> armed --start--> running
    armed, running --stop, disarm, reference lost--> stopping --rig is off--> ready
    ready --the rig obeys another driver--> disabled
    any state --fault--> fault (through stopping, while the plate may move)
    fault --reset_fault--> disabled

A pure state machine: it receives the time [s] of any steady clock and has no clock of its own.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from ankle_actuator_driver.safety.rig import (
    UNPOWERED,
    DeviceFault,
    DeviceState,
    RigReport,
    Status,
    Wanted,
)

CONFIRMATION = 0.5
"""[s] Time within which the rig has to do what it was ordered to do. Its stop takes 0.25 s at most;
the rest is for packets lost on the way."""


class State(Enum):
    """Names the state of the driver."""

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
    """Holds the answer to an operator's command.

    Attributes
    ----------
    done
        Whether it was carried out.
    sentence
        What was done, or why not.
    """

    done: bool
    sentence: str


class SafetyStates:
    """Follows the operator's commands and the rig from state to state.

    Parameters
    ----------
    fault
        A fault that is still to be reset from before; empty for none.

    Attributes
    ----------
    state
        Now.
    reason
        Why it is so, in words; empty where nothing needs a reason.
    confirmed
        Whether the rig does what an armed or running driver wants.
    silent
        Whether the rig gets no heartbeats because it does not switch off: its own watchdog is to
        stop it.
    resets
        Number of fault resets, modulo 256, which is sent to the rig.
    changes
        Every (state, reason) entered since the caller last emptied the list.
    """

    def __init__(self, fault: str = "") -> None:
        self.state = State.FAULT if fault else State.DISABLED
        self.reason = fault or "no rig was heard yet"
        self.confirmed = False
        self.silent = False
        self.resets = 0
        self.changes: list[tuple[State, str]] = []
        self._since = 0.0
        self._fault = ""  # what `stopping` ends in: a fault, or `ready` where empty
        self._cause: str | None = None  # of a fault that is still there
        self._powered_since: float | None = None  # the rig, though it should be off

    @property
    def wanted(self) -> Wanted:
        """Return what the rig is ordered to do."""
        return _WANTED.get(self.state, Wanted.OFF)

    def _enter(self, state: State, now: float, reason: str = "") -> None:
        if (state, reason) != (self.state, self.reason):
            self.changes.append((state, reason))
        self.state, self.reason, self._since, self.confirmed = state, reason, now, False

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
        """Let the plate follow the reference.

        This is allowed from `armed` only, once the rig has confirmed that it holds.
        """
        if self.state is not State.ARMED:
            return self._refuse("start")
        if not self.confirmed:
            return Answer(
                False,
                "start is refused: the rig has not confirmed yet that it holds the plate; try "
                "again",
            )
        self._enter(State.RUNNING, now)
        return Answer(True, "running: the plate follows the reference")

    def stop(self, now: float, reason: str = "stopped by the operator") -> Answer:
        """Bring the plate to rest and switch the drive off; from any state, never refused."""
        if self.state in (State.ARMED, State.RUNNING):
            self._fault = ""
            self._enter(State.STOPPING, now, reason)
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
        """Enter `fault`: the plate is brought to rest, and only a reset leads on."""
        if self.state in (State.ARMED, State.RUNNING):
            self._fault = fault
            self._enter(State.STOPPING, now, fault)
        elif self.state is State.STOPPING:
            self._fault = self._fault or fault
        elif self.state is not State.FAULT:
            self._enter(State.FAULT, now, fault)

    def lost(self, what: str, now: float, silent: bool = True) -> None:
        """Note that the rig is not heard (`silent`), or that its clock is not known any more."""
        self._cause = f"{what}; a fault is reset when the rig is heard" if silent else None
        if self.state is State.READY:
            self._enter(State.DISABLED, now, what)
        elif self.state is State.DISABLED:
            self.reason = what
        else:
            self.trip(what, now)
            if self.state is State.STOPPING and now - self._since > CONFIRMATION:
                self._enter(State.FAULT, now, self._fault)

    def heard(self, report: RigReport, now: float) -> None:
        """Take in what the rig says, at a time [s]."""
        self._cause = None
        if report.status & Status.EMERGENCY_STOP_PRESSED:
            self._cause = "the rig's emergency stop is pressed"
        if self.state is State.READY and not report.obeys:
            self._enter(State.DISABLED, now)
        if self.state is State.DISABLED:
            self._enable(report, now)
        elif report.fault is not DeviceFault.NONE and self.state is not State.FAULT:
            self.trip(f"the rig reports {describe(report.fault)}", now)
        if self.state is State.STOPPING:
            self._await_off(report, now)
        elif self.state in (State.ARMED, State.RUNNING):
            self._compare(report, now)
        self._watch_power(report, now)

    def _enable(self, report: RigReport, now: float) -> None:
        if report.fault is not DeviceFault.NONE:
            # A fault that began before this driver, or that the last reset has not reached yet.
            if now - self._since > CONFIRMATION:
                self._enter(State.FAULT, now, f"the rig reports {describe(report.fault)}")
        elif not report.obeys:
            self.reason = (
                "the rig does not obey this driver (yet); where another driver has taken it since, "
                "that one has to end first"
            )
        elif not report.clock_ready:
            self.reason = "the rig's clock is being measured"
        elif report.state is DeviceState.OFF:
            self._enter(State.READY, now)

    def _await_off(self, report: RigReport, now: float) -> None:
        """Leave `stopping` once the rig says that it is off, having heard that it should be."""
        off = report.state is DeviceState.FAULT or (
            report.state is DeviceState.OFF and (report.answered or not report.obeys)
        )
        if off and self._fault:
            self._enter(State.FAULT, now, self._fault)
        elif off:
            self._enter(State.READY, now, self.reason)
        elif now - self._since > CONFIRMATION:
            self._enter(State.FAULT, now, self._fault or "the rig did not confirm that it stopped")

    def _compare(self, report: RigReport, now: float) -> None:
        """Check that an armed or running rig does what it was ordered to do."""
        if not report.obeys:
            self.trip("the rig obeys another driver", now)
        elif report.state is _ANSWER[self.wanted]:
            self.confirmed = True
        elif (
            self.state is State.RUNNING and self.confirmed and report.status & Status.REFERENCE_LOST
        ):
            self.stop(now, "the rig got no reference in time")
        elif self.confirmed or now - self._since > CONFIRMATION:
            self.trip(
                f"the rig is {report.state.name.lower()} where it should "
                f"{self.wanted.name.lower()}",
                now,
            )

    def _watch_power(self, report: RigReport, now: float) -> None:
        """Withhold heartbeats from a rig that is powered though it should be off."""
        if self.wanted is not Wanted.OFF or report.state in UNPOWERED or not report.obeys:
            self._powered_since = None
            self.silent = False
            return
        if self._powered_since is None:
            self._powered_since = now
        if now - self._powered_since > CONFIRMATION:
            self.silent = True
            self.trip(
                f"the rig is {report.state.name.lower()} though it was commanded to switch off; it "
                "gets no heartbeats any more",
                now,
            )


def describe(fault: DeviceFault) -> str:
    """Return a fault of the rig in words."""
    return fault.name.lower().replace("_", " ")
