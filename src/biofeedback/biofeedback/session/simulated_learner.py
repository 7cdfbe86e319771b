"""A simulated subject of a conditioning course, who learns at a stated rate or not at all.

The reflex of a trial is ``exp(m + d + e)``: m is what the subject has learnt, d differs from day to
day, e from trial to trial. Learning follows reward: after a success m moves a part of e, towards
what was rewarded. So the change comes about through criterion and feedback; where the session does
not reward, or rewards the wrong side, the subject does not learn, or learns the opposite.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import stats

from biofeedback.session.conditioning import Conditioning, Response
from biofeedback.session.course import Course
from biofeedback.session.course_record import CourseRecord
from biofeedback.session.course_session import CourseSession

TRIAL_SPREAD = 0.30
"""Standard deviation of a reflex' logarithm from trial to trial, an assumption: a third of the size
is what a reflex at a steady background scatters by; the mean of 225 is then sure to 2 %.
"""
DAY_SPREAD = 0.08
"""Standard deviation of a reflex' logarithm from day to day, an assumption: four times what the
mean of a session is unsure by."""
STEP = 0.2
"""[s] Time step of the background's simulation; it is held for seconds."""
BACKGROUND_TIME = 1.5
"""[s] Correlation time of a held torque's slow error."""
BACKGROUND_SPREAD = 0.5
"""Standard deviation of the held background, in half widths of its window."""
REFERENCE_LEAD = 1.0
"""[s] Time from the request of a stretch to its onset, as the rig's reference is sent ahead."""
RESPONSE_DELAY = 0.3
"""[s] Time from an onset to its measured response."""
LONGEST_WAIT = 600.0
"""[s] Time of holding without one trial after which the subject gives up."""


@dataclass(frozen=True)
class Learner:
    """Holds the properties of a simulated subject.

    Attributes
    ----------
    change_per_session
        Change of the reflex in a session of the course in which each trial is rewarded by the
        course's criterion, as a part of it (0.02: 2 %); 0 does not learn.
    size
        Reflex before the course, in the course's unit.
    trial_spread, day_spread
        Standard deviations of its logarithm.
    """

    change_per_session: float = 0.02
    size: float = 50e-6
    trial_spread: float = TRIAL_SPREAD
    day_spread: float = DAY_SPREAD

    def reward_gain(self, course: Course) -> float:
        """Return the part of a rewarded trial's deviation by which the subject moves.

        Of a normal distribution, the lower share p has the mean -phi(z_p) / p standard deviations;
        with n trials of which the share p is rewarded, a session moves by n phi(z_p) deviations.
        """
        trials = course.blocks * course.trials_per_block
        density = float(stats.norm.pdf(stats.norm.ppf(course.success_rate)))
        return abs(math.log1p(-self.change_per_session)) / (trials * density * self.trial_spread)


class SimulatedLearner:
    """Simulates the subject in virtual time.

    Parameters
    ----------
    learner
        What it is like.
    course
        The plan it follows.
    seed
        Seed of all that is random.

    Attributes
    ----------
    level
        What it has learnt: change of the reflex' logarithm since the start.
    time
        Virtual time [s].
    """

    def __init__(self, learner: Learner, course: Course, seed: int = 0) -> None:
        self._learner = learner
        self._course = course
        self._gain = learner.reward_gain(course)
        self._random = np.random.default_rng(seed)
        self._background: np.ndarray = np.zeros(2)
        self.level = 0.0
        self.time = 0.0

    def run_session(self, session: CourseSession) -> None:
        """Do all trials of a session: hold the background, get the perturbation, see the result."""
        day = self._random.normal(0.0, self._learner.day_spread)
        conditioning = Conditioning(session)
        of_emg = self._course.measure == "reflex_emg"
        onset, waited, deviation = math.inf, 0.0, self._deviation()
        while not session.finished:
            self.time += STEP
            size = self._learner.size * math.exp(self.level + day + deviation)
            responses = []
            if self.time >= onset + RESPONSE_DELAY:
                responses, onset = [Response(onset, size)], math.inf
            done = len(session.trials)
            torque, activity = self._hold()
            conditioning.tick(self.time, torque, activity, responses, math.nan if of_emg else size)
            if conditioning.take_request():
                onset = self.time + REFERENCE_LEAD
            waited += STEP
            if len(session.trials) == done:
                if waited > LONGEST_WAIT:
                    raise TimeoutError(
                        f"no trial within {LONGEST_WAIT:g} s: the background was not held"
                    )
                continue
            if session.trials[-1].success:
                self.level += self._gain * deviation
            waited, deviation = 0.0, self._deviation()

    def _deviation(self) -> float:
        return float(self._random.normal(0.0, self._learner.trial_spread))

    def _hold(self) -> tuple[float, float]:
        """Return torque [N.m] and activity [MVC] after one more time step."""
        window = self._course.background
        middle = 0.5 * (window.emg_lower + window.emg_upper)
        half = 0.5 * (window.emg_upper - window.emg_lower)
        keep = math.exp(-STEP / BACKGROUND_TIME)
        fresh = self._random.normal(0.0, math.sqrt(1.0 - keep**2), 2)
        self._background = keep * self._background + fresh
        torque, emg = (BACKGROUND_SPREAD * self._background).tolist()
        return window.torque + torque * window.torque_half_width, middle + emg * half


def run_course(course: Course, record: CourseRecord, subject: SimulatedLearner) -> None:
    """Do all sessions that a record does not have yet, in virtual time."""
    for number in range(record.next_session, course.sessions + 1):
        session = record.resume(course)
        subject.run_session(session)
        week, day = divmod(number - 1, max(int(course.sessions_per_week), 1))
        record.add(session, f"week {week + 1}, day {day + 1}")
