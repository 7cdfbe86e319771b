"""A conditioning course: many sessions in which a subject learns to change one reflex.

The procedure is operant conditioning of a spinal reflex as Thompson, Chen and Wolpaw describe it
(J Neurosci 29:5784, 2009: soleus H-reflex; 6 baseline and 24 conditioning sessions, three a week,
225 trials each). Here the reflex is the EMG response to the rig's stretch, or G.

A baseline session has control trials only: the subject gets no feedback on the reflex. A
conditioning session begins with a few control trials; then come blocks of conditioned trials, in
which a reflex beyond the criterion is a success. The criterion is a quantile of the subject's own
reflexes just before (the control trials for the first block, the block before for the others), so
that a subject who does not change succeeds at a rate that is known.
"""

from __future__ import annotations

import hashlib
import math
from dataclasses import dataclass
from typing import Any

import numpy as np

from ankle_interfaces.yaml_text import YamlError, load_named
from biofeedback.errors import CommandError, ProtocolError
from biofeedback.session.check_list import checked_names
from biofeedback.session.plan_keys import check_keys

CONTROL, CONDITIONED = "control", "conditioned"
UP, DOWN = "up", "down"
MEASURES = {"reflex_emg": "V.s", "G": "N.m.s/rad"}
MUSCLES = ("SOL", "TA", "GL", "GM")
LEAST_TRIALS = 10
"""Least number of reflexes for a criterion: of fewer, a quantile is little better than a guess."""
RECENT_TRIALS = 75
"""Largest number of reflexes that a criterion uses, the latest ones: one block of the published
course."""


@dataclass(frozen=True)
class _Range:
    lower: float
    upper: float
    whole: bool = False


_TOP: dict[str, _Range] = {
    "baseline_sessions": _Range(1, 50, True),
    "conditioning_sessions": _Range(1, 200, True),
    "sessions_per_week": _Range(1, 7),
    "control_trials": _Range(LEAST_TRIALS, 500, True),
    "blocks": _Range(1, 20, True),
    "trials_per_block": _Range(LEAST_TRIALS, 500, True),
    "success_rate[1]": _Range(0.1, 0.9),
    "trial_interval[s]": _Range(0.5, 60.0),
    "break[s]": _Range(0.0, 3600.0),
}
_BACKGROUND: dict[str, _Range] = {
    "torque[N.m]": _Range(-30.0, 30.0),
    "torque_half_width[N.m]": _Range(0.05, 20.0),
    "emg_lower[MVC]": _Range(0.0, 1.0),
    "emg_upper[MVC]": _Range(0.0, 1.0),
    "duration[s]": _Range(0.1, 30.0),
}
"""Ranges of a course file: beyond, a slip of the keyboard is more likely than a plan."""


@dataclass(frozen=True)
class Background:
    """Describes the state that the subject holds before a perturbation is given.

    Attributes
    ----------
    torque, torque_half_width
        Window of the subject's torque [N.m], plantarflexion negative.
    emg_lower, emg_upper
        Window of the muscle's rectified EMG, in parts of its maximal voluntary contraction.
    duration
        How long both windows must be held [s].
    """

    torque: float
    torque_half_width: float
    emg_lower: float
    emg_upper: float
    duration: float

    def within(self, torque: float, emg: float) -> bool:
        """Return whether torque [N.m] and EMG [MVC] lie in their windows."""
        return (
            abs(torque - self.torque) <= self.torque_half_width
            and self.emg_lower <= emg <= self.emg_upper
        )


