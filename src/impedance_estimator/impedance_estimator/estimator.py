"""Every estimator offers this interface and these columns of its result."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import IntEnum
from typing import ClassVar

import numpy as np

from ankle_interfaces.errors import SamplingError
from ankle_interfaces.topics import IMPEDANCE_ESTIMATE, IMPEDANCE_REFLEX_IRF
from impedance_estimator.settings import EstimatorSettings

ESTIMATE_COLUMNS = IMPEDANCE_ESTIMATE.columns
"""Columns of an estimate.

Where ``valid`` is 0 the row holds the last valid estimate, or NaN when there has been none. `doubt`
is NaN from estimators that do not judge themselves.
"""

ESTIMATE_TOPIC, REFLEX_TOPIC = IMPEDANCE_ESTIMATE.absolute, IMPEDANCE_REFLEX_IRF.absolute
"""Names in a bag."""

REFLEX_COLUMNS = IMPEDANCE_REFLEX_IRF.columns
"""Columns of a reflex impulse response."""

TORQUE_COLUMNS = ("t[s]", "torque[N.m]", "intrinsic_torque[N.m]", "reflex_torque[N.m]")
"""Columns of the torque that an estimator saw (filtered) and of its two parts as it predicted them.
"""

LEAST_RATE, LARGEST_RATE = 500.0, 10_000.0
"""[Hz] Below, the 4th-order differences no longer follow a 100 Hz signal; above, nothing was
tested.
"""


class ReflexColumns(IntEnum):
    """Says what samples carry of the reflex, along the motion and along that of the reference."""

    NONE = 0
    """The estimator rectifies the velocity of the samples."""
    STRETCH = 1
    """Rectified velocity of the joint [rad/s], filtered as its torque is on the way to the reading:
    rectification and the lag of a torque sensor do not commute."""
    TORQUE = 2
    """Torque of a reflex with unit gain [N.m]: its shape is held."""


@dataclass(frozen=True)
class SampleLayout:
    """Describes the samples of one stream.

    Attributes
    ----------
    rate
        Sampling rate [Hz].
    measured_velocity
        Whether samples have a velocity.
    reflex
        What stands behind the other columns.
    """

    rate: float
    measured_velocity: bool
    reflex: ReflexColumns = ReflexColumns.NONE


@dataclass(frozen=True)
class Expectation:
    """Describes what is known of a joint before its first sample.

    Attributes
    ----------
    mean
        K [N.m/rad], B [N.m.s/rad], I [kg.m^2], G [N.m.s/rad], ln of the reflex' natural frequency
        [ln rad/s], ln of its damping [1], its delay [s]; shape (7,).
    deviation
        Standard deviation of each about its mean, shape (7,); infinite where nothing is known.
    reflex
        Columns of the reflex that come with the samples, for estimators that use them.
    """

    mean: np.ndarray
    deviation: np.ndarray
    reflex: ReflexColumns = ReflexColumns.NONE


class Estimator(ABC):
    """Estimates K, B, I and G from a stream of samples.

    The result depends on the samples alone, not on how they are split into calls. One row comes out
    after every ``round(rate / estimate_rate)`` samples; its time is the last sample's.

    Parameters
    ----------
    rate
        Sampling rate [Hz], 500 to 10,000.
    measured_velocity
        Whether samples carry a velocity column.
    settings
        Settings of the algorithm; None stands for the defaults.

    Attributes
    ----------
    reflex_columns
        What samples carry of the reflex behind the reference; `expect` announces it.

    Raises
    ------
    SamplingError
        A rate out of range.
    QuantityError
        Settings that do not fit the rate.

    A new estimator is one file in `algorithms`, with a subclass called `Algorithm`.
    """

    name: ClassVar[str]
    """Short name, as in the parameter ``algorithm``."""
    title: ClassVar[str]
    """One line that describes the estimator."""
    settings_type: ClassVar[type[EstimatorSettings]] = EstimatorSettings
    uses_reference: ClassVar[bool] = False
    """Says whether samples carry the reference's position [rad] as their last column, NaN where
    none came.
    """

    def __init__(
        self, rate: float, measured_velocity: bool, settings: EstimatorSettings | None = None
    ) -> None:
        if not LEAST_RATE <= rate <= LARGEST_RATE:
            raise SamplingError(
                f"sampling rate {rate:g} Hz is refused; allowed: {LEAST_RATE:g} to "
                f"{LARGEST_RATE:g} Hz"
            )
        self.rate = rate
        self.measured_velocity = measured_velocity
        self.reflex_columns = ReflexColumns.NONE
        self.settings = self.settings_type() if settings is None else settings

    @property
    def sample_columns(self) -> int:
        """Return the columns of the samples: t, position, velocity where it is measured, torque,
        the reference where the estimator uses it, and both columns of the reflex where there are
        any.
        """
        reflex = 0 if self.reflex_columns is ReflexColumns.NONE else 2
        return 3 + self.measured_velocity + self.uses_reference + reflex

    @property
    def layout(self) -> SampleLayout:
        """Return what the samples are."""
        return SampleLayout(self.rate, self.measured_velocity, self.reflex_columns)

    @abstractmethod
    def process(self, samples: np.ndarray) -> np.ndarray:
        """Take in samples and return the estimates that became due.

        Parameters
        ----------
        samples
            Shape (n, `sample_columns`): t [s], position [rad], velocity [rad/s] where measured,
            torque [N.m], reference position [rad] where used, and `ReflexColumns`.

        Returns
        -------
        np.ndarray
            Shape (k, 13), columns `ESTIMATE_COLUMNS`.

        Raises
        ------
        ValueError
            A shape that does not fit.
        """

    @abstractmethod
    def reset(self) -> None:
        """Forget everything."""

    def expect(self, expectation: Expectation) -> None:
        """Begin anew with what is known beforehand; estimators without prior knowledge ignore it.

        Parameters
        ----------
        expectation
            From a calibrated session.
        """

    @property
    @abstractmethod
    def reason(self) -> str:
        """Say in words why the newest estimate is not valid; empty where it is valid."""

    @property
    @abstractmethod
    def reflex_response(self) -> np.ndarray:
        """Return the newest reflex impulse response, shape (k, 3), columns `REFLEX_COLUMNS`.

        The response h is NaN before the first valid estimate; what a free response adds to it is
        NaN from estimators that do not tell both apart, and from a memory that is too short.
        """

    @property
    def reflex_deviation(self) -> tuple[float, float]:
        """Return the area of what a free reflex response adds to that of a muscle, and its standard
        error [N.m.s/rad]; NaN where the estimator does not tell both apart.
        """
        return float("nan"), float("nan")

    @property
    @abstractmethod
    def torques(self) -> np.ndarray:
        """Return the measured and predicted torque during the last call of `process`, shape (k, 4),
        columns `TORQUE_COLUMNS`.
        """

    @property
    def doubts(self) -> str:
        """Say in words why the newest estimate is doubted; empty where it is not."""
        return ""

    @property
    def instrument(self) -> str:
        """Say in words which part of the motion the estimator regards as not caused by torque.

        It is empty where this makes no difference.
        """
        return ""

    @property
    @abstractmethod
    def rate_lost(self) -> bool:
        """Tell whether the samples come at another rate than `rate`.

        `process` then has stopped at `consumed`.
        """

    @property
    @abstractmethod
    def consumed(self) -> int:
        """Return how many samples the last call of `process` used: all of them unless the rate was
        lost.
        """
