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

from dataclasses import dataclass
from typing import Any

import numpy as np

from ankle_interfaces.topics import MUSCLES
from biofeedback.errors import CommandError, ProtocolError
from biofeedback.session.check_list import checked_names
from biofeedback.session.plan_file import check_keys, load_plan

CONTROL, CONDITIONED = "control", "conditioned"
UP, DOWN = "up", "down"
MEASURES = {"reflex_emg": "V.s", "G": "N.m.s/rad"}
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


def load_course(name: str) -> Course:
    """Load a course by the name of one in the package, or by the path of a YAML file.

    Raises
    ------
    ProtocolError
        No such file, not YAML, a key that is missing, unknown or out of range.
    """
    content, digest = load_plan(name, "config/courses", "course")
    return _course(content, name, digest)


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
