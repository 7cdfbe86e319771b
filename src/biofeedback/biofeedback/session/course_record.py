"""The record of a course so far: one entry a session, on disk.

The file is YAML; it is written after each session and each block, so that a course goes on after
months, another computer, or a session that was broken off. It names a subject by a pseudonym only.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import yaml

from ankle_interfaces.yaml_text import parse_yaml, read_text
from biofeedback.errors import CommandError
from biofeedback.session.course import CONDITIONED, CONTROL, Course
from biofeedback.session.course_session import CourseSession
from biofeedback.session.durable_file import replace_file


@dataclass(frozen=True)
class SessionResult:
    """Holds the result of one session of a course.

    Attributes
    ----------
    number
        From 1.
    date
        As the laboratory writes it, ISO 8601.
    trials, planned
        Done and planned.
    control, conditioned
        Mean reflex of the control and of the conditioned trials; NaN where there was none.
    success_rate
        Share of successes of the conditioned trials; NaN where there was none.
    """

    number: int
    date: str
    trials: int
    planned: int
    control: float
    conditioned: float
    success_rate: float


@dataclass
class CourseRecord:
    """Holds the sessions of one subject.

    Attributes
    ----------
    subject
        Pseudonym.
    course
        Title and digest of the plan.
    digest
        Tells one plan from another.
    results
        One entry a session, in order.
    unfinished
        Sizes of the reflexes of a session that was broken off; None where there is none.
    """

    subject: str
    course: str
    digest: str
    results: list[SessionResult] = field(default_factory=list)
    unfinished: list[float] | None = None

    @property
    def next_session(self) -> int:
        """Return the number of the session that comes next."""
        return len(self.results) + 1

    def add(self, session: CourseSession, date: str) -> SessionResult:
        """Add a session that has ended, finished or not.

        Parameters
        ----------
        session
            The session with its trials.
        date
            Date of the session as ISO 8601.

        Raises
        ------
        CommandError
            It is not the next one.
        """
        if session.number != self.next_session:
            raise CommandError(
                f"session {session.number} cannot be added; the next one is {self.next_session}"
            )
        result = SessionResult(
            session.number,
            date,
            len(session.trials),
            session.planned,
            session.mean(CONTROL),
            session.mean(CONDITIONED),
            session.success_rate,
        )
        self.results.append(result)
        self.unfinished = None
        return result

    def resume(self, course: Course) -> CourseSession:
        """Give the next session, with the trials that an interrupted one had already.

        Raises
        ------
        CommandError
            All sessions are done, or the record is of another course.
        """
        if course.digest != self.digest:
            raise CommandError(
                f"the record follows '{self.course}', another course than '{course.title}'"
            )
        if self.next_session > course.sessions:
            raise CommandError(f"all {course.sessions} sessions are done")
        session = CourseSession(course, self.next_session)
        for size in self.unfinished or []:
            session.record(size)
        return session

    def save(self, path: Path) -> None:
        """Write the record; after a crash the file holds the old or the new one.

        Raises
        ------
        OSError
            The disk refuses.
        """
        save_record(path, asdict(self))


def save_record(path: Path, content: Mapping[str, Any]) -> None:
    """Write a record's content; after a crash the file holds the old or the new one.

    Raises
    ------
    OSError
        The disk refuses.
    """
    replace_file(path, yaml.safe_dump(dict(content), sort_keys=False))


def load_record(path: Path) -> CourseRecord:
    """Read a record.

    Raises
    ------
    CommandError
        It cannot be read; says why.
    """
    try:
        content: dict[str, Any] = parse_yaml(read_text(path))
        results = [SessionResult(**entry) for entry in content.pop("results")]
        record = CourseRecord(**content, results=results)
        if [result.number for result in results] != list(range(1, len(results) + 1)):
            raise ValueError("its sessions are not numbered 1, 2, 3 ...")
        return record
    except FileNotFoundError:
        raise CommandError(f"{path} is not there; a course's first session makes it") from None
    except (OSError, TypeError, KeyError, ValueError, AttributeError) as error:
        raise CommandError(f"{path} is no record of a course: {error}") from None


def new_record(course: Course, subject: str) -> CourseRecord:
    """Give the empty record of a subject.

    Raises
    ------
    CommandError
        The pseudonym is empty or has other characters than letters, digits, '-' and '_'.
    """
    if not subject or not subject.replace("-", "").replace("_", "").isalnum():
        raise CommandError(
            f"subject = '{subject}' is refused; a pseudonym has letters, digits, '-' and '_' only"
        )
    return CourseRecord(subject, course.title, course.digest)
