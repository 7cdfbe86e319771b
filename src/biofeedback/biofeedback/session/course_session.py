"""One session of a conditioning course, trial by trial: when a perturbation may be given, which
reflex is a success.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from biofeedback.errors import CommandError
from biofeedback.session.course import CONDITIONED, CONTROL, MEASURES, Course


@dataclass(frozen=True)
class Trial:
    """Holds one trial of a session.

    Attributes
    ----------
    kind
        `CONTROL` or `CONDITIONED`.
    block
        From 1; 0 for the control trials before the blocks.
    size
        Of the reflex, in the course's unit.
    criterion
        That held; None for a control trial.
    success
        None for a control trial.
    """

    kind: str
    block: int
    size: float
    criterion: float | None
    success: bool | None


class TrialGate:
    """Says when a perturbation may be given.

    Both windows must be held, and the last perturbation must be long enough ago.

    Parameters
    ----------
    course
        Gives windows, duration and interval.

    Attributes
    ----------
    held
        For how long both windows have been held [s].
    """

    def __init__(self, course: Course) -> None:
        self._course = course
        self.held = 0.0
        self._was_within = False
        self._since_trial = math.inf
        self._last: float | None = None

    def update(self, now: float, torque: float, emg: float) -> bool:
        """Process the present background; return whether a perturbation may be given now.

        Parameters
        ----------
        now
            Time [s].
        torque
            Torque of the subject [N.m].
        emg
            Of the muscle, rectified and smoothed [MVC].
        """
        passed = 0.0 if self._last is None else max(now - self._last, 0.0)
        self._last = now
        self._since_trial += passed
        within = self._course.background.within(torque, emg)
        self.held = self.held + passed if within and self._was_within else 0.0
        self._was_within = within
        return (
            self.held >= self._course.background.duration
            and self._since_trial >= self._course.trial_interval
        )

    def given(self) -> None:
        """Note that a perturbation was given: the background must be held anew."""
        self.held = self._since_trial = 0.0


class CourseSession:
    """Follows one session of a course, trial by trial.

    Parameters
    ----------
    course
        The plan of the course.
    number
        Of the session, from 1.
    """

    def __init__(self, course: Course, number: int) -> None:
        if not 1 <= number <= course.sessions:
            raise CommandError(f"session = {number} is refused; allowed: 1 to {course.sessions}")
        self.course = course
        self.number = number
        self.trials: list[Trial] = []
        self._criterion: float | None = None

    @property
    def conditioning(self) -> bool:
        """Tell whether this session conditions the reflex."""
        return self.number > self.course.baseline_sessions

    @property
    def planned(self) -> int:
        """Return the number of trials of the whole session."""
        blocks = self.course.blocks * self.course.trials_per_block
        return blocks + (self.course.control_trials if self.conditioning else 0)

    @property
    def finished(self) -> bool:
        """Tell whether all trials were done."""
        return len(self.trials) >= self.planned

    @property
    def block(self) -> int:
        """Return the block of the next trial, from 1; 0 before the blocks."""
        first = self.course.control_trials if self.conditioning else 0
        done = len(self.trials) - first
        return 0 if done < 0 else done // self.course.trials_per_block + 1

    @property
    def criterion(self) -> float | None:
        """Return the criterion of the next trial; None where it is a control trial."""
        if not self.conditioning or self.block == 0 or self.finished:
            return None
        if self._criterion is None:
            self._criterion = self.course.criterion(self._before(self.block))
        return self._criterion

    def _before(self, block: int) -> np.ndarray:
        """Give the reflexes from which the criterion of a block comes."""
        return np.array([trial.size for trial in self.trials if trial.block == block - 1])

    def record(self, size: float) -> Trial:
        """Process the reflex of the next trial.

        Parameters
        ----------
        size
            In the course's unit.

        Raises
        ------
        CommandError
            The session is finished, or the reflex is not a number.
        """
        if self.finished:
            raise CommandError(f"session {self.number} has all its {self.planned} trials")
        if not math.isfinite(size):
            raise CommandError(f"a reflex of {size} {MEASURES[self.course.measure]} is no trial")
        block, criterion = self.block, self.criterion
        success = None if criterion is None else self.course.success(size, criterion)
        kind = CONTROL if criterion is None else CONDITIONED
        trial = Trial(kind, block, float(size), criterion, success)
        self.trials.append(trial)
        if self.block != block:
            self._criterion = None  # of the next block: it follows the subject
        return trial

    @property
    def success_rate(self) -> float:
        """Return the share of successes so far; NaN before the first conditioned trial."""
        known = [trial.success for trial in self.trials if trial.success is not None]
        return sum(known) / len(known) if known else math.nan

    def mean(self, kind: str) -> float:
        """Return the mean reflex of the trials of a kind; NaN where there is none."""
        sizes = [trial.size for trial in self.trials if trial.kind == kind]
        return float(np.mean(sizes)) if sizes else math.nan
