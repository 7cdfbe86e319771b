"""The files that keep a session beyond its process: its progress, and the record of a course."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from biofeedback.session.course_file import CourseFile
from biofeedback.session.protocol import load_protocol
from biofeedback.session.saved_session import ProgressKeeper, load, worth_resuming
from biofeedback.session.session_program import Session


class SessionFiles:
    """Makes the session, and keeps what comes of it on disk.

    Parameters
    ----------
    protocol
        Name or path of the protocol; not read where there is a course.
    course
        The course that the session belongs to; None without one.
    on_failure
        Called with the reason where the disk refuses.

    Attributes
    ----------
    session
        The session, as its protocol or course begins it.

    Raises
    ------
    ProtocolError, CommandError
        As of `load_protocol` and `CourseFile.next_session`.
    """

    def __init__(
        self, protocol: str, course: CourseFile | None, on_failure: Callable[[str], None]
    ) -> None:
        self._course, self._on_failure = course, on_failure
        self.session = (
            Session(load_protocol(protocol))
            if course is None
            else Session(next_of_course=course.next_session)
        )
        self._progress: ProgressKeeper | None = None

    def open(self, path: Path, resume_within: float) -> dict[str, Any] | None:
        """Keep the progress in a file from now on; return what an earlier process left there.

        Parameters
        ----------
        path
            Of the file.
        resume_within
            Largest age of a progress that is of use [s].

        Returns
        -------
        dict or None
            For `SessionRunner.resume`; None where there is nothing to continue.

        Raises
        ------
        CommandError
            The file cannot be read; progress is kept in it nevertheless.
        """
        self._progress = ProgressKeeper(path, self.session.saved(), self._on_failure)
        found = load(path, time.time(), resume_within)
        return found if worth_resuming(found) else None

    def keep(self, progress: dict[str, Any]) -> None:
        """Keep the present progress, and new trials of the course; this returns at once."""
        if self._course is not None and self.session.conditioning is not None:
            self._course.keep(self.session.conditioning.session)
        if self._progress is not None:
            self._progress.keep(progress)

    def close(self) -> None:
        """Write what is left."""
        if self._progress is not None:
            self._progress.close()
        if self._course is not None:
            self._course.close()
