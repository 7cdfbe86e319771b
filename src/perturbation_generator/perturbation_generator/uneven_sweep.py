"""Sweeps of uneven speed: each keeps its direction, while its speed jumps between two values.

Dry friction does not change while a plate keeps moving one way. What is left between torque and
motion is linear there.

    v(t) = Σ Δv_i s(u_i),   x(t) = x_0 + Σ Δv_i T S(u_i),   u_i = (t - t_i) / T

s is the polynomial edge (`edges.Polynomial`), and S its integral: 5/2 u⁴ - 3 u⁵ + u⁶, and u - 1/2
behind the edge.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from perturbation_generator.edge_train import INDEX_ROUNDING
from perturbation_generator.edges import Extremes, Polynomial

SPEEDS = (4.5, 18.0)
"""[1/s] Slow and fast speed, in amplitudes a second. The slow one is twice what a servo with a
damping of 0.5 falls short by, a sixth of the difference, so that the plate does not stop."""
EDGE_TIME = 0.008
"""[s] From one speed to the next: fast enough for 100 Hz, slow against the acceleration of a step
of the same amplitude within 24 ms."""
LONGEST_HOLD = 0.03
"""[s] Of one speed; how long is random, so that all frequencies of 5 to 100 Hz are excited."""
LONGEST_SWEEP = 2.0 / SPEEDS[0] + 2.0 * EDGE_TIME
"""[s] No sweep from one end of the range to the other takes longer."""

_SHAPE = Polynomial(EDGE_TIME)


@dataclass(frozen=True)
class UnevenSweep:
    """Holds one sweep between two levels, at rest before and behind it.

    Attributes
    ----------
    time
        At which it starts [s].
    start, target
        Levels [rad].
    edges
        Start of each change of the speed, after `time` [s], shape (m,).
    changes
        Of the speed [rad/s], shape (m,).
    """

    time: float
    start: float
    target: float
    edges: np.ndarray
    changes: np.ndarray

    @classmethod
    def drawn(
        cls,
        time: float,
        start: float,
        target: float,
        amplitude: float,
        random: np.random.Generator,
    ) -> UnevenSweep:
        """Return a sweep whose speed changes at random times.

        Parameters
        ----------
        time
            At which it starts [s].
        start, target
            Levels [rad], at least half an amplitude apart.
        amplitude
            Of the signal [rad], by which `SPEEDS` are scaled.
        random
            Where the times come from.
        """
        speeds = [amplitude * speed for speed in SPEEDS]
        kind = int(random.integers(2))
        now = before = 0.0
        left = abs(target - start)
        edges, changes = [], []
        while True:
            speed, other = speeds[kind], speeds[1 - kind]
            edges.append(now)
            changes.append(speed - before)
            now += EDGE_TIME
            left -= 0.5 * (before + speed) * EDGE_TIME
            # Without the edge that ends at rest.
            free = left - 0.5 * speed * EDGE_TIME
            hold = float(random.uniform(0.0, LONGEST_HOLD))
            if free - speed * hold < other * EDGE_TIME:
                edges.append(now + free / speed)
                changes.append(-speed)
                break
            now += hold
            left -= speed * hold
            before, kind = speed, 1 - kind
        direction = math.copysign(1.0, target - start)
        return cls(time, start, target, np.array(edges), direction * np.array(changes))

    @property
    def end(self) -> float:
        """Return the time at which it is at rest again [s]."""
        return self.time + float(self.edges[-1]) + EDGE_TIME

    def values(self, time: np.ndarray) -> np.ndarray:
        """Return position [rad], velocity [rad/s] and acceleration [rad/s^2], shape (n, 3).

        Parameters
        ----------
        time
            Within the sweep [s], shape (n,).
        """
        age = np.maximum(time[:, None] - self.time - self.edges, 0.0)
        u = np.minimum(age / EDGE_TIME, 1.0)
        moved = EDGE_TIME * (2.5 * u**4 - 3.0 * u**5 + u**6) + np.maximum(age - EDGE_TIME, 0.0)
        speed, acceleration, _ = _SHAPE.unit(age.ravel(), np.ones(age.size), 1.0)
        parts = [moved, speed.reshape(age.shape), acceleration.reshape(age.shape)]
        out = np.column_stack([part @ self.changes for part in parts])
        out[:, 0] += self.start
        return out


class SweepTrain:
    """Samples sweeps that are added in the order of their times.

    Parameters
    ----------
    rate
        Sampling rate [Hz].
    """

    def __init__(self, rate: float) -> None:
        self._rate = rate
        self._moving: deque[UnevenSweep] = deque()
        self._settled = 0.0

    def add(self, sweep: UnevenSweep) -> None:
        """Add a sweep that starts where the one before ended, or later."""
        self._moving.append(sweep)

    def drop_from(self, time: float) -> tuple[float, float]:
        """Drop the sweeps that start at a time [s] or later, all samples before having been given.

        Returns
        -------
        tuple[float, float]
            When the last sweep that is left ends [s], minus infinity where none moves any more; and
            the level where the plate then is [rad].
        """
        while self._moving and self._moving[-1].time >= time:
            self._moving.pop()
        if not self._moving:
            return -math.inf, self._settled
        return self._moving[-1].end, self._moving[-1].target

    def samples(self, first: int, n: int) -> np.ndarray:
        """Return position, velocity and acceleration at samples first ... first + n - 1, shape
        (n, 3).
        """
        while self._moving and self._index(self._moving[0].end) <= first:
            self._settled = self._moving.popleft().target
        out = np.zeros((n, 3))
        filled, level = 0, self._settled
        for sweep in self._moving:
            start, end = (
                min(max(self._index(time) - first, 0), n) for time in (sweep.time, sweep.end)
            )
            out[filled:start, 0] = level
            out[start:end] = sweep.values((first + np.arange(start, end)) / self._rate)
            filled, level = end, (sweep.target if end < n else level)
        out[filled:, 0] = level
        return out

    def _index(self, time: float) -> int:
        """Return the first sample at or after a time."""
        return math.ceil(time * self._rate - INDEX_ROUNDING)


def extremes(amplitude: float) -> Extremes:
    """Return bounds of the sweeps of a signal with an amplitude [rad]."""
    fastest = amplitude * SPEEDS[1]
    edge = _SHAPE.extremes(fastest, EDGE_TIME, 1.0)
    return Extremes(amplitude, fastest, edge.velocity)
