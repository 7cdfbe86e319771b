"""The step of a session that calibrates it: it begins with the running perturbation, its program
finds the model, the running estimator goes on with that, and only then the session goes on.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from typing import Any

from ankle_node.session_event import SessionEvent
from biofeedback.errors import CommandError
from biofeedback.session.check_list import (
    CHECKS,
    DONE,
    FAILED,
    OPEN,
    SESSION_CALIBRATION,
    SKIPPED,
    CheckList,
)
from biofeedback.session.devices import Calibration, CalibrationEnd, EstimatorModel
from biofeedback.session.protocol import CALIBRATION
from biofeedback.session.session_program import RUNNING, Session

TAKEOVER_PATIENCE = 120.0
"""[s] Time with perturbation within which the estimator has to go on with a new model. It does so
with its first valid estimate: its memory of 10 s and the reflex' settling take 15 to 30 s, and an
estimator whose algorithm is loaded anew on a busy computer takes up to a minute more."""


class CalibrationStep:
    """Leads the calibration of a session.

    Parameters
    ----------
    calibration
        What records and diagnoses.
    estimator
        What goes on with the model.
    not_valid
        Gives why the present estimates are not valid; empty where they are.
    """

    def __init__(
        self,
        calibration: Calibration,
        estimator: EstimatorModel,
        not_valid: Callable[[], str] = lambda: "",
    ) -> None:
        self._calibration, self._estimator, self._not_valid = calibration, estimator, not_valid
        self._was_its_time = False
        self._last = 0.0
        self._awaited: Mapping[str, Any] | None = None
        self._handed_over = False
        self._waited = 0.0

    def follow(self, session: Session, checks: CheckList, now: float) -> list[SessionEvent]:
        """Begin with the step, show what is done, end the step; return what happened.

        The step ends once the estimates are made with the new model. After an interruption a
        recording begins anew with the next start; what is diagnosed is not lost.

        Parameters
        ----------
        session, checks
            Session and check list of the visit.
        now
            ROS time [s].
        """
        calibration = self._calibration
        its_time = _is_its_time(session)
        entered = its_time and not self._was_its_time
        self._waited += now - self._last if its_time and not entered else 0.0
        self._was_its_time, self._last = its_time, now
        if calibration.recording and not its_time:
            calibration.cancel("interrupted while it was recording")
        end = calibration.ended()
        events: list[SessionEvent] = []
        state = checks.states[SESSION_CALIBRATION]
        if state == SKIPPED:
            pass
        elif end is not None:
            events = self._ended(end, checks, now)
        elif calibration.running:
            checks.run(SESSION_CALIBRATION, calibration.progress())
        elif self._awaited is not None:
            events = self._await_estimator(checks, now, entered)
        elif entered and state == DONE:  # a file of this visit answered it
            events = self._hand_over(checks, checks.results[SESSION_CALIBRATION], now)
        elif entered and state in (OPEN, FAILED):
            events = self._begin(session, checks, now)
        answered = checks.states[SESSION_CALIBRATION] in (DONE, SKIPPED)
        return [*events, *(session.next(now) if answered and its_time else [])]

    def command(
        self, act: str, session: Session, checks: CheckList, now: float
    ) -> list[SessionEvent]:
        """Begin again or skip, as the operator asks; return what happened.

        Who skips goes on without a model of this session.

        Parameters
        ----------
        act
            What the operator asks for: ``begin`` or ``skip``.
        session, checks
            Session and check list of the visit.
        now
            ROS time [s].

        Raises
        ------
        CommandError
            The perturbation does not run in the step of the calibration.
        """
        if act == "skip":
            self._calibration.cancel("skipped by the operator")
            self.forget()
            checks.skip(SESSION_CALIBRATION)
            return [SessionEvent("check skipped", now, {"check": SESSION_CALIBRATION})]
        if not _is_its_time(session):
            raise CommandError(
                f"'{CHECKS[SESSION_CALIBRATION].title}' needs the running perturbation: complete "
                "the other checks, arm and start; the session begins with it"
            )
        return self._begin(session, checks, now)

    def forget(self) -> None:
        """Let the estimator go on without the model of this session, as for the next subject."""
        if self._handed_over:
            with contextlib.suppress(CommandError):  # without an estimator there is no model either
                self._estimator.hand_over(None)
        self._awaited, self._handed_over = None, False

    def _begin(self, session: Session, checks: CheckList, now: float) -> list[SessionEvent]:
        self._awaited = None
        try:
            self._calibration.begin(session.step.duration)
        except (CommandError, OSError) as error:
            return _finish(checks, now, str(error))
        self._estimator.prepare()
        checks.run(SESSION_CALIBRATION, self._calibration.progress())
        return []

    def _ended(self, end: CalibrationEnd, checks: CheckList, now: float) -> list[SessionEvent]:
        if end.problem:
            return _finish(checks, now, end.problem)
        return self._hand_over(checks, end.figures, now)

    def _hand_over(
        self, checks: CheckList, figures: Mapping[str, Any], now: float
    ) -> list[SessionEvent]:
        self._awaited, self._waited, self._handed_over = dict(figures), 0.0, True
        try:
            self._estimator.hand_over(self._calibration.model)
        except CommandError as error:
            return _finish(checks, now, f"the estimator goes on without the model: {error}")
        checks.run(SESSION_CALIBRATION, "handing the model to the estimator")
        return self._await_estimator(checks, now, False)

    def _await_estimator(self, checks: CheckList, now: float, entered: bool) -> list[SessionEvent]:
        """Show what is waited for; the model counts once the estimates are made with it, however
        late.
        """
        assert self._awaited is not None
        if self._estimator.confirmed:
            figures = {**self._awaited, "estimator": "goes on with this model"}
            self._awaited = None
            return _finish(checks, now, "", figures)
        if entered and checks.states[SESSION_CALIBRATION] == FAILED:
            return self._hand_over(checks, self._awaited, now)
        if checks.states[SESSION_CALIBRATION] == FAILED:
            return []
        refusal = self._estimator.refusal
        if refusal:
            return _finish(checks, now, f"the estimator refuses the model: {refusal}")
        if self._waited >= TAKEOVER_PATIENCE:
            return _finish(checks, now, self._overdue())
        checks.run(
            SESSION_CALIBRATION,
            f"waiting for the estimator to go on with the model, {self._waited:.0f} s so far; 15 "
            "to 60 s are usual",
        )
        return []

    def _overdue(self) -> str:
        reason = self._not_valid()
        present = f"are not valid: {reason}" if reason else "without it are valid"
        return (
            f"the estimator does not go on with the model after {TAKEOVER_PATIENCE:g} s; the "
            f"estimates {present}. Look at Health, calibrate again, or skip to go on without"
        )


def _finish(
    checks: CheckList, now: float, problem: str, figures: Mapping[str, Any] | None = None
) -> list[SessionEvent]:
    checks.finish(SESSION_CALIBRATION, problem, figures or {})
    return [checks.event(SESSION_CALIBRATION, now)]


def _is_its_time(session: Session) -> bool:
    return session.state == RUNNING and session.step.kind == CALIBRATION
