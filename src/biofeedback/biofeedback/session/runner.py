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
from biofeedback.live_signals import LiveSignals
from biofeedback.session.calibration_files import FileCheck
from biofeedback.session.calibration_step import CalibrationStep
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
from biofeedback.session.operator_watch import MAX_UNWATCHED_TIME, OperatorWatch
from biofeedback.session.readings import read
from biofeedback.session.rig_agreement import RigAgreement
from biofeedback.session.rig_calibration_step import RigCalibrationStep
from biofeedback.session.screen_axes import ScreenAxes
from biofeedback.session.session_calibration_step import SessionCalibrationStep
from biofeedback.session.session_program import ARMED, FINISHED, IDLE, PAUSED, RUNNING, Session
from biofeedback.session.session_view import SessionView, hint_now, view_of
from biofeedback.session.target import Reading
from biofeedback.session.visit_checks import VisitChecks

TICK_RATE = 30.0
"""[Hz] The estimator's rate; a hold's end is then at most 33 ms late."""
LOG_LINES = 30
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
        Calibrates session or rig, where the protocol has a step for it, and the estimator that goes
        on with the model of a session.
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
        step: CalibrationStep | None = None
        if calibration and session.protocol.rig_movement:
            step = RigCalibrationStep(calibration)
        elif calibration and estimator:
            step = SessionCalibrationStep(calibration, estimator, signals.not_valid)
        self.checks = VisitChecks(session, file_checks, step)
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
        self._agreement = RigAgreement(rig, self.stop, self._monotonic)
        self._operator = OperatorWatch()
        self._stops = 0
        self._stopped_at = -math.inf
        self._two_drivers = False
        self._reading = Reading(math.nan, math.nan, math.nan, False)
        self._loop = asyncio.new_event_loop()
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="session", daemon=True)
        self.view = self._picture()

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
        self.record(self.checks.read_files(self._clock()))
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
        self._operator.hear(monotonic)

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
        self._monotonic = self._agreement.monotonic = monotonic
        session = self.session
        for name, message in self._signals.new_faults():
            self.record([SessionEvent("fault", now, {"node": name, "message": message[:300]})])
        if self._operator.heartbeat_due(monotonic):
            self._rig.announce_operator(self._session_id)
        self._follow_drivers(now)
        self._follow_rig_and_operator()
        found = self._signals.snapshot(now, monotonic)
        rows = self._signals.new_responses()
        self._reading = read(self.session, self.checks.entries.results, found, rows)
        self.record(self.checks.measure(found, now))
        before = session.state
        self.record(session.tick(now, self._reading))
        self.record(self.checks.calibrate(now))
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

    def _follow_rig_and_operator(self) -> None:
        """Stop a session that its rig does not follow or that no operator's page watches."""
        reason = self._agreement.broken(self.session.state) if self._active else ""
        if reason:
            self.stop(reason)
        if self._operator.has_left(self._monotonic, self._active):
            self.stop(f"no operator's page for {MAX_UNWATCHED_TIME:g} s")
        if not self._active:
            self._agreement.stop_late_start()

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
            await self._agreement.answer(name)
        elif name == "set_target":
            changes = {_TARGET_FIELDS[key]: value for key, value in values.items()}
            self.record(session.set_target(now, changes))
        elif name == "check":
            found = self._signals.snapshot(now, self._monotonic)
            self.record(self.checks.command(values["check"], values["act"], found, now))
        elif name == "set_axis":
            self.axes.set(values)
        elif name == "subject":
            await self._subject.set(values)
        elif name == "note":
            self.record([SessionEvent("note", now, {"text": values["text"]})])
        else:
            steps = {
                "next": session.next,
                "start_hold": session.start_hold,
                "end_hold": session.end_hold,
                "restart": session.restart,
            }
            if name == "next":
                self.checks.require_no_calibration()
            self.record(steps[name](now))
            if name == "restart":
                self.record(self.checks.restart(now))
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
        if not self._operator.answers(self._monotonic):
            raise CommandError("no operator's page answers; arm and start need one that is open")
        if self._rig.several:
            raise CommandError(self._rig.problem)
        missing = self.checks.entries.missing
        if name == "arm" and missing:
            raise CommandError(f"the check list is not complete: {', '.join(missing)}")
        if name == "arm" and session.conditioning is not None:
            largest_activity(session.conditioning.course, self.checks.entries.results)
        stops = self._stops
        await self._agreement.ask(name)
        if stops != self._stops:
            # Somebody stopped while the rig was answering: it must not stay armed or move.
            self._agreement.watch()
            self._rig.stop()
            raise CommandError(f"stopped while the rig was asked to {name}")
        now = self._clock()
        self.record(session.arm(now) if name == "arm" else session.start(now))

    def _stop_session(self, reason: str) -> None:
        session = self.session
        repeated = session.state == IDLE and time.monotonic() - self._stopped_at < REPEATED_STOP
        self._stopped_at = time.monotonic()
        if not repeated:
            self.record(session.stop(self._clock(), reason))
        self._publish_view()

    def resume(self, saved: Mapping[str, Any], monotonic: float) -> None:
        """Continue a saved session and follow its rig at once; call before `start`.

        Parameters
        ----------
        saved
            What `on_progress` was called with.
        monotonic
            Monotonic time [s].

        Raises
        ------
        CommandError
            As `Session.resume`.
        """
        self.record(self.session.resume(saved, self._clock()))
        self.checks.entries.resume(saved.get("checks") or {})
        if self.session.state == RUNNING:
            self._agreement.resume(monotonic)
        self._publish_view()

    # ----- what is seen of it -----

    def record(self, events: list[SessionEvent]) -> None:
        """Publish and log events."""
        for event in events:
            self._log.append(event)
            self._on_event(event)

    def _publish_view(self) -> None:
        self.view = self._picture()
        self._on_progress({**self.session.saved(), "checks": self.checks.entries.saved()})

    def _picture(self) -> SessionView:
        now = hint_now(self.session, self._reading, self._clock())
        return view_of(
            self.session,
            self._reading,
            self.axes,
            self.checks.entries,
            self._rig,
            self._subject,
            self._log,
            self._guidance.update(now, self._monotonic),
        )
