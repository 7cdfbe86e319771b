"""The check list of the visit, as the session leads through it: entries that are measured, that
files answer, and the calibration that needs the running perturbation.
"""

from __future__ import annotations

from collections.abc import Mapping

from ankle_node.session_event import SessionEvent
from biofeedback.errors import CommandError
from biofeedback.live_signals import GOOD, Snapshot
from biofeedback.session.calibration_files import FileCheck
from biofeedback.session.calibration_step import CalibrationStep
from biofeedback.session.check_list import CHECKS, BodyReading, CheckList
from biofeedback.session.session_program import Session


class VisitChecks:
    """Leads through the check list of a session.

    Parameters
    ----------
    session
        Whose protocol names the entries.
    file_checks
        What answers entries from files, by their names.
    calibration
        The step that calibrates the session or the rig; None without one.

    Attributes
    ----------
    entries
        The entries with their states and results.
    """

    def __init__(
        self,
        session: Session,
        file_checks: Mapping[str, FileCheck] | None,
        calibration: CalibrationStep | None,
    ) -> None:
        self._session, self._file_checks, self._calibration = session, file_checks, calibration
        self.entries = self._new_entries()

    def _new_entries(self) -> CheckList:
        protocol, step = self._session.protocol, self._calibration
        in_motion = (step.check,) if step is not None and protocol.has(step.kind) else ()
        return CheckList(protocol.check_list, self._file_checks, in_motion)

    def read_files(self, now: float, another_subject: bool = False) -> list[SessionEvent]:
        """Answer at once what files answer; what they do not is shown with its reason.

        Parameters
        ----------
        now
            ROS time [s].
        another_subject
            As of `CheckList.read_files`.
        """
        return [self.entries.event(name, now) for name in self.entries.read_files(another_subject)]

    def restart(self, now: float) -> list[SessionEvent]:
        """Begin anew at ROS time `now` [s], for the next subject."""
        if self._calibration is not None:
            self._calibration.forget()
        self.entries = self._new_entries()
        return self.read_files(now, another_subject=True)

    def measure(self, found: Snapshot, now: float) -> list[SessionEvent]:
        """Give the signals of this moment to an entry that is being measured."""
        name = self.entries.tick(now, BodyReading(found.torque, found.angle, found.emg))
        return [] if name is None else [self.entries.event(name, now)]

    def calibrate(self, now: float) -> list[SessionEvent]:
        """Go on with the calibration, where the session is at its step."""
        if self._calibration is None or not self.entries.in_motion:
            return []
        return self._calibration.follow(self._session, self.entries, now)

    def require_no_calibration(self) -> None:
        """Refuse to leave the step of a calibration for the next one before its end.

        Raises
        ------
        CommandError
            The session is in that step; says when it goes on.
        """
        if self._calibration is not None and self._calibration.is_its_time(self._session):
            raise CommandError(self._calibration.goes_on)

    def command(self, name: str, act: str, found: Snapshot, now: float) -> list[SessionEvent]:
        """Begin, confirm or skip an entry, as the operator asks.

        Parameters
        ----------
        name
            Of the entry.
        act
            ``begin`` or ``skip``.
        found
            The signals at this moment.
        now
            ROS time [s].

        Raises
        ------
        CommandError
            Not of this visit, not now, or no samples are received to measure it from.
        """
        if name in self.entries.in_motion and self._calibration is not None:
            return self._calibration.command(act, self._session, self.entries, now)
        if act == "skip":
            self.entries.skip(name)
            return [SessionEvent("check skipped", now, {"check": name})]
        measured = CHECKS[name].duration > 0.0
        if measured and found.torque_quality != GOOD:
            raise CommandError(
                f"'{CHECKS[name].title}' cannot be measured: no samples of torque and angle are "
                "received; wait until the rig is ready (see Health)"
            )
        self.entries.begin(name, now)
        return [] if measured else [self.entries.event(name, now)]
