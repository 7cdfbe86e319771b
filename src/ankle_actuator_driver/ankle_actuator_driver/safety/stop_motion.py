"""The movement that brings the plate from any motion to rest: the velocity falls as ``1 - 3 s^2 + 2
s^3``.

Among all movements from velocity v, without acceleration, to rest within T it has the least mean
squared jerk (the minimum-jerk criterion of Flash & Hogan, J Neurosci 5:1688, 1985, with a free end
position). It never moves faster than v, never turns round, its largest deceleration is 1.5 v / T,
and it ends v T / 2 further on.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TypeVar

import numpy as np

Number = TypeVar("Number", float, np.ndarray)

GENTLE_DECELERATION = 400.0
"""[rad/s^2] Deceleration of a stop where there is room: what the paper's own perturbation has, 5.5
N.m on its foot and footplate. From the 5 rad/s of the velocity limit a stop then takes 19 ms."""


def stopping_distance(velocity: Number, deceleration: float) -> Number:
    """Return how far [rad] a stop from a velocity [rad/s] goes: ``0.75 v^2 / a``.

    Here a is the largest deceleration of the stop [rad/s^2].
    """
    return 0.75 * velocity * velocity / deceleration


@dataclass(frozen=True)
class StopMotion:
    """Computes the motion of one stop.

    Attributes
    ----------
    position
        Where it begins [rad].
    velocity
        With which it begins [rad/s].
    duration
        T [s].
    """

    position: float
    velocity: float
    duration: float

    @classmethod
    def plan(
        cls, position: float, velocity: float, angle: float, acceleration: float
    ) -> StopMotion:
        """Plan a gentle stop, or one that is just sharp enough to end within the angle limit.

        Parameters
        ----------
        position, velocity
            Of the plate's command [rad, rad/s].
        angle
            Largest angle that is allowed [rad].
        acceleration
            Limit, which the stop keeps [rad/s^2].
        """
        speed = abs(velocity)
        if speed == 0.0:
            return cls(position, 0.0, 0.0)
        duration = 1.5 * speed / min(GENTLE_DECELERATION, acceleration)
        room = angle - position * (1.0 if velocity > 0 else -1.0)
        if 0.5 * speed * duration > room:
            duration = 2.0 * max(room, 0.0) / speed
        return cls(position, velocity, max(duration, 1.5 * speed / acceleration))

    def at(self, time: float) -> tuple[float, float, float]:
        """Return position [rad], velocity [rad/s] and acceleration [rad/s^2] at a time [s]."""
        if time >= self.duration:
            return self.position + 0.5 * self.velocity * self.duration, 0.0, 0.0
        s = max(time, 0.0) / self.duration
        return (
            self.position + self.velocity * self.duration * (s - s**3 + 0.5 * s**4),
            self.velocity * (1.0 - 3.0 * s**2 + 2.0 * s**3),
            self.velocity / self.duration * 6.0 * (s**2 - s),
        )
