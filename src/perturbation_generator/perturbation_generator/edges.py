"""Shapes of one edge: how a position gets from one level to the next.

Each shape is a unit step s(age) with its analytic velocity and acceleration; age is the time since
the edge began.

* block:       s = 1
* filtered:    s = 1 - e^(-ζωt) (cos ω_d t + ζω/ω_d sin ω_d t),  ω_d = ω √(1 - ζ²): the block behind
  a second-order low-pass
* polynomial:  s = 10u³ - 15u⁴ + 6u⁵,  u = t / T: velocity and acceleration are zero at both ends

Source: van 't Veld et al. 2018, section II-B and figure 2.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, Value


@dataclass(frozen=True)
class Extremes:
    """Holds upper bounds of the absolute position [rad], velocity [rad/s] and acceleration
    [rad/s^2] of a signal.
    """

    position: float
    velocity: float
    acceleration: float


class Shape(ABC):
    """Describes the shape of one edge of unit height.

    Attributes
    ----------
    name
        Value of the parameter ``shape``.
    """

    name: ClassVar[str]

    @property
    def length(self) -> float:
        """Return the shortest time [s] from one edge to the next; 0 where edges may overlap."""
        return 0.0

    @property
    @abstractmethod
    def settling(self) -> float:
        """Return the time [s] after which the edge is over, to the last bit of a double."""

    @abstractmethod
    def unit(
        self, age: np.ndarray, count: np.ndarray, rate: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the position [1], velocity [1/s] and acceleration [1/s^2] of the edge, shape (n,).

        Parameters
        ----------
        age
            Time since the edge began [s], >= 0, shape (n,).
        count
            Samples since the first sample of the edge, 0, 1, ..., shape (n,).
        rate
            Sampling rate [Hz].
        """

    @abstractmethod
    def extremes(self, step: float, spacing: float, rate: float) -> Extremes:
        """Return bounds for a train of edges.

        Parameters
        ----------
        step
            Largest height of an edge [rad].
        spacing
            Shortest time between the starts of two edges [s].
        rate
            Sampling rate [Hz].

        Returns
        -------
        Extremes
            ``position`` is how far the train passes beyond its levels (overshoot), not the levels
            themselves.
        """


