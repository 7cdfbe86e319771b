"""Signals that move by edges from level to level and stand still between them."""

from __future__ import annotations

from abc import abstractmethod
from dataclasses import dataclass

import numpy as np

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Value
from perturbation_generator.edge_train import INDEX_ROUNDING, EdgeTrain
from perturbation_generator.edges import Extremes
from perturbation_generator.settings import Settings
from perturbation_generator.signal import Onset, Signal


@dataclass(frozen=True)
class Cycle:
    """Describes the smallest piece of a sequence that is drawn at once.

    Attributes
    ----------
    edges
        Start [s] after the start of the cycle, and level in multiples of the amplitude.
    length
        [s].
    """

    edges: tuple[tuple[float, float], ...]
    length: float


class StepSequence(Signal):
    """Draws a sequence of cycles. The amplitude is read when a cycle starts and holds for all of
    it.

    During ``ramp_in`` each cycle has the amplitude times its end's share of the ramp. A cycle
    starts only where it ends and settles before ``duration``; after the last one the position
    returns to rest.
    """

    def __init__(self, settings: Settings, **own: Value) -> None:
        super().__init__(settings, **own)
        self._train = EdgeTrain(settings.shape, settings.rate)
        self._random = np.random.default_rng(settings.seed)
        self._start = 0.0
        self._over = False
        shape = settings.shape
        if self.spacing < shape.length * (1 - 1e-9):
            raise QuantityError(
                f"edges of {1e3 * shape.length:g} ms do not fit: signal '{self.name}' starts "
                f"edges {1e3 * self.spacing:g} ms apart"
            )
        shortest = self.longest_cycle + shape.settling
        if settings.end < shortest:
            raise QuantityError(
                f"parameter 'duration' = {settings.duration:g} s is refused; one cycle takes up "
                f"to {shortest:.3g} s"
            )

    @property
    @abstractmethod
    def spacing(self) -> float:
        """Return the shortest time between the starts of two edges [s]."""

    @property
    @abstractmethod
    def longest_cycle(self) -> float:
        """Return the longest cycle that can be drawn [s]."""

    @property
    def largest_step(self) -> float:
        """Return the height of the largest edge in multiples of the amplitude."""
        return 1.0

    @abstractmethod
    def _draw(self) -> Cycle:
        """Return the next cycle."""

    def extremes(self, amplitude: float) -> Extremes:
        """See `Signal.extremes`: levels plus overshoot, for the largest edges as close together as
        they can be.
        """
        edge = self.settings.shape.extremes(
            self.largest_step * amplitude, self.spacing, self.settings.rate
        )
        return Extremes(amplitude + edge.position, edge.velocity, edge.acceleration)

    def _samples(self, first: int, n: int) -> np.ndarray:
        while not self._over and self._start * self.settings.rate - INDEX_ROUNDING <= first + n - 1:
            self._extend()
        return self._train.samples(first, n)

    def _extend(self) -> None:
        cycle = self._draw()
        end = self._start + cycle.length
        if end + self.settings.shape.settling > self.settings.end:
            self._over = True
            self._move(self._start, 0.0)
            return
        ramp = self.settings.ramp_in
        amplitude = self.amplitude * (min(1.0, end / ramp) if ramp > 0 else 1.0)
        for delay, level in cycle.edges:
            self._move(self._start + delay, level * amplitude)
        self._start = end

    def _move(self, time: float, level: float) -> None:
        step = level - self._train.level
        if step != 0.0:
            self._onsets.append(Onset(time, 1 if step > 0 else -1, abs(step)))
            self._train.add(time, level)
