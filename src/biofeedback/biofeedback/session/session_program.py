"""The session: what the program asks of the subject now, and what it writes into `session/event`.

States: ``idle``, ``armed`` (the operator has allowed motion), ``running``, ``paused``,
``finished``. Arming is always a call of its own. The protocol's steps advance only while running; a
break is a pause that the protocol asks for. If a hold is interrupted, it is cancelled and its
approach phase starts again. The session has no clock of its own: every method receives ROS time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any

from ankle_node.session_event import HOLD_ENDED, HOLD_STARTED, TORQUE_TARGET, SessionEvent
from biofeedback.errors import CommandError
from biofeedback.session.axis_calibration import LEAST_ROWS, Baseline, BaselineCollector
from biofeedback.session.conditioning import Conditioning, course_protocol
from biofeedback.session.course_session import CourseSession
from biofeedback.session.hold_shares import HoldShares
from biofeedback.session.progress import Progress, progress_from
from biofeedback.session.protocol import (
    BASELINE,
    BREAK,
    CALIBRATION,
    HOLD,
    REACH,
    RIG_CALIBRATION,
    TRIALS,
    Protocol,
    Step,
)
from biofeedback.session.target import Reading, Target, planned_target

IDLE, ARMED, RUNNING, PAUSED, FINISHED = "idle", "armed", "running", "paused", "finished"
STATES = (IDLE, ARMED, RUNNING, PAUSED, FINISHED)
LONGEST_TICK = 1.0
"""[s] Longest step of the clock that counts: a longer one (this computer slept, a replay jumped) is
no time in which the subject did something."""


class Session:
    """Follows a protocol, and holds the state of its session.

    Parameters
    ----------
    protocol
        The protocol that the session follows.
    next_of_course
        Gives the next session of a conditioning course, whose steps then take the protocol's place.

    Attributes
    ----------
    conditioning
        Leads the trials of a conditioning course; None in a session with holds.
    state
        See the module.
    index
        Of the present step.
    elapsed
        Time in the present step [s]; of a baseline, time with valid estimates.
    clock
        Time since the start while running [s].
    baseline
        The relaxed subject, once it is known.
    hold_shares
        Of the present or last hold.
    holds_done, hits
        Completed holds, and how many of them were hits: see `HoldShares`.
    stop_reason
        Why the session was stopped last; empty before a stop and after the next start.
    """

    def __init__(
        self,
        protocol: Protocol | None = None,
        next_of_course: Callable[[], CourseSession] | None = None,
    ) -> None:
        self._next_of_course = next_of_course
        self.conditioning: Conditioning | None = None
        if next_of_course is not None:
            session = next_of_course()
            self.conditioning = Conditioning(session)
            protocol = course_protocol(session.course, session)
        if protocol is None:
            raise ValueError("a session needs a protocol or a course")
        self.protocol = protocol
        self.state = IDLE
        self.index = self._first_step()
        self.elapsed = 0.0
        self.clock = 0.0
        self.baseline: Baseline | None = None
        self.hold_shares = HoldShares()
        self.holds_done = 0
        self.hits = 0
        self.stop_reason = ""
        self._own: Target | None = None  # what the operator has set instead of the plan
        self._collector = BaselineCollector()
        self._last: float | None = None

    def _first_step(self) -> int:
        """Return the first step that is not done: a course's session may have trials already."""
        if self.conditioning is None:
            return 0
        return self.protocol.trials_from(self.conditioning.session.block)

    @property
    def step(self) -> Step:
        """Return the present step."""
        return self.protocol.steps[self.index]

    @property
    def holding(self) -> bool:
        """Tell whether the subject is in a hold."""
        return self.state == RUNNING and self.step.kind == HOLD

    @property
    def remaining(self) -> float:
        """Return the rest of the present step [s]."""
        return max(self.step.duration - self.elapsed, 0.0)

    @property
    def target(self) -> Target:
        """Return the present target: the protocol's, with what the operator has set instead."""
        return self._own or planned_target(
            self.step, self.protocol, self.baseline, self.conditioning
        )

    def tick(self, now: float, reading: Reading) -> list[SessionEvent]:
        """Advance to `now`; return what happened meanwhile.

        Parameters
        ----------
        now
            ROS time [s].
        reading
            The signals at this moment.
        """
        passed = 0.0 if self._last is None else now - self._last
        self._last = now
        if not 0.0 < passed <= LONGEST_TICK:
            return []
        kind = self.step.kind
        if self.state == RUNNING:
            self.clock += passed
        elif kind != BREAK:
            return []
        if kind != BASELINE or reading.valid:
            self.elapsed += passed
        if kind == TRIALS:
            return self._do_trials(now, reading)
        if kind in (BREAK, CALIBRATION, RIG_CALIBRATION):
            return []  # the operator starts again after a break; a calibration ends by `next`
        if kind == BASELINE and reading.valid:
            self._collector.add(reading.K, reading.G, reading.torque)
        if kind == HOLD:
            self.hold_shares.add(passed, reading.valid, self.target.reached(reading))
        too_early = kind == BASELINE and len(self._collector) < LEAST_ROWS
        return self._go_on(now) if self.elapsed >= self.step.duration and not too_early else []

    def _do_trials(self, now: float, reading: Reading) -> list[SessionEvent]:
        conditioning = self.conditioning
        assert conditioning is not None
        G = reading.G if reading.valid else math.nan
        events = conditioning.tick(now, reading.torque, reading.activity, reading.responses, G)
        trials = conditioning.session.trials
        judged = [trial.success for trial in trials if trial.success is not None]
        self.holds_done, self.hits = len(judged), sum(judged)
        if conditioning.failed:
            fault = SessionEvent("fault", now, {"node": "course", "message": conditioning.failed})
            return [*events, fault, *self.pause(now)]
        if conditioning.session.finished or conditioning.session.block > self.step.block:
            return [*events, *self._go_on(now)]
        return events

    def arm(self, now: float) -> list[SessionEvent]:
        """Allow the start.

        Raises
        ------
        CommandError
            Not from this state.
        """
        self._require(IDLE, PAUSED)
        self.state = ARMED
        return [SessionEvent("session armed", now)]

    def start(self, now: float) -> list[SessionEvent]:
        """Begin, or go on after a pause, a stop or a break.

        Raises
        ------
        CommandError
            Not armed.
        """
        if self.state != ARMED:
            raise CommandError(
                f"the session is {self.state}; arm it first"
                if self.state != RUNNING
                else "the session is running already"
            )
        self.state, self.stop_reason = RUNNING, ""
        started = SessionEvent(
            "session started", now, {"block": self.step.block, "protocol": self.protocol.title}
        )
        return [started, *self._enter(self.index + (self.step.kind == BREAK), now)]

    def pause(self, now: float) -> list[SessionEvent]:
        """Interrupt the session; the present hold is cancelled.

        Raises
        ------
        CommandError
            Not running.
        """
        self._require(RUNNING)
        return [*self._break_off(now, "paused", PAUSED), SessionEvent("session paused", now)]

    def stop(self, now: float, reason: str = "operator") -> list[SessionEvent]:
        """Stop from any state: no step continues and nothing is armed afterwards.

        Parameters
        ----------
        now
            ROS time [s].
        reason
            Who or what stopped it.
        """
        if self.state == FINISHED:
            return []
        self.stop_reason = reason
        return [
            *self._break_off(now, "stopped", IDLE),
            SessionEvent("session stopped", now, {"reason": reason}),
        ]

    def restart(self, now: float) -> list[SessionEvent]:
        """Forget progress and baseline, for the next subject.

        Raises
        ------
        CommandError
            Armed or running.
        """
        self._require(IDLE, PAUSED, FINISHED)
        last = self._last
        self.__init__(self.protocol, self._next_of_course)  # type: ignore[misc]
        self._last = last
        return [SessionEvent("session reset", now)]

    def next(self, now: float) -> list[SessionEvent]:
        """Leave the present step for the next one.

        Raises
        ------
        CommandError
            Not running, or the baseline has too few valid estimates yet.
        """
        self._require(RUNNING)
        if self.step.kind == TRIALS:
            raise CommandError("a block of trials ends with its last trial; pause or stop instead")
        return self._go_on(now, completed=self.step.kind != HOLD)

    def start_hold(self, now: float) -> list[SessionEvent]:
        """Begin the hold that the subject is on the way to.

        Raises
        ------
        CommandError
            The subject is on no such way.
        """
        self._require(RUNNING)
        if self.step.kind != REACH:
            raise CommandError(f"a hold begins from the way to it; this is the {self.step.kind}")
        return self._enter(self.index + 1, now)

    def end_hold(self, now: float) -> list[SessionEvent]:
        """Cancel the present hold; its approach phase starts again.

        Raises
        ------
        CommandError
            There is no hold.
        """
        if not self.holding:
            raise CommandError("there is no hold to end")
        events = self._break_off(now, "operator", RUNNING)
        return [*events, *self._enter(self.index, now)]

    def set_target(self, now: float, values: Mapping[str, Any]) -> list[SessionEvent]:
        """Replace parts of the present target until the next hold's.

        Parameters
        ----------
        now
            Time of the session [s].
        values
            New values for fields of `Target`.

        Raises
        ------
        CommandError
            A region whose lower end is not below the upper one.
        """
        if self.conditioning is not None:
            raise CommandError("the course sets the target, from the subject's own reflexes")
        self._own = self.target.changed(values)
        return [self._target_event(now)]

    def saved(self) -> dict[str, Any]:
        """Return what a restarted node needs to go on, ready for JSON."""
        where = (self.state, self.index, self.elapsed, self.clock)
        results = (self.baseline, self._own, self.holds_done, self.hits)
        return Progress(self.protocol.digest, *where, *results).content()

    def resume(self, saved: Mapping[str, Any], now: float) -> list[SessionEvent]:
        """Continue from what `saved` gave. A hold that was going on is cancelled, because nobody
        knows what the subject saw meanwhile.

        Raises
        ------
        CommandError
            It is of another protocol, or damaged.
        """
        progress = progress_from(saved, self.protocol, STATES)
        # What was done of a course is in its own record.
        self.index = progress.index if self.conditioning is None else self._first_step()
        # An armed rig does not stay armed for a program that was away: arming is an explicit call.
        self.state = PAUSED if progress.state == ARMED else progress.state
        self.elapsed, self.clock, self._last = progress.elapsed, progress.clock, now
        self.baseline, self._own = progress.baseline, progress.own
        self.holds_done, self.hits = progress.holds_done, progress.hits
        events = [SessionEvent("screen restarted", now, {"state": self.state})]
        if self.state == RUNNING and self.step.kind in (HOLD, BASELINE):
            events += self._break_off(now, "screen restarted", RUNNING)
            events += self._enter(self.index, now)
        return events

    def _require(self, *states: str) -> None:
        if self.state not in states:
            raise CommandError(
                f"not possible while the session is {self.state}; it must be {' or '.join(states)}"
            )

    def _go_on(self, now: float, completed: bool = True) -> list[SessionEvent]:
        events: list[SessionEvent] = []
        if self.step.kind == BASELINE:
            self.baseline = self._collector.baseline()
            events.append(SessionEvent("baseline measured", now, self.baseline.details()))
        elif self.step.kind == HOLD:
            events.append(self._hold_ended(now, completed))
        if self.index + 1 == len(self.protocol.steps):
            self.state = FINISHED
            return [*events, SessionEvent("session finished", now)]
        return [*events, *self._enter(self.index + 1, now)]

    def _enter(self, index: int, now: float) -> list[SessionEvent]:
        if self.protocol.steps[index].hold != self.step.hold:
            self._own = None
        self.index, self.elapsed = index, 0.0
        step = self.step
        if step.kind == BASELINE:
            self._collector = BaselineCollector()
            return [SessionEvent("baseline started", now)]
        if step.kind in (CALIBRATION, RIG_CALIBRATION):
            return [SessionEvent("calibration started", now)]
        if step.kind == BREAK:
            self.state = PAUSED
            return [SessionEvent("break started", now, {"after_block": step.block})]
        if step.kind == REACH:
            return [self._target_event(now)]
        if step.kind == TRIALS:
            return [SessionEvent("trials started", now, {"block": step.block})]
        self.hold_shares = HoldShares()
        return [self._target_event(now, HOLD_STARTED)]

    def _break_off(self, now: float, reason: str, state: str) -> list[SessionEvent]:
        """Leave `RUNNING` and what the step had gathered; a hold returns to its approach phase."""
        events = []
        if self.conditioning is not None:
            self.conditioning.interrupt()
        if self.holding:
            events.append(self._hold_ended(now, False, reason))
            self.index -= 1
        self.state = state
        if self.step.kind not in (BREAK, TRIALS):
            self.elapsed = 0.0
        return events

    def _hold_ended(self, now: float, completed: bool, reason: str = "skipped") -> SessionEvent:
        if completed:
            self.holds_done += 1
            self.hits += self.hold_shares.is_hit
        broken = {} if completed else {"broken_off": reason}
        target = {TORQUE_TARGET: self.target.torque}
        details = {"hold": self.step.hold, **target, **self.hold_shares.details(), **broken}
        return SessionEvent(HOLD_ENDED, now, details)

    def _target_event(self, now: float, name: str = "target changed") -> SessionEvent:
        return SessionEvent(name, now, {"hold": self.step.hold, **self.target.details()})
