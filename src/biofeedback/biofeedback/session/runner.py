"""Runs the session: its clock, its commands, and its one effect on the world, the rig.

The runner has a thread of its own. It advances the session, follows the rig, watches that an
operator's page is alive, and publishes the heartbeat of the operator. Screens read
`SessionRunner.view`, an immutable picture of the session, and send commands; they change nothing by
themselves.

`SessionRunner.stop` may be called from any thread: the rig is stopped in that thread, before and
without waiting for anything else.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import logging
import math
import threading
import time
import uuid
from collections import deque
from collections.abc import Callable, Coroutine, Mapping
from typing import Any

from ankle_node.session_event import SessionEvent
from biofeedback.errors import CommandError
from biofeedback.live_signals import GOOD, LiveSignals, Snapshot
from biofeedback.session.calibration_files import FileCheck
from biofeedback.session.calibration_step import CalibrationStep
from biofeedback.session.check_list import CHECKS, SESSION_CALIBRATION, BodyReading, CheckList
from biofeedback.session.commands import Command
from biofeedback.session.conditioning import largest_activity
from biofeedback.session.devices import (
    Calibration,
    EstimatorModel,
    Perturbation,
    Rig,
    Subject,
)
from biofeedback.session.guidance import Guidance
from biofeedback.session.protocol import CALIBRATION
from biofeedback.session.readings import read
from biofeedback.session.screen_axes import ScreenAxes
from biofeedback.session.session_program import ARMED, FINISHED, IDLE, PAUSED, RUNNING, Session
from biofeedback.session.session_view import SessionView, hint_now, view_of
from biofeedback.session.target import Reading

TICK_RATE = 30.0
"""[Hz] The estimator's rate; a hold's end is then at most 33 ms late."""
LOG_LINES = 30
ANSWER_TIMEOUT = 3.0
"""[s] Longest wait for the rig's answer to arm and start. A driver on a loaded machine answers
within 0.1 s; an operator waits no longer before acting."""
RIG_PATIENCE = 1.5
"""[s] Longest wait for a started rig to run: a rig that has agreed to start reports that it runs
within milliseconds; that its driver has died is seen within a second."""
RESUME_PATIENCE = 4.0
"""[s] Longest wait of a resumed session for its rig: a restarted node finds driver and latched
state within two seconds on a loaded machine."""
WATCH_AFTER_LOST_ANSWER = 10.0
"""[s] Time for which an unanswered start is watched: a start that was not answered may still be
carried out: a request waits in the driver's queue for as long as the driver is held up, and a rig
that hangs longer is stopped by its own watchdog."""
WATCH_PERIOD = 0.5
"""[s] Time between two stops while a start whose answer was lost may still be carried out."""
OPERATOR_TIMEOUT = 2.0
"""[s] Time without an operator's page after which the session stops: a page that reloads is back
within one second, and a subject at the rig must not be alone for longer than it takes to notice."""
OPERATOR_HEARTBEAT_AGE = 0.5
"""[s] An operator's page counts as alive for this time after its last sign: it gives one for each
frame, 30 in a second, and a busy browser may pause for 0.3 s.
"""
ALIVE_RATE = 10.0
"""[Hz] Rate of the operator's heartbeat to the driver: many may be lost within its timeout."""
REPEATED_STOP = 1.0
"""[s] Time within which successive stops are recorded once; each is sent to the rig."""
_TARGET_FIELDS = {
    "feedback": "feedback",
    "torque[N.m]": "torque",
    "torque_half_width[N.m]": "torque_half_width",
    "lower": "lower",
    "upper": "upper",
}
_logger = logging.getLogger(__name__)


