"""A train of edges between levels, evaluated at any samples: x(t) = level before + Σ step_i s(t -
t_i).
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

import numpy as np

from perturbation_generator.edges import Shape

# An edge that falls on a sample belongs to it, whatever the rounding of time times rate.
INDEX_ROUNDING = 1e-6  # samples


@dataclass(frozen=True)
class _Edge:
    time: float
    first: int
    step: float
    level: float


class EdgeTrain:
    """Samples edges that are added in the order of their times.

    Edges are held at their exact times, not at samples, and every sample is evaluated by itself, so
    the signal is the same whatever the rate and in whatever blocks it is read.

    Parameters
    ----------
    shape
        Shape of every edge.
    rate
        Sampling rate [Hz].
    """

    def __init__(self, shape: Shape, rate: float) -> None:
        self._shape = shape
        self._rate = rate
        self._last = math.ceil(shape.settling * rate) + 2
        self._moving: deque[_Edge] = deque()
        self._settled = 0.0
        self.level = 0.0

    def add(self, time: float, level: float) -> None:
        """Add an edge that starts at a time [s] and goes to a level."""
        first = math.ceil(time * self._rate - INDEX_ROUNDING)
        self._moving.append(_Edge(time, first, level - self.level, level))
        self.level = level

    def drop_from(self, time: float) -> float:
        """Drop the edges that start at a time [s] or later, all samples before having been given.

        Returns
        -------
        float
            When the last edge that is left starts [s]; minus infinity where none moves any more.
        """
        while self._moving and self._moving[-1].time >= time:
            self._moving.pop()
        self.level = self._moving[-1].level if self._moving else self._settled
        return self._moving[-1].time if self._moving else -math.inf

    def samples(self, first: int, n: int) -> np.ndarray:
        """Return value, derivative and second derivative at samples first ...

        first + n - 1, shape (n, 3).
        """
        while self._moving and self._moving[0].first + self._last <= first:
            self._settled = self._moving.popleft().level
        out = np.zeros((n, 3))
        filled = 0
        level = self._settled
        for edge in self._moving:
            end = min(max(edge.first + self._last - first, 0), n)
            out[filled:end, 0] = level
            filled, level = end, edge.level
        out[filled:, 0] = level
        for edge in self._moving:
            start, end = max(edge.first - first, 0), min(edge.first + self._last - first, n)
            if start >= end:
                continue
            k = np.arange(first + start, first + end)
            age = np.maximum(k / self._rate - edge.time, 0.0)
            for column, values in enumerate(self._shape.unit(age, k - edge.first, self._rate)):
                out[start:end, column] += edge.step * values
        return out