@dataclass(frozen=True)
class Block(Shape):
    """Moves by an instant step.

    Its velocity is infinite in theory; sampled, the position moves by the whole step in one sample.
    Velocity and acceleration are given as that: first and second backward difference of the
    samples.
    """

    name: ClassVar[str] = "block"

    @property
    def settling(self) -> float:
        """See `Shape.settling`."""
        return 0.0

    def unit(
        self, age: np.ndarray, count: np.ndarray, rate: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `Shape.unit`."""
        first, second = count == 0, count == 1
        return np.ones(len(age)), rate * first, rate**2 * (first.astype(float) - second)

    def extremes(self, step: float, spacing: float, rate: float) -> Extremes:
        """See `Shape.extremes`: the step per sample."""
        return Extremes(0.0, step * rate, step * rate**2)


@dataclass(frozen=True)
class Filtered(Shape):
    """Moves by a step behind a second-order low-pass.

    Attributes
    ----------
    bandwidth
        Natural frequency ω / 2π [Hz] (the -3 dB frequency is within 1 % of it at a damping of 0.7).
    damping
        Ζ [1], below 1.
    """

    name: ClassVar[str] = "filtered"
    bandwidth: float = 30.0
    damping: float = 0.7

    def __post_init__(self) -> None:
        BANDWIDTH.check(self.bandwidth)
        DAMPING.check(self.damping)

    @property
    def settling(self) -> float:
        """See `Shape.settling`: e^-37 is below the last bit of a double."""
        return 37.0 / (self.damping * self._omega)

    @property
    def _omega(self) -> float:
        return 2 * math.pi * self.bandwidth

    @property
    def _root(self) -> float:
        return math.sqrt(1 - self.damping**2)

    def unit(
        self, age: np.ndarray, count: np.ndarray, rate: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `Shape.unit`."""
        omega, sigma = self._omega, self.damping * self._omega
        damped = omega * self._root
        decay, sine, cosine = np.exp(-sigma * age), np.sin(damped * age), np.cos(damped * age)
        position = 1 - decay * (cosine + sigma / damped * sine)
        velocity = omega**2 / damped * decay * sine
        acceleration = omega**2 * decay * (cosine - sigma / damped * sine)
        return position, velocity, acceleration

    def extremes(self, step: float, spacing: float, rate: float) -> Extremes:
        """See `Shape.extremes`: the newest edge at its peak plus what the edges before it can still
        add at worst.
        """
        omega, zeta, root = self._omega, self.damping, self._root
        # Envelope of 1 - s at the ages of earlier edges; those of velocity and acceleration are ω
        # and ω² times it.
        envelope = (
            np.exp(-zeta * omega * spacing * np.arange(1, 1 + math.ceil(self.settling / spacing)))
            / root
        )
        overshoot = math.exp(-zeta * math.pi / root)
        fastest = omega * math.exp(-zeta / root * math.acos(zeta))
        return Extremes(
            step * (overshoot + float(np.minimum(1.0, envelope).sum())),
            step * (fastest + omega * float(envelope.sum())),
            step * omega**2 * (1 + float(envelope.sum())),
        )


@dataclass(frozen=True)
class Polynomial(Shape):
    """Moves by a 5th-order polynomial of a given duration [s]; 24 ms in the paper."""

    name: ClassVar[str] = "polynomial"
    duration: float = 0.024

    def __post_init__(self) -> None:
        if not self.duration > 0:
            raise QuantityError(
                f"a polynomial edge must last longer than 0 s, got {self.duration:g} s"
            )

    @property
    def length(self) -> float:
        """See `Shape.length`: edges do not overlap."""
        return self.duration

    @property
    def settling(self) -> float:
        """See `Shape.settling`."""
        return self.duration

    def unit(
        self, age: np.ndarray, count: np.ndarray, rate: float
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """See `Shape.unit`."""
        u = np.minimum(age / self.duration, 1.0)
        position = u**3 * (10 - 15 * u + 6 * u**2)
        velocity = 30 * u**2 * (1 - u) ** 2 / self.duration
        acceleration = 60 * u * (1 - u) * (1 - 2 * u) / self.duration**2
        return position, velocity, acceleration

    def extremes(self, step: float, spacing: float, rate: float) -> Extremes:
        """See `Shape.extremes`: s' is largest at u = 1/2 (15/8), s'' at u = 1/2 ± 1/√12 (10/√3)."""
        return Extremes(
            0.0, step * 15 / 8 / self.duration, step * 10 / math.sqrt(3) / self.duration**2
        )


SHAPE = Quantity(
    "shape",
    default=Polynomial.name,
    description="Shape of each edge (paper, figure 2).",
    choices=(Block.name, Filtered.name, Polynomial.name),
    start_only=True,
)
# 30 Hz is the most that the paper's actuator reached with this perturbation.
BANDWIDTH = Quantity(
    "bandwidth",
    "Hz",
    1.0,
    250.0,
    Filtered.bandwidth,
    description="Natural frequency of shape 'filtered'.",
    start_only=True,
)
# A damping of 0.7 is the usual tuning of a position servo: the highest bandwidth with an overshoot
# below 5 %.
DAMPING = Quantity(
    "damping",
    "1",
    0.3,
    0.99,
    Filtered.damping,
    description="Damping of shape 'filtered'.",
    start_only=True,
)
EDGE_DURATION = Quantity(
    "edge_duration",
    "s",
    0.005,
    0.2,
    Polynomial.duration,
    description="Duration of an edge of shape 'polynomial' (paper: 24 ms).",
    start_only=True,
)
SHAPE_PARAMETERS = (SHAPE, BANDWIDTH, DAMPING, EDGE_DURATION)


def shape_from(values: Mapping[str, Value]) -> Shape:
    """Return the shape that the values of `SHAPE_PARAMETERS` describe."""
    if values[SHAPE.name] == Block.name:
        return Block()
    if values[SHAPE.name] == Filtered.name:
        return Filtered(float(values[BANDWIDTH.name]), float(values[DAMPING.name]))
    return Polynomial(float(values[EDGE_DURATION.name]))