@dataclass(frozen=True)
class Course:
    """Describes a conditioning course for one subject.

    Attributes
    ----------
    title
        Free text.
    measure
        ``reflex_emg`` [V.s] or ``G`` [N.m.s/rad].
    muscle
        Whose EMG is conditioned and held.
    direction
        ``up`` or ``down``.
    baseline_sessions, conditioning_sessions, sessions_per_week
        Their numbers.
    control_trials, blocks, trials_per_block
        Of a conditioning session; a baseline session has control trials in all blocks.
    success_rate
        Share of successes of a subject who does not change.
    trial_interval
        Least time between two perturbations [s].
    break_time
        Least time between two blocks [s].
    background
        What is held before a perturbation.
    check_list
        Names of the checks before the first trial, see `check_list`.
    digest
        Tells one course from another.
    """

    title: str
    measure: str
    muscle: str
    direction: str
    baseline_sessions: int
    conditioning_sessions: int
    sessions_per_week: float
    control_trials: int
    blocks: int
    trials_per_block: int
    success_rate: float
    trial_interval: float
    break_time: float
    background: Background
    check_list: tuple[str, ...]
    digest: str

    @property
    def sessions(self) -> int:
        """Return the number of sessions."""
        return self.baseline_sessions + self.conditioning_sessions

    def criterion(self, sizes: np.ndarray) -> float:
        """Give the size beyond which a reflex is a success.

        Parameters
        ----------
        sizes
            The subject's latest reflexes, shape (n,); not finite ones are left out.

        Raises
        ------
        CommandError
            Fewer than `LEAST_TRIALS`.
        """
        sizes = np.asarray(sizes)[np.isfinite(sizes)][-RECENT_TRIALS:]
        if len(sizes) < LEAST_TRIALS:
            raise CommandError(
                f"a criterion needs {LEAST_TRIALS} measured reflexes; there are {len(sizes)}"
            )
        share = self.success_rate if self.direction == DOWN else 1.0 - self.success_rate
        return float(np.quantile(sizes, share))

    def success(self, size: float, criterion: float) -> bool:
        """Return whether a reflex lies beyond the criterion, in the course's direction."""
        return size <= criterion if self.direction == DOWN else size >= criterion


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


def load_course(name: str) -> Course:
    """Load a course by the name of one in the package, or by the path of a YAML file.

    Raises
    ------
    ProtocolError
        No such file, not YAML, a key that is missing, unknown or out of range.
    """
    try:
        content, text = load_named(name, "biofeedback", "config/courses", "course")
    except YamlError as error:
        raise ProtocolError(str(error)) from None
    return _course(content, name, hashlib.sha256(text.encode()).hexdigest()[:16])


def _course(content: Any, name: str, digest: str) -> Course:
    words = {"course", "measure", "muscle", "direction", "background", "check_list"}
    check_keys(content, words | set(_TOP), set(), name)
    check_keys(content["background"], set(_BACKGROUND), set(), f"{name}: background")
    for key, allowed in (
        ("measure", tuple(MEASURES)),
        ("muscle", MUSCLES),
        ("direction", (UP, DOWN)),
    ):
        if content[key] not in allowed:
            raise ProtocolError(
                f"{name}: {key} = {content[key]!r} is refused; allowed: {', '.join(allowed)}"
            )
    top = {key: _number(content[key], key, limits, name) for key, limits in _TOP.items()}
    held = {
        key: _number(content["background"][key], key, limits, f"{name}: background")
        for key, limits in _BACKGROUND.items()
    }
    if not held["emg_lower[MVC]"] < held["emg_upper[MVC]"]:
        raise ProtocolError(
            f"{name}: background: emg_lower[MVC] = {held['emg_lower[MVC]']:g} is not below "
            f"emg_upper[MVC] = {held['emg_upper[MVC]']:g}"
        )
    return Course(
        title=str(content["course"]),
        measure=content["measure"],
        muscle=content["muscle"],
        direction=content["direction"],
        baseline_sessions=int(top["baseline_sessions"]),
        conditioning_sessions=int(top["conditioning_sessions"]),
        sessions_per_week=top["sessions_per_week"],
        control_trials=int(top["control_trials"]),
        blocks=int(top["blocks"]),
        trials_per_block=int(top["trials_per_block"]),
        success_rate=top["success_rate[1]"],
        trial_interval=top["trial_interval[s]"],
        break_time=top["break[s]"],
        check_list=checked_names(content["check_list"], name),
        background=Background(
            held["torque[N.m]"],
            held["torque_half_width[N.m]"],
            held["emg_lower[MVC]"],
            held["emg_upper[MVC]"],
            held["duration[s]"],
        ),
        digest=digest,
    )


def _number(value: Any, key: str, limits: _Range, where: str) -> float:
    fits = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not fits or not limits.lower <= value <= limits.upper or (limits.whole and value % 1):
        kind = "a whole number from " if limits.whole else ""
        raise ProtocolError(
            f"{where}: {key} = {value!r} is refused; allowed: {kind}{limits.lower:g} to "
            f"{limits.upper:g}"
        )
    return float(value)
