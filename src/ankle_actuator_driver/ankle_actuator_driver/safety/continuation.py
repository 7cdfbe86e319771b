"""Whether a stretch of reference continues what was sent before, and whether the path that the rig
makes of both keeps every limit.

The last sample sent (time, position, velocity, acceleration) is carried from stretch to stretch. A
stretch may follow it directly, after a gap that the rig bridges, or after a longer gap where the
plate rests meanwhile. Everything else is another movement and is refused.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from enum import Enum

import numpy as np

from ankle_actuator_driver.safety.interpolated_path import path_through
from ankle_actuator_driver.safety.limits import Limits

LONGEST_BRIDGE = 0.04
"""[s] Longest gap that is bridged: two blocks of 15.6 ms that were lost on the way are replaced by
one polynomial, whose motion has to keep the limits."""
LONGEST_BUFFER = 2.0
"""[s] Longest stretch of samples ahead of their time: a stop acts at once all the same, so only
memory counts."""
LARGEST_BLOCK = 8192
"""Largest number of samples in a block: two seconds at 4096 Hz. A longer one is a misunderstanding,
and checking it would keep the driver from its line."""
RESUME_MARGIN = 0.01
"""[s] Time by which a reference that begins from rest has to be early: the way to the rig."""
HALF_A_SAMPLE = 0.5
"""Part of the interval by which the time of a sample may be off."""
REST_POSITION, REST_VELOCITY, REST_ACCELERATION = 2e-4, 0.02, 25.0
"""[rad, rad/s, rad/s^2] Two samples that differ by less join without a movement that a subject
feels: a hundredth of the paper's perturbation, 0.4 % of the velocity limit, and the 0.3 N.m that
the paper's foot and footplate need for that acceleration."""
VELOCITY_MISMATCH = 0.02
"""Part of the velocity limit by which the velocity column may contradict the positions. The
paper's edges, whose jerk jumps between samples, are within 0.1 %."""
ACCELERATION_MISMATCH = 0.1
"""Part of the acceleration limit by which the acceleration column may contradict the velocities.
The paper's edges are within 2 %."""


class Verdict(Enum):
    """Names what becomes of a stretch of reference."""

    FOLLOWED = "followed"
    LEFT_OUT = "left out"
    STOPS = "stops the plate"
    FAULT = "fault"


@dataclass(frozen=True)
class Decision:
    """Holds the decision about one stretch.

    Attributes
    ----------
    verdict
        What becomes of it.
    sentence
        Why; empty where it is followed.
    """

    verdict: Verdict
    sentence: str = ""


FOLLOWED = Decision(Verdict.FOLLOWED)


def even_interval(time: np.ndarray) -> float | None:
    """Return the interval between samples [s].

    It is None where they are not evenly spaced, or where there is only one sample.
    """
    if len(time) < 2 or not np.isfinite(time).all():
        return None
    steps = np.diff(time)
    interval = float(time[-1] - time[0]) / len(steps)
    even = interval > 0 and np.abs(steps - interval).max() < HALF_A_SAMPLE * interval
    return interval if even else None


def contradiction(motion: np.ndarray, interval: float, limits: Limits) -> str | None:
    """Return where columns contradict each other, as a sentence; None where they agree.

    Parameters
    ----------
    motion
        Position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 3).
    interval
        Time between two samples [s].
    limits
        Whose parts are the tolerances.
    """
    if len(motion) < 2:
        return None
    x, v, a = motion.T
    # Trapezium rule with its end correction: exact for the cubic in each interval.
    moved = np.diff(x) / interval
    said = 0.5 * (v[1:] + v[:-1]) - interval / 12.0 * np.diff(a)
    worst = int(np.abs(moved - said).argmax())
    if abs(moved[worst] - said[worst]) > VELOCITY_MISMATCH * limits.velocity:
        return (
            f"its velocity column says {said[worst]:.4g} rad/s where its positions move at "
            f"{moved[worst]:.4g} rad/s"
        )
    changed, stated = np.diff(v) / interval, 0.5 * (a[1:] + a[:-1])
    worst = int(np.abs(changed - stated).argmax())
    if abs(changed[worst] - stated[worst]) > ACCELERATION_MISMATCH * limits.acceleration:
        return (
            f"its acceleration column says {stated[worst]:.4g} rad/s^2 where its velocities "
            f"change by {changed[worst]:.4g} rad/s^2"
        )
    return None