class SessionRunner:
    """Owns the session and is the only one who commands the rig.

    Parameters
    ----------
    session
        Is advanced and commanded; nobody else touches it once the runner is started.
    signals
        The signals that came from the graph.
    rig, subject
        What commands act on.
    on_event
        Called with each session event, in the runner's thread.
    on_progress
        Called after each tick and command with what `Session.saved` gives.
    clock
        Gives ROS time [s].
    perturbation
        Gives the stretches of a conditioning course.
    file_checks
        What answers entries of the check list from files, by their names.
    calibration, estimator
        Calibrates the session, where the protocol has a step for it, and the estimator that goes on
        with the model.
    """

    def __init__(
        self,
        session: Session,
        signals: LiveSignals,
        rig: Rig,
        subject: Subject,
        on_event: Callable[[SessionEvent], None],
        clock: Callable[[], float],
        on_progress: Callable[[dict[str, Any]], None] = lambda progress: None,
        perturbation: Perturbation | None = None,
        file_checks: Mapping[str, FileCheck] | None = None,
        calibration: Calibration | None = None,
        estimator: EstimatorModel | None = None,
    ) -> None:
        self.session = session
        self.axes = ScreenAxes(session)
        self._file_checks = file_checks
        self._calibration = (
            CalibrationStep(calibration, estimator, signals.not_valid)
            if calibration and estimator
            else None
        )
        self.checks = self._new_check_list()
        self._signals = signals
        self._rig = rig
        self._subject = subject
        self._on_event = on_event
        self._on_progress = on_progress
        self._clock = clock
        self._perturbation = perturbation
        self._session_id = uuid.uuid4().hex
        self._log: deque[SessionEvent] = deque(maxlen=LOG_LINES)
        self._guidance = Guidance()
        self._monotonic = time.monotonic()
        self._rig_agreed_at: float | None = None
        self._rig_patience = RIG_PATIENCE
        self._stops = 0
        self._stopped_at = -math.inf
        self._watch_until = self._watched_at = -math.inf
        self._alone_since: float | None = None
        self._operator_heard = -math.inf
        self._announced = -math.inf
        self._two_drivers = False
        self._reading = Reading(math.nan, math.nan, math.nan, False)
        self._loop = asyncio.new_event_loop()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="session", daemon=True)
        self.view = self._picture()

    def _new_check_list(self) -> CheckList:
        protocol = self.session.protocol
        in_motion = (SESSION_CALIBRATION,) if protocol.calibrates and self._calibration else ()
        return CheckList(protocol.check_list, self._file_checks, in_motion)

    # ----- thread -----

    def start(self) -> None:
        """Start the session's clock in a thread of its own."""
        self._thread.start()

    def close(self) -> None:
        """End the thread."""
        self._closing.set()
        if self._thread.is_alive():
            self._thread.join(timeout=5.0)

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        self._read_file_checks(self._clock())
        self._loop.run_until_complete(self._tick_until_closed())
        self._loop.run_until_complete(self._loop.shutdown_asyncgens())

    async def _tick_until_closed(self) -> None:
        period = 1.0 / TICK_RATE
        due = time.monotonic()
        while not self._closing.is_set():
            try:
                self.tick(self._clock(), time.monotonic())
            except Exception:
                # A session that cannot go on must not leave the plate moving.
                _logger.exception("the session failed and the rig is stopped")
                self._rig.stop()
            due = max(due + period, time.monotonic() - period)
            await asyncio.sleep(max(due - time.monotonic(), 0.0))
        for task in asyncio.all_tasks():
            if task is not asyncio.current_task():
                task.cancel()

    # ----- what other threads call -----

    def hear_operator(self, monotonic: float) -> None:
        """Note a sign of life of an operator's page, at a monotonic time [s]; from any thread."""
        self._operator_heard = monotonic

    def stop(self, reason: str = "operator") -> None:
        """Stop every rig at once and then the session; from any thread, never waits.

        Parameters
        ----------
        reason
            Who or what stops.
        """
        self._stops += 1
        self._rig.stop()
        if self._thread.is_alive() and threading.current_thread() is not self._thread:
            self._loop.call_soon_threadsafe(self._stop_session, reason)
        else:
            self._stop_session(reason)

    def submit(self, command: Command) -> concurrent.futures.Future[None]:
        """Carry out a command in the runner's thread; the future raises `CommandError`."""
        return self._submit(self.carry_out(command))

    def _submit(self, work: Coroutine[Any, Any, None]) -> concurrent.futures.Future[None]:
        return asyncio.run_coroutine_threadsafe(work, self._loop)

    # ----- time -----

    def tick(self, now: float, monotonic: float) -> None:
        """Advance the session and follow rig and operator.

        Parameters
        ----------
        now
            ROS time [s].
        monotonic
            Monotonic time [s].
        """
        self._monotonic = monotonic
        session = self.session
        for name, message in self._signals.new_faults():
            self.record([SessionEvent("fault", now, {"node": name, "message": message[:300]})])
        self._announce_operator()
        self._follow_drivers(now)
        self._follow_rig()
        self._follow_operator()
        self._follow_lost_start()
        found = self._signals.snapshot(now, monotonic)
        rows = self._signals.new_responses()
        self._reading = read(self.session, self.checks.results, found, rows)
        self._follow_checks(now, found)
        before = session.state
        self.record(session.tick(now, self._reading))
        if self._calibration is not None and self.checks.in_motion:
            self.record(self._calibration.follow(session, self.checks, now))
        if before == RUNNING and session.state != RUNNING:
            self._rig.stop()
        self._follow_perturbation(now)
        self._publish_view()

    def _follow_perturbation(self, now: float) -> None:
        """Ask for the stretch that the course wants; a refusal pauses the session."""
        conditioning, perturbation = self.session.conditioning, self._perturbation
        if conditioning is None or perturbation is None:
            return
        if self.session.state == RUNNING and conditioning.take_request():
            perturbation.give()
        refusal, perturbation.refusal = perturbation.refusal, ""
        if refusal and self.session.state == RUNNING:
            fault = SessionEvent("fault", now, {"node": "course", "message": refusal})
            self.record([fault, *self.session.pause(now)])
            self._rig.stop()

    def _follow_checks(self, now: float, found: Snapshot) -> None:
        name = self.checks.tick(now, BodyReading(found.torque, found.angle, found.emg))
        if name is not None:
            self.record([self.checks.event(name, now)])

    def _check(self, name: str, act: str, now: float) -> None:
        """Begin, confirm or skip an entry of the check list."""
        if name in self.checks.in_motion and self._calibration is not None:
            self.record(self._calibration.command(act, self.session, self.checks, now))
            return
        if act == "skip":
            self.checks.skip(name)
            self.record([SessionEvent("check skipped", now, {"check": name})])
            return
        if CHECKS[name].duration > 0.0:
            self._require_samples(CHECKS[name].title, now)
        self.checks.begin(name, now)
        if CHECKS[name].duration == 0.0:
            self.record([self.checks.event(name, now)])

    def _require_samples(self, title: str, now: float) -> None:
        """Refuse to measure what nothing is received of, as while a rig is still starting."""
        if self._signals.snapshot(now, self._monotonic).torque_quality != GOOD:
            raise CommandError(
                f"'{title}' cannot be measured: no samples of torque and angle are received; wait "
                "until the rig is ready (see Health)"
            )

    def _read_file_checks(self, now: float, another_subject: bool = False) -> None:
        """Answer at once what files answer; what they do not is shown with its reason."""
        for name in self.checks.read_files(another_subject):
            self.record([self.checks.event(name, now)])

    def _announce_operator(self) -> None:
        alive = self._monotonic - self._operator_heard <= OPERATOR_HEARTBEAT_AGE
        if alive and self._monotonic - self._announced >= 0.9 / ALIVE_RATE:
            self._announced = self._monotonic
            self._rig.announce_operator(self._session_id)

    @property
    def _active(self) -> bool:
        return self.session.state in (ARMED, RUNNING)

    def _follow_drivers(self, now: float) -> None:
        """Record a second driver once, as a fault; an active session ends with it."""
        several = self._rig.several
        if several and not self._two_drivers:
            self.record([SessionEvent("fault", now, {"node": "rig", "message": self._rig.problem})])
            if self._active:
                self.stop(self._rig.problem)
        self._two_drivers = several

    def _follow_rig(self) -> None:
        """Stop a session whose rig has stopped: for a fault, by another's command, or because its
        driver is gone.
        """
        session, agreed = self.session, self._rig_agreed_at
        if agreed is None and self._active and self._rig.present:
            self.stop("a rig driver has appeared; arm again, together with the rig")
        if agreed is None or not self._active or self._monotonic - agreed < self._rig_patience:
            return
        reported = self._rig.describe()["state"]
        if self._rig.present and reported.split(":")[0] in ("", session.state):
            return
        self.stop(
            f"the rig is not {session.state}: {reported}"
            if self._rig.present
            else "the rig's driver is gone"
        )

    def _follow_operator(self) -> None:
        """Stop an active session that no operator's page watches any more."""
        if not self._active or self._monotonic - self._operator_heard <= OPERATOR_HEARTBEAT_AGE:
            self._alone_since = None
            return
        if self._alone_since is None:
            self._alone_since = max(self._operator_heard, self._monotonic - OPERATOR_HEARTBEAT_AGE)
        if self._monotonic - self._alone_since > OPERATOR_TIMEOUT:
            self.stop(f"no operator's page for {OPERATOR_TIMEOUT:g} s")

    def _follow_lost_start(self) -> None:
        """Repeat the stop while a start that was not answered may still be carried out."""
        if self._monotonic > self._watch_until or self._active:
            return
        state = self._rig.describe()["state"].split(":")[0]
        idle = state in ("disabled", "ready", "fault")
        if not idle and self._monotonic - self._watched_at >= WATCH_PERIOD:
            self._watched_at = self._monotonic
            self._rig.stop()

    # ----- commands -----

    async def carry_out(self, command: Command) -> None:
        """Do what an operator asks.

        Raises
        ------
        CommandError
            Refused by the session, by the rig or by the simulated subject.
        """
        session, name, values, now = self.session, command.name, command.values, self._clock()
        if name == "stop":
            self.stop()
        elif name == "pause":
            events = session.pause(now)
            self._rig.stop()
            self.record(events)
        elif name in ("arm", "start"):
            await self._with_rig(name)
        elif name == "reset_fault":
            if not self._rig.present:
                raise CommandError("no rig driver answers; there is no fault to reset")
            await self._rig_answer(name)
        elif name == "set_target":
            changes = {_TARGET_FIELDS[key]: value for key, value in values.items()}
            self.record(session.set_target(now, changes))
        elif name == "check":
            self._check(values["check"], values["act"], now)
        elif name == "set_axis":
            self.axes.set(values)
        elif name == "subject":
            await self._subject.set(values)
        elif name == "next" and session.step.kind == CALIBRATION and session.state == RUNNING:
            raise CommandError(
                "the session goes on by itself once the estimator uses the new model; 'Skip' in "
                "the check list goes on without it"
            )
        elif name == "note":
            self.record([SessionEvent("note", now, {"text": values["text"]})])
        else:
            steps = {
                "next": session.next,
                "start_hold": session.start_hold,
                "end_hold": session.end_hold,
                "restart": session.restart,
            }
            self.record(steps[name](now))
            if name == "restart":
                if self._calibration is not None:
                    self._calibration.forget()
                self.checks = self._new_check_list()
                self._read_file_checks(now, another_subject=True)
            if session.state in (PAUSED, FINISHED):
                self._rig.stop()
        self._publish_view()

    async def _with_rig(self, name: str) -> None:
        """Arm or start: the session follows only where the rig has agreed."""
        session = self.session
        if name == "start" and session.state != ARMED:
            session.start(self._clock())  # raises, with its reason
        if name == "arm" and session.state not in (IDLE, PAUSED):
            session.arm(self._clock())
        if self._monotonic - self._operator_heard > OPERATOR_TIMEOUT:
            raise CommandError("no operator's page answers; arm and start need one that is open")
        if self._rig.several:
            raise CommandError(self._rig.problem)
        if name == "arm" and self.checks.missing:
            raise CommandError(f"the check list is not complete: {', '.join(self.checks.missing)}")
        if name == "arm" and session.conditioning is not None:
            largest_activity(session.conditioning.course, self.checks.results)
        stops = self._stops
        if self._rig.present:
            # From the request on: an armed session waits here for its start.
            before = self._rig_agreed_at, self._rig_patience
            self._rig_agreed_at, self._rig_patience = self._monotonic, math.inf
            try:
                await self._rig_answer(name)
            except BaseException:
                self._rig_agreed_at, self._rig_patience = before
                raise
            self._rig_agreed_at, self._rig_patience = self._monotonic, RIG_PATIENCE
        else:
            self._rig_agreed_at = None
        if stops != self._stops:
            # Somebody stopped while the rig was answering: it must not stay armed or move.
            self._watch_until = self._monotonic + WATCH_AFTER_LOST_ANSWER
            self._rig.stop()
            raise CommandError(f"stopped while the rig was asked to {name}")
        now = self._clock()
        self.record(session.arm(now) if name == "arm" else session.start(now))

    async def _rig_answer(self, action: str) -> None:
        """Await the rig's answer; where it does not come, the rig is stopped and watched."""
        try:
            await asyncio.wait_for(self._rig.call(action), ANSWER_TIMEOUT)
        except CommandError:
            raise
        except BaseException as error:
            self._watch_until = self._monotonic + WATCH_AFTER_LOST_ANSWER
            self.stop(f"the rig did not answer to {action.replace('_', ' ')}")
            if isinstance(error, asyncio.TimeoutError):
                raise CommandError(
                    f"no answer from the rig within {ANSWER_TIMEOUT:g} s; it has been stopped"
                ) from None
            raise

    def _stop_session(self, reason: str) -> None:
        session = self.session
        repeated = session.state == IDLE and time.monotonic() - self._stopped_at < REPEATED_STOP
        self._stopped_at = time.monotonic()
        if not repeated:
            self.record(session.stop(self._clock(), reason))
        self._publish_view()

    def resume(self, saved: Mapping[str, Any]) -> None:
        """Continue a saved session and follow its rig at once; call before `start`.

        Raises
        ------
        CommandError
            As `Session.resume`.
        """
        self.record(self.session.resume(saved, self._clock()))
        self.checks.resume(saved.get("checks") or {})
        if self.session.state == RUNNING:
            self._rig_agreed_at, self._rig_patience = time.monotonic(), RESUME_PATIENCE
        self._publish_view()

    # ----- what is seen of it -----

    def record(self, events: list[SessionEvent]) -> None:
        """Publish and log events."""
        for event in events:
            self._log.append(event)
            self._on_event(event)

    def _publish_view(self) -> None:
        self.view = self._picture()
        self._on_progress({**self.session.saved(), "checks": self.checks.saved()})

    def _picture(self) -> SessionView:
        now = hint_now(self.session, self._reading, self._clock())
        return view_of(
            self.session,
            self._reading,
            self.axes,
            self.checks,
            self._rig,
            self._subject,
            self._log,
            self._guidance.update(now, self._monotonic),
        )
