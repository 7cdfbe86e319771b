"""The record of a subject's course on disk while a session runs: which session comes next, and what
it has already.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import asdict
from datetime import date
from pathlib import Path

from biofeedback.errors import CommandError
from biofeedback.session.course import Course
from biofeedback.session.course_record import CourseRecord, load_record, new_record, save_record
from biofeedback.session.course_session import CourseSession
from biofeedback.session.saved_session import ProgressWriter


class CourseFile:
    """Keeps the record of one subject up to date.

    Parameters
    ----------
    path
        Of the record; it is made with the first trial.
    course
        The plan of the course.
    subject
        Pseudonym of the subject.
    on_failure
        Called with the reason where the disk refuses.

    Raises
    ------
    CommandError
        The file is no record, or one of another course or subject.
    """

    def __init__(
        self, path: Path, course: Course, subject: str, on_failure: Callable[[str], None]
    ) -> None:
        self.course = course
        self.record: CourseRecord = (
            load_record(path) if path.exists() else new_record(course, subject)
        )
        if self.record.subject != subject:
            raise CommandError(
                f"{path} is the record of subject '{self.record.subject}', not of '{subject}'"
            )
        self._trials = -1
        self._writer = ProgressWriter(path, on_failure, write=save_record)

    def next_session(self) -> CourseSession:
        """Return the session that comes next, with the trials that it has already.

        Raises
        ------
        CommandError
            All sessions are done, or the record is of another course.
        """
        session = self.record.resume(self.course)
        self._trials = len(session.trials)
        return session

    def keep(self, session: CourseSession) -> None:
        """Write the trials of the present session where there are new ones; returns at once."""
        if len(session.trials) == self._trials or session.number != self.record.next_session:
            return
        self._trials = len(session.trials)
        if session.finished:
            self.record.add(session, date.today().isoformat())
        else:
            self.record.unfinished = [trial.size for trial in session.trials]
        self._writer.keep(asdict(self.record))

    @property
    def progress(self) -> tuple[int, float]:
        """Return the number of sessions that are done, and the success rate of the last one; NaN
        before the first conditioned session.
        """
        results = self.record.results
        return len(results), results[-1].success_rate if results else math.nan

    def close(self) -> None:
        """Write what is left."""
        self._writer.close()
