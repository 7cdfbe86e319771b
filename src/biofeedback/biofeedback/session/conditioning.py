"""Leads the trials of one session of a conditioning course: when a perturbation may be given, and
which ones count.

A trial begins when torque and EMG have been in their windows for the stated time; then one
perturbation is asked for. Its onset comes some time later (a reference is sent ahead), and the
trial counts only if the subject was in both windows for the stated time before that onset. A course
of G has a perturbation that goes on by itself: a trial then reads the estimate at the moment at
which the background was held.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from ankle_node.session_event import SessionEvent
from biofeedback.errors import CommandError
from biofeedback.session.axis_calibration import AXIS_END_RATIO, DEFAULT_AXES
from biofeedback.session.course import DOWN, MEASURES, RECENT_TRIALS, Course
from biofeedback.session.course_session import CourseSession, Trial, TrialGate
from biofeedback.session.protocol import BREAK, TRIALS, Protocol, Step

REFLEX, REFLEX_UNIT = "reflex", "µV.s"
"""Feedback of a course of the EMG reflex, beside ``K`` and ``G`` of a protocol, and its unit."""
RESPONSE_TIMEOUT = 6.0
"""[s] Longest wait for the response to a perturbation: the reference is sent up to 1 s ahead, the
reflex is over after 0.2 s, and the EMG processor waits up to 2 s for the measured motion."""
MAX_UNANSWERED_PERTURBATIONS = 3
"""Number of perturbations in a row without a response after which the session pauses: one may be
lost, three are a fault of the set-up."""
BACKGROUND_MEMORY = 10.0
"""[s] For how long it is known when the background was held: longer than any response is awaited.
"""
RESULT_TIME = 2.0
"""[s] For how long the subject reads the result of a trial, as words take to be read twice."""
SHOWN_SCALE = {"reflex_emg": 1e6, "G": 1.0}
"""What a reflex is multiplied by on the screen: an area of EMG is shown in µV.s."""


@dataclass(frozen=True)
class Response:
    """Holds the measured response to a perturbation.

    Attributes
    ----------
    time
        Of the onset [s].
    size
        Of the reflex, in the course's unit; NaN where it could not be measured.
    """

    time: float
    size: float


def course_protocol(course: Course, session: CourseSession) -> Protocol:
    """Return the steps of one session of a course: blocks of trials, with breaks between them."""
    feedback = REFLEX if course.measure == "reflex_emg" else "G"
    torque = course.background.torque
    blocks = range(0 if session.conditioning else 1, course.blocks + 1)
    steps: list[Step] = []
    for block in blocks:
        if block > 1:
            steps.append(Step(BREAK, course.break_time, block - 1, 0, feedback, torque, None))
        steps.append(Step(TRIALS, 0.0, block, 0, feedback, torque, None))
    kind = "conditioning" if session.conditioning else "baseline"
    return Protocol(
        f"{course.title}: session {session.number} of {course.sessions}, {kind}",
        tuple(steps),
        course.background.torque_half_width,
        0.0,
        f"{course.digest}-{session.number}",
        course.check_list,
    )


class Conditioning:
    """Leads the trials of one session, in real or virtual time.

    Parameters
    ----------
    session
        Of the course; it may have trials already.

    Attributes
    ----------
    session
        The same.
    """

    def __init__(self, session: CourseSession) -> None:
        self.session = session
        self._gate = TrialGate(session.course)
        self._held: deque[tuple[float, float]] = deque()
        self._inside_since = math.inf
        self._asked_at: float | None = None
        self._wants_perturbation = False
        self._unanswered = 0
        self._result_at = -math.inf
        self.background_held = False

    @property
    def course(self) -> Course:
        """Return the plan."""
        return self.session.course

    @property
    def waiting(self) -> bool:
        """Tell whether a perturbation was asked for and its response has not come."""
        return self._asked_at is not None

    @property
    def last(self) -> Trial | None:
        """Return the last trial that counted."""
        return self.session.trials[-1] if self.session.trials else None

    def take_request(self) -> bool:
        """Return whether a perturbation has to be given now; asked once for each trial."""
        wanted, self._wants_perturbation = self._wants_perturbation, False
        return wanted

    def interrupt(self) -> None:
        """Forget the trial that is going on, because the session pauses or stops."""
        self._asked_at, self._wants_perturbation = None, False
        self._gate = TrialGate(self.course)
        self._held.clear()
        self._inside_since = math.inf
        self._unanswered = 0
        self.background_held = False

    @property
    def failed(self) -> str:
        """Tell why no trial can go on; empty while they can."""
        if self._unanswered < MAX_UNANSWERED_PERTURBATIONS:
            return ""
        return (
            f"{MAX_UNANSWERED_PERTURBATIONS} perturbations in a row gave no response in "
            f"{self.course.muscle}: is the EMG processor running, and the generator's signal "
            "'on_request'?"
        )

    def tick(
        self,
        now: float,
        torque: float,
        activity: float,
        responses: Sequence[Response],
        G: float = math.nan,
    ) -> list[SessionEvent]:
        """Process the present background and the responses that came meanwhile.

        Parameters
        ----------
        now
            ROS time [s].
        torque
            Torque of the subject [N.m].
        activity
            Of the course's muscle [MVC].
        responses
            Since the last call.
        G
            Estimate for a course of G [N.m.s/rad]; NaN while there is no valid one.
        """
        self._follow_background(now, torque, activity)
        events: list[SessionEvent] = []
        for response in responses:
            if self._asked_at is not None and response.time >= self._asked_at:
                self._asked_at = None
                events += self._judge(now, response)
        if self._asked_at is not None and now - self._asked_at > RESPONSE_TIMEOUT:
            self._asked_at = None
            self._unanswered += 1
            events.append(self._not_counted(now, "no response to the perturbation"))
        may_begin = self._gate.update(now, torque, activity)
        if self._asked_at is None and may_begin and not self.session.finished:
            events += self._begin(now, G)
        return events

    def _follow_background(self, now: float, torque: float, activity: float) -> None:
        self.background_held = self.course.background.within(torque, activity)
        if not self.background_held:
            self._inside_since = math.inf
        elif self._inside_since == math.inf:
            self._inside_since = now
        self._held.append((now, self._inside_since))
        while self._held[0][0] < now - BACKGROUND_MEMORY:
            self._held.popleft()

    def _begin(self, now: float, G: float) -> list[SessionEvent]:
        if self.course.measure == "reflex_emg":
            self._gate.given()
            self._asked_at, self._wants_perturbation = now, True
            return []
        if not math.isfinite(G):
            return []
        self._gate.given()
        return [self._count(now, G)]

    def _judge(self, now: float, response: Response) -> list[SessionEvent]:
        self._unanswered = 0
        since = next(
            (since for time, since in reversed(self._held) if time <= response.time), math.inf
        )
        held = response.time - since
        if held < self.course.background.duration:
            return [self._not_counted(now, "the background was left before the perturbation")]
        if not math.isfinite(response.size):
            return [self._not_counted(now, f"the EMG of {self.course.muscle} was not usable")]
        return [self._count(now, response.size)]

    def _not_counted(self, now: float, reason: str) -> SessionEvent:
        return SessionEvent("trial not counted", now, {"reason": reason})

    def _count(self, now: float, size: float) -> SessionEvent:
        trial = self.session.record(size)
        self._result_at = now
        unit = MEASURES[self.course.measure]
        details: dict[str, object] = {
            "trial": len(self.session.trials),
            "block": trial.block,
            "kind": trial.kind,
            f"{self.course.measure}[{unit}]": float(f"{trial.size:.5g}"),
        }
        if trial.criterion is not None:
            details[f"criterion[{unit}]"] = float(f"{trial.criterion:.5g}")
            details["success"] = bool(trial.success)
        return SessionEvent("trial", now, details)

    # ----- what is shown -----

    def result(self, now: float) -> str:
        """Return ``success`` or ``miss`` for a moment after a conditioned trial; else empty."""
        last = self.last
        if last is None or last.success is None or now - self._result_at > RESULT_TIME:
            return ""
        return "success" if last.success else "miss"

    def region(self) -> tuple[float, float] | None:
        """Return the ends of the rewarded region, as shown; None in control trials."""
        criterion = self.session.criterion
        if criterion is None:
            return None
        shown = criterion * SHOWN_SCALE[self.course.measure]
        return (0.0, shown) if self.course.direction == DOWN else (shown, self.axis()[1])

    def axis(self) -> tuple[float, float]:
        """Return the ends of the axis of the reflex, as shown: from the subject's own trials."""
        sizes = [trial.size for trial in self.session.trials[-RECENT_TRIALS:]]
        scale = SHOWN_SCALE[self.course.measure]
        feedback = REFLEX if self.course.measure == "reflex_emg" else "G"
        first = sizes[: self.course.control_trials]
        if len(first) < self.course.control_trials or (middle := float(np.median(first))) <= 0.0:
            return DEFAULT_AXES[feedback]
        return 0.0, AXIS_END_RATIO * middle * scale

    @property
    def shown_size(self) -> float:
        """Return the reflex of the last trial, as shown; NaN before the first."""
        last = self.last
        return math.nan if last is None else last.size * SHOWN_SCALE[self.course.measure]


def largest_activity(course: Course, checks: Mapping[str, Mapping[str, Any]]) -> float:
    """Return the muscle's activity in the maximal voluntary contraction of the check list [V].

    Raises
    ------
    CommandError
        It was not measured.
    """
    name = "mvc_dorsiflexion" if course.muscle == "TA" else "mvc_plantarflexion"
    found = checks.get(name, {}).get(f"{course.muscle}[V]")
    if found is None or not found > 0.0:
        raise CommandError(
            f"the EMG of {course.muscle} in the largest contraction is not known: do the check "
            f"'{name}' with EMG; the course's background is stated in parts of it"
        )
    return float(found)
