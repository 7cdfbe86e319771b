"""A torque limit that yields: beyond the limit the plate follows the foot (admittance) instead of
pushing on.

    e = torque - limit (above the limit), torque + limit (below -limit), 0 between       [N.m]
    u = -e / b, at most `LARGEST_YIELD_VELOCITY`;  where e = 0: u = -y / `RETURN_TIME`
    y'' = (u - y') / lag

y is added to the reference, and u is the velocity that y approaches.

Torque is what is needed to move the ankle: torque above the limit falls when the plate goes back,
y' < 0.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np

LARGEST_YIELD_VELOCITY = 1.0
"""[rad/s] Largest velocity of the yielding: a fifth of the velocity limit, so that reference and
yielding together keep it."""
RETURN_TIME = 2.0
"""[s] Time constant of the way back to the reference: slow enough that nobody takes it for a
perturbation.
"""


@dataclass(frozen=True)
class Admittance:
    """Describes how a plate yields.

    Attributes
    ----------
    damping
        b, torque above the limit for each rad/s of yielding [N.m.s/rad].
    lag
        Time constant of the yielding velocity [s].
    """

    damping: float
    lag: float


RIG_ADMITTANCE = Admittance(20.0, 0.005)
"""The admittance of the rig itself: with a loop delay of 20 ms (servo 7 ms, one servo cycle, the
lag) b = 20 stays stable, K * delay / b < 0.5, up to 500 N.m/rad, more than any contracted ankle. 10
N.m above the limit then yields with 0.5 rad/s."""
DRIVER_ADMITTANCE = Admittance(200.0, 0.05)
"""The admittance of the driver, for a reference that leaves 0.1 s before its time: the torque comes
a block later, a delay of 0.2 s; stable up to the same 500 N.m/rad with b = 200. It acts where the
rig's own does not hold the limit. A reference further ahead needs more, see `TorqueYield.soften`.
"""
STIFFEST_JOINT = 500.0
"""[N.m/rad] Largest stiffness with which yielding is stable: K * delay / b < 0.5."""
BLOCK_DELAY = 0.1
"""[s] Delay from a measured torque to the next sample of reference, beside the time that the
reference is ahead: a block each way and the servo."""


class TorqueYield:
    """Computes the offset by which the plate gives way.

    Parameters
    ----------
    admittance
        How the plate gives way to a torque.
    limit
        Torque from which the plate gives way [N.m].

    Attributes
    ----------
    excess
        Torque beyond the limit [N.m], 0 within it.
    offset
        y [rad].
    velocity
        y' [rad/s].
    """

    def __init__(self, admittance: Admittance, limit: float) -> None:
        self.limit = limit
        self.excess = 0.0
        self.offset = 0.0
        self.velocity = 0.0
        self._admittance = admittance

    def measure(self, torque: float) -> None:
        """Take in the present torque [N.m]."""
        self.excess = (
            torque - math.copysign(self.limit, torque) if abs(torque) > self.limit else 0.0
        )

    def soften(self, ahead: float) -> None:
        """Keep the yielding stable for a reference that leaves so long [s] before its time."""
        least = 2.0 * STIFFEST_JOINT * (ahead + BLOCK_DELAY)
        self._admittance = replace(DRIVER_ADMITTANCE, damping=max(DRIVER_ADMITTANCE.damping, least))

    def step(self, interval: float) -> tuple[float, float, float]:
        """Return the offset one interval [s] later: position [rad], velocity, acceleration."""
        if self.excess == 0.0 and self.offset == 0.0 and self.velocity == 0.0:
            return 0.0, 0.0, 0.0
        goal = (
            -self.excess / self._admittance.damping if self.excess else -self.offset / RETURN_TIME
        )
        goal = min(max(goal, -LARGEST_YIELD_VELOCITY), LARGEST_YIELD_VELOCITY)
        share = 1.0 - math.exp(-interval / self._admittance.lag)
        before = self.velocity
        self.velocity += share * (goal - before)
        self.offset += 0.5 * (before + self.velocity) * interval
        if not self.excess and abs(self.offset) < 1e-9 and abs(self.velocity) < 1e-9:
            self.offset = self.velocity = 0.0
        return self.offset, self.velocity, (self.velocity - before) / interval

    def stretch(self, count: int, interval: float) -> np.ndarray:
        """Return the offset over so many samples, shape (count, 3).

        The columns are position, velocity and acceleration.
        """
        return np.array([self.step(interval) for _ in range(count)]).reshape(count, 3)

    def forget(self) -> None:
        """Begin again at the present place.

        The plate stands still there, or a new reference starts from there.
        """
        self.excess = self.offset = self.velocity = 0.0
