"""The step of a protocol that calibrates: its program begins with the step, the check list shows
what it does, and the session goes on once it has ended well.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from ankle_node.session_event import SessionEvent
from biofeedback.errors import CommandError
from biofeedback.session.check_list import CHECKS, DONE, FAILED, OPEN, SKIPPED, CheckList
from biofeedback.session.devices import Calibration, CalibrationEnd
from biofeedback.session.session_program import RUNNING, Session


class CalibrationStep:
    """Leads through a calibration; what is calibrated, its subclasses say.

    Parameters
    ----------
    calibration
        What records and computes.
    """

    check = kind = ""
    """Name of its entry in the check list, and kind of its step in the protocol."""
    needs = goes_on = ""
    """What it needs, and when the session goes on, for whoever asks too early."""

    def __init__(self, calibration: Calibration) -> None:
        self._calibration = calibration
        self._was_its_time = False

    def follow(self, session: Session, checks: CheckList, now: float) -> list[SessionEvent]:
        """Begin with the step, show what is done, end the step; return what happened.

        After an interruption a recording begins anew with the next start; what is computed from a
        complete one is not lost.

        Parameters
        ----------
        session, checks
            Session and check list of the visit.
        now
            ROS time [s].
        """
        calibration = self._calibration
        its_time = self.is_its_time(session)
        entered = its_time and not self._was_its_time
        self._was_its_time = its_time
        if calibration.recording and not its_time:
            calibration.cancel("interrupted while it was recording")
        end = calibration.ended()
        events: list[SessionEvent] = []
        if checks.states[self.check] == SKIPPED:
            pass
        elif end is not None:
            events = self._ended(end, checks, now)
        elif calibration.running:
            checks.run(self.check, calibration.progress())
        else:
            events = self._at_rest(session, checks, now, entered)
        answered = checks.states[self.check] in (DONE, SKIPPED)
        return [*events, *(session.next(now) if answered and its_time else [])]

    def command(
        self, act: str, session: Session, checks: CheckList, now: float
    ) -> list[SessionEvent]:
        """Begin again or skip, as the operator asks; return what happened.

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
            The session is not in the step of the calibration.
        """
        if act == "skip":
            self._calibration.cancel("skipped by the operator")
            self.forget()
            checks.skip(self.check)
            return [SessionEvent("check skipped", now, {"check": self.check})]
        if not self.is_its_time(session):
            raise CommandError(f"'{CHECKS[self.check].title}' needs {self.needs}")
        return self._begin(session, checks, now)

    def is_its_time(self, session: Session) -> bool:
        """Tell whether the session is in the step of this calibration and runs."""
        return session.state == RUNNING and session.step.kind == self.kind

    def forget(self) -> None:
        """Take back what was found, as for the next subject."""

    def _begin(self, session: Session, checks: CheckList, now: float) -> list[SessionEvent]:
        try:
            self._calibration.begin(session.step.duration)
        except (CommandError, OSError) as error:
            return self._finish(checks, now, str(error))
        checks.run(self.check, self._calibration.progress())
        return []

    def _at_rest(
        self, session: Session, checks: CheckList, now: float, entered: bool
    ) -> list[SessionEvent]:
        """Follow the session while no program runs."""
        if entered and checks.states[self.check] in (OPEN, FAILED):
            return self._begin(session, checks, now)
        return []

    def _ended(self, end: CalibrationEnd, checks: CheckList, now: float) -> list[SessionEvent]:
        return self._finish(checks, now, end.problem, end.figures)

    def _finish(
        self,
        checks: CheckList,
        now: float,
        problem: str,
        figures: Mapping[str, Any] | None = None,
    ) -> list[SessionEvent]:
        checks.finish(self.check, problem, figures or {})
        return [checks.event(self.check, now)]