class Continuation:
    """Checks each stretch against the last sample that was sent.

    Attributes
    ----------
    end
        ROS time of the last sample sent [s]; NaN before the first one.
    """

    def __init__(self) -> None:
        self.end = math.nan
        self._last: np.ndarray = np.zeros(3)
        self._interval = math.nan

    def begin(self, held: float) -> None:
        """Begin from rest at the position [rad] at which the plate is held."""
        self.end, self._last, self._interval = math.nan, np.array([held, 0.0, 0.0]), math.nan

    def accept(self, time: np.ndarray, motion: np.ndarray) -> None:
        """Remember the last sample of a stretch that is sent."""
        self.end, self._last = float(time[-1]), np.array(motion[-1])
        self._interval = float(time[-1] - time[0]) / (len(time) - 1)

    def order_of(self, time: np.ndarray, interval: float) -> Decision:
        """Return whether a stretch comes in its turn.

        Parameters
        ----------
        time
            ROS times [s], shape (n,), evenly spaced.
        interval
            Time between two samples [s].
        """
        if math.isnan(self.end):
            return FOLLOWED
        if float(time[-1]) < self.end + HALF_A_SAMPLE * interval:
            return Decision(
                Verdict.LEFT_OUT,
                f"a block of the reference that ends {1e3 * (self.end - time[-1]):.1f} ms before "
                "what was sent already came twice or out of order, and is not followed",
            )
        if float(time[0]) < self.end + HALF_A_SAMPLE * interval:
            return Decision(
                Verdict.FAULT,
                f"reference refused: a block begins {1e3 * (self.end - time[0]):.1f} ms before "
                "the end of what was sent: two sources, or one that has started anew",
            )
        return FOLLOWED

    def judge(self, time: np.ndarray, motion: np.ndarray, limits: Limits, ros: float) -> Decision:
        """Decide whether a stretch continues what was sent within the limits.

        The path to the stretch is checked as well as the stretch itself.

        Parameters
        ----------
        time, motion
            As they would be sent: ROS times [s], shape (n,); shape (n, 3).
        limits
            That the path keeps.
        ros
            ROS time now [s].
        """
        interval = float(time[-1] - time[0]) / (len(time) - 1)
        gap = float(time[0]) - self.end
        direct = gap < (1.0 + HALF_A_SAMPLE) * interval
        refused = limits.passed_by(motion, interval, float(self._last[0]) if direct else None)
        refused = refused or self._passed_on_the_path(time, motion, limits)
        if refused:
            return Decision(Verdict.FAULT, f"reference refused: {refused}")
        if direct:
            return FOLLOWED if self._on_time(time, ros) else self._too_late(time, ros)
        if gap <= LONGEST_BRIDGE and self.end > ros:
            return FOLLOWED  # the path over the gap was looked at above
        if not self._rests(motion[0]):
            missing = "" if math.isnan(gap) else f" after a gap of {gap:.3f} s"
            return Decision(
                Verdict.STOPS,
                f"reference refused: it does not continue{missing}: "
                f"{motion[0, 0] - self._last[0]:+.4g} rad from where it ended, at "
                f"{motion[0, 1]:.4g} rad/s",
            )
        return FOLLOWED if float(time[0]) > ros + RESUME_MARGIN else self._too_late(time, ros)

    def _on_time(self, time: np.ndarray, ros: float) -> bool:
        # What follows directly may begin in the past only where the plate stood still meanwhile.
        return self.end > ros or (self._rests(self._last) and float(time[0]) > ros)

    @staticmethod
    def _too_late(time: np.ndarray, ros: float) -> Decision:
        return Decision(
            Verdict.STOPS,
            f"reference refused: it resumes {1e3 * (ros - time[0]):.0f} ms too late; see "
            "perturbation_generator.lead and reference_delay",
        )

    def _rests(self, sample: np.ndarray) -> bool:
        """Return whether the last sample and this one are at rest at the same place."""
        return bool(
            abs(sample[0] - self._last[0]) <= REST_POSITION
            and max(abs(sample[1]), abs(self._last[1])) <= REST_VELOCITY
            and max(abs(sample[2]), abs(self._last[2])) <= REST_ACCELERATION
        )

    def _passed_on_the_path(
        self, time: np.ndarray, motion: np.ndarray, limits: Limits
    ) -> str | None:
        """Return the limit that the interpolated path passes, seam included."""
        gap = float(time[0]) - self.end
        if gap <= LONGEST_BRIDGE:
            whole = path_through(
                np.concatenate([[self.end], time]), np.concatenate([self._last[None], motion])
            )
            if limits.passed_on(whole) is None:
                return None
            seam = path_through(np.array([self.end, time[0]]), np.vstack([self._last, motion[0]]))
            if passed := limits.passed_on(seam):
                return f"on the way from the last block to this one, {passed}"
        passed = limits.passed_on(path_through(time, motion))
        return f"between its samples, {passed}" if passed else None
