"""The step of a session that calibrates it: it begins with the running perturbation, its program
answers the check list's entry, and the session goes on once that is answered.
"""

from __future__ import annotations

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
from biofeedback.session.devices import Calibration
from biofeedback.session.protocol import CALIBRATION
from biofeedback.session.session_program import RUNNING, Session


class CalibrationStep:
    """Leads the calibration of a session.

    Parameters
    ----------
    calibration
        What records and diagnoses.
    """

    def __init__(self, calibration: Calibration) -> None:
        self._calibration = calibration
        self._was_its_time = False

    def follow(self, session: Session, checks: CheckList, now: float) -> list[SessionEvent]:
        """Begin with the step, show what is done, end the step; return what happened.

        After an interruption the calibration begins anew with the next start.

        Parameters
        ----------
        session, checks
            Of the visit.
        now
            ROS time [s].
        """
        calibration, events = self._calibration, []
        entered = _is_its_time(session) and not self._was_its_time
        self._was_its_time = _is_its_time(session)
        if calibration.recording and not _is_its_time(session):
            calibration.cancel("interrupted while it was recording")
        end = calibration.ended()
        state = checks.states[SESSION_CALIBRATION]
        if state != SKIPPED and end is not None:
            checks.finish(SESSION_CALIBRATION, end.problem, end.figures)
            events.append(checks.event(SESSION_CALIBRATION, now))
        elif state != SKIPPED and calibration.running:
            checks.run(SESSION_CALIBRATION, calibration.progress())
        elif entered and state in (OPEN, FAILED):
            events += self._begin(session, checks, now)
        answered = checks.states[SESSION_CALIBRATION] in (DONE, SKIPPED)
        return [*events, *(session.next(now) if answered and _is_its_time(session) else [])]

    def command(
        self, act: str, session: Session, checks: CheckList, now: float
    ) -> list[SessionEvent]:
        """Begin again or skip, as the operator asks; return what happened.

        Parameters
        ----------
        act
            ``begin`` or ``skip``.
        session, checks
            Of the visit.
        now
            ROS time [s].

        Raises
        ------
        CommandError
            The perturbation does not run in the step of the calibration.
        """
        if act == "skip":
            self._calibration.cancel("skipped by the operator")
            checks.skip(SESSION_CALIBRATION)
            return [SessionEvent("check skipped", now, {"check": SESSION_CALIBRATION})]
        if not _is_its_time(session):
            raise CommandError(
                f"'{CHECKS[SESSION_CALIBRATION].title}' needs the running perturbation: complete "
                "the other checks, arm and start; the session begins with it"
            )
        return self._begin(session, checks, now)

    def _begin(self, session: Session, checks: CheckList, now: float) -> list[SessionEvent]:
        try:
            self._calibration.begin(session.step.duration)
        except (CommandError, OSError) as error:
            checks.finish(SESSION_CALIBRATION, str(error), {})
            return [checks.event(SESSION_CALIBRATION, now)]
        checks.run(SESSION_CALIBRATION, self._calibration.progress())
        return []


def _is_its_time(session: Session) -> bool:
    return session.state == RUNNING and session.step.kind == CALIBRATION
