"""The step of a session that calibrates it: it begins with the running perturbation, its program
finds the model, the running estimator goes on with that, and only then the session goes on.
"""

from __future__ import annotations

import contextlib
from collections.abc import Callable, Mapping
from typing import Any

from ankle_node.session_event import SessionEvent
from biofeedback.errors import CommandError
from biofeedback.session.calibration_step import CalibrationStep
from biofeedback.session.check_list import DONE, FAILED, SESSION_CALIBRATION, CheckList
from biofeedback.session.devices import Calibration, CalibrationEnd, EstimatorModel
from biofeedback.session.protocol import CALIBRATION
from biofeedback.session.session_program import Session

TAKEOVER_PATIENCE = 120.0
"""[s] Time with perturbation within which the estimator has to go on with a new model. It does so
with its first valid estimate: its memory of 10 s and the reflex' settling take 15 to 30 s, and an
estimator whose algorithm is loaded anew on a busy computer takes up to a minute more."""


class SessionCalibrationStep(CalibrationStep):
    """Leads the calibration of a session.

    Who skips it goes on without a model of this session.

    Parameters
    ----------
    calibration
        What records and diagnoses.
    estimator
        What goes on with the model.
    not_valid
        Gives why the present estimates are not valid; empty where they are.
    """

    check, kind = SESSION_CALIBRATION, CALIBRATION
    needs = (
        "the running perturbation: complete the other checks, arm and start; the session begins "
        "with it"
    )
    goes_on = (
        "the session goes on by itself once the estimator uses the new model; 'Skip' in the check "
        "list goes on without it"
    )

    def __init__(
        self,
        calibration: Calibration,
        estimator: EstimatorModel,
        not_valid: Callable[[], str] = lambda: "",
    ) -> None:
        super().__init__(calibration)
        self._estimator, self._not_valid = estimator, not_valid
        self._last = 0.0
        self._awaited: Mapping[str, Any] | None = None
        self._handed_over = False
        self._waited = 0.0

    def follow(self, session: Session, checks: CheckList, now: float) -> list[SessionEvent]:
        """See `CalibrationStep.follow`; the step ends once the estimates are made with the model,
        and only time with the perturbation counts as waiting for that.
        """
        going_on = self._was_its_time and self.is_its_time(session)
        self._waited += now - self._last if going_on else 0.0
        self._last = now
        return super().follow(session, checks, now)

    def forget(self) -> None:
        """Let the estimator go on without the model of this session, as for the next subject."""
        if self._handed_over:
            with contextlib.suppress(CommandError):  # without an estimator there is no model either
                self._estimator.hand_over(None)
        self._awaited, self._handed_over = None, False

    def _at_rest(
        self, session: Session, checks: CheckList, now: float, entered: bool
    ) -> list[SessionEvent]:
        if self._awaited is not None:
            return self._await_estimator(checks, now, entered)
        if entered and checks.states[self.check] == DONE:  # a file of this visit answered it
            return self._hand_over(checks, checks.results[self.check], now)
        return super()._at_rest(session, checks, now, entered)

    def _begin(self, session: Session, checks: CheckList, now: float) -> list[SessionEvent]:
        self._awaited = None
        events = super()._begin(session, checks, now)
        if not events:
            self._estimator.prepare()
        return events

    def _ended(self, end: CalibrationEnd, checks: CheckList, now: float) -> list[SessionEvent]:
        if end.problem:
            return self._finish(checks, now, end.problem)
        return self._hand_over(checks, end.figures, now)

    def _hand_over(
        self, checks: CheckList, figures: Mapping[str, Any], now: float
    ) -> list[SessionEvent]:
        self._awaited, self._waited, self._handed_over = dict(figures), 0.0, True
        try:
            self._estimator.hand_over(self._calibration.model)
        except CommandError as error:
            return self._finish(checks, now, f"the estimator goes on without the model: {error}")
        checks.run(self.check, "handing the model to the estimator")
        return self._await_estimator(checks, now, False)

    def _await_estimator(self, checks: CheckList, now: float, entered: bool) -> list[SessionEvent]:
        """Show what is waited for; the model counts once the estimates are made with it, however
        late.
        """
        assert self._awaited is not None
        if self._estimator.confirmed:
            figures = {**self._awaited, "estimator": "goes on with this model"}
            self._awaited = None
            return self._finish(checks, now, "", figures)
        if entered and checks.states[self.check] == FAILED:
            return self._hand_over(checks, self._awaited, now)
        if checks.states[self.check] == FAILED:
            return []
        refusal = self._estimator.refusal
        if refusal:
            return self._finish(checks, now, f"the estimator refuses the model: {refusal}")
        if self._waited >= TAKEOVER_PATIENCE:
            return self._finish(checks, now, self._overdue())
        checks.run(
            self.check,
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
