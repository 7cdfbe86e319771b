"""The session: what the program asks of the subject now, and what it writes into `session/event`.

States: ``idle``, ``armed`` (the operator has allowed motion), ``running``, ``paused``,
``finished``. Arming is always a call of its own. The protocol's steps advance only while running; a
break is a pause that the protocol asks for. If a hold is interrupted, it is cancelled and its
approach phase starts again. The session has no clock of its own: every method receives ROS time.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass, replace
from typing import Any

from ankle_node.session_event import HOLD_ENDED, HOLD_STARTED, TORQUE_TARGET, SessionEvent
from biofeedback.errors import CommandError
from biofeedback.session.axis_calibration import LEAST_ROWS, Baseline, BaselineCollector
from biofeedback.session.conditioning import Conditioning, Response, course_protocol
from biofeedback.session.course_session import CourseSession
from biofeedback.session.protocol import (
    BASELINE,
    BREAK,
    CALIBRATION,
    HOLD,
    REACH,
    TRIALS,
    UNITS,
    Protocol,
    Step,
)

IDLE, ARMED, RUNNING, PAUSED, FINISHED = "idle", "armed", "running", "paused", "finished"
LONGEST_TICK = 1.0
"""[s] Longest step of the clock that counts: a longer one (this computer slept, a replay jumped) is
no time in which the subject did something."""
HIT_SHARE = 0.5
"""Least share of a hold with the cursor in the target that makes it a hit: by chance alone a target
of 0.3 baselines on an axis of 2.2 is met for a seventh of the time."""


@dataclass(frozen=True)
class Reading:
    """Holds the values that the screen shows at one moment.

    Attributes
    ----------
    K, G
        Newest estimates [N.m/rad], [N.m.s/rad].
    torque
        The subject's torque [N.m] beside the baseline's.
    valid
        Whether the estimates are valid and no older than the screen allows.
    activity
        Of the muscle of a conditioning course [MVC].
    responses
        To perturbations, since the reading before.
    """

    K: float
    G: float
    torque: float
    valid: bool
    activity: float = math.nan
    responses: tuple[Response, ...] = ()


@dataclass(frozen=True)
class Target:
    """Describes the place where the cursor is wanted.

    Attributes
    ----------
    feedback
        ``K`` or ``G``, on the x-axis; ``reflex`` in a conditioning course of the EMG reflex.
    torque
        [N.m], y-axis.
    torque_half_width
        Of the band about it [N.m].
    lower, upper
        Region of the feedback in its unit; None where there is none.
    """

    feedback: str
    torque: float
    torque_half_width: float
    lower: float | None
    upper: float | None

    def reached(self, reading: Reading) -> bool:
        """Return whether a reading lies in band and region."""
        value = reading.K if self.feedback == "K" else reading.G
        within = self.lower is None or self.upper is None or self.lower <= value <= self.upper
        return (
            reading.valid and within and abs(reading.torque - self.torque) <= self.torque_half_width
        )


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
    hold_share
        Of the present or last hold, share of the time with valid estimates, and share within the
        target.
    holds_done, hits
        Completed holds, and how many of them were in the target for at least `HIT_SHARE`.
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
        self.hold_share = (math.nan, math.nan)
        self.holds_done = 0
        self.hits = 0
        self.stop_reason = ""
        self._own: dict[str, Any] = {}
        self._collector = BaselineCollector()
        self._hold_time = [0.0, 0.0, 0.0]
        self._last: float | None = None

    def _first_step(self) -> int:
        """Return the first step that is not done: a course's session may have trials already."""
        if self.conditioning is None:
            return 0
        block = self.conditioning.session.block
        return next(
            (
                index
                for index, step in enumerate(self.protocol.steps)
                if step.kind == TRIALS and step.block >= block
            ),
            len(self.protocol.steps) - 1,
        )

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
        step = self.step
        lower = upper = None
        if self.conditioning is not None:
            lower, upper = self.conditioning.region() or (None, None)
        if step.level is not None and self.baseline is not None:
            unit = self.baseline.of(step.feedback)
            lower, upper = (
                max((step.level + sign * self.protocol.level_half_width) * unit, 0.0)
                for sign in (-1, 1)
            )
        target = Target(
            step.feedback, step.torque_target, self.protocol.torque_half_width, lower, upper
        )
        if self._own.get("feedback", step.feedback) != step.feedback:
            target = replace(target, lower=None, upper=None)
        return replace(target, **self._own)

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
        if self.step.kind == BREAK:
            self.elapsed += passed
            return []
        if self.state != RUNNING:
            return []
        self.clock += passed
        if self.step.kind == TRIALS:
            self.elapsed += passed
            return self._do_trials(now, reading)
        if self.step.kind == CALIBRATION:
            self.elapsed += passed
            return []  # ends with the calibration, by `next`
        if self.step.kind == BASELINE:
            if reading.valid:
                self.elapsed += passed
                self._collector.add(reading.K, reading.G, reading.torque)
        else:
            self.elapsed += passed
        if self.step.kind == HOLD:
            self._hold_time[0] += passed
            self._hold_time[1] += passed * reading.valid
            self._hold_time[2] += passed * self.target.reached(reading)
            self.hold_share = (
                self._hold_time[1] / self._hold_time[0],
                self._hold_time[2] / self._hold_time[0],
            )
        too_early = self.step.kind == BASELINE and len(self._collector) < LEAST_ROWS
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
        if self.step.kind == BREAK:
            return [started, *self._enter(self.index + 1, now)]
        return [started, *self._enter(self.index, now)]

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
        wanted = replace(self.target, **values)
        if self.conditioning is not None:
            raise CommandError("the course sets the target, from the subject's own reflexes")
        if wanted.feedback != self.target.feedback and not {"lower", "upper"} & set(values):
            wanted = replace(wanted, lower=None, upper=None)
        if (wanted.lower is None) != (wanted.upper is None):
            raise CommandError("a region needs both ends")
        if (
            wanted.lower is not None
            and wanted.upper is not None
            and not wanted.lower < wanted.upper
        ):
            raise CommandError(
                f"the region's lower end {wanted.lower:g} is not below its upper end "
                f"{wanted.upper:g}"
            )
        self._own = asdict(wanted)
        return [self._target_event(now)]

    def saved(self) -> dict[str, Any]:
        """Return what a restarted node needs to go on, ready for JSON."""
        return {
            "protocol": self.protocol.digest,
            "state": self.state,
            "index": self.index,
            "elapsed": self.elapsed,
            "clock": self.clock,
            "baseline": None if self.baseline is None else asdict(self.baseline),
            "own": self._own,
            "holds_done": self.holds_done,
            "hits": self.hits,
        }

    def resume(self, saved: Mapping[str, Any], now: float) -> list[SessionEvent]:
        """Continue from what `saved` gave. A hold that was going on is cancelled, because nobody
        knows what the subject saw meanwhile.

        Raises
        ------
        CommandError
            It is of another protocol, or damaged.
        """
        if saved.get("protocol") != self.protocol.digest:
            raise CommandError("the saved session followed another protocol")
        try:
            state, index = str(saved["state"]), int(saved["index"])
            elapsed, clock = float(saved["elapsed"]), float(saved["clock"])
            baseline = (
                None
                if saved["baseline"] is None
                else Baseline(**{key: float(value) for key, value in saved["baseline"].items()})
            )
            own = dict(saved["own"])
            holds_done, hits = int(saved.get("holds_done", 0)), int(saved.get("hits", 0))
            if not 0 <= hits <= holds_done:
                raise ValueError(f"{hits} hits of {holds_done} holds")
            replace(Target("K", 0.0, 0.0, None, None), **own)
            if state not in (IDLE, ARMED, RUNNING, PAUSED, FINISHED) or not 0 <= index < len(
                self.protocol.steps
            ):
                raise ValueError(f"state {state}, step {index}")
        except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
            raise CommandError(f"the saved session is damaged: {error}") from None
        if self.conditioning is not None:
            index = self._first_step()  # what was done is in the course's own record
        # An armed rig does not stay armed for a program that was away: arming is an explicit call.
        self.state, self.index, self.elapsed, self.clock = (
            (PAUSED if state == ARMED else state),
            index,
            elapsed,
            clock,
        )
        self.baseline, self._own, self._last = baseline, own, now
        self.holds_done, self.hits = holds_done, hits
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
            details = {
                f"{symbol}[{UNITS[symbol]}]": round(self.baseline.of(symbol), 4) for symbol in UNITS
            }
            events.append(
                SessionEvent(
                    "baseline measured",
                    now,
                    {**details, "torque[N.m]": round(self.baseline.torque, 4)},
                )
            )
        elif self.step.kind == HOLD:
            events.append(self._hold_ended(now, completed))
        if self.index + 1 == len(self.protocol.steps):
            self.state = FINISHED
            return [*events, SessionEvent("session finished", now)]
        return [*events, *self._enter(self.index + 1, now)]

    def _enter(self, index: int, now: float) -> list[SessionEvent]:
        if self.protocol.steps[index].hold != self.step.hold:
            self._own = {}
        self.index, self.elapsed = index, 0.0
        step = self.step
        if step.kind == BASELINE:
            self._collector = BaselineCollector()
            return [SessionEvent("baseline started", now)]
        if step.kind == CALIBRATION:
            return [SessionEvent("calibration started", now)]
        if step.kind == BREAK:
            self.state = PAUSED
            return [SessionEvent("break started", now, {"after_block": step.block})]
        if step.kind == REACH:
            return [self._target_event(now)]
        if step.kind == TRIALS:
            return [SessionEvent("trials started", now, {"block": step.block})]
        self._hold_time = [0.0, 0.0, 0.0]
        return [SessionEvent(HOLD_STARTED, now, {"hold": step.hold, **self._target_details()})]

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
        shares = {
            f"{name}[%]": round(100.0 * share, 1)
            for name, share in zip(("valid", "in_target"), self.hold_share, strict=True)
        }
        shares = {name: share for name, share in shares.items() if math.isfinite(share)}
        if completed:
            self.holds_done += 1
            self.hits += self.hold_share[1] >= HIT_SHARE
        broken = {} if completed else {"broken_off": reason}
        return SessionEvent(
            HOLD_ENDED,
            now,
            {"hold": self.step.hold, TORQUE_TARGET: self.target.torque, **shares, **broken},
        )

    def _target_details(self) -> dict[str, Any]:
        target = self.target
        unit = UNITS[target.feedback]
        details = {TORQUE_TARGET: target.torque, "feedback": target.feedback}
        if target.lower is not None and target.upper is not None:
            details.update(
                {f"lower[{unit}]": round(target.lower, 4), f"upper[{unit}]": round(target.upper, 4)}
            )
        return details

    def _target_event(self, now: float) -> SessionEvent:
        return SessionEvent(
            "target changed", now, {"hold": self.step.hold, **self._target_details()}
        )
