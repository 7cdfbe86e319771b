"""The base of every perturbation signal.

A new signal is one file with a subclass, and its entry in `signals.SIGNALS`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity, Value
from perturbation_generator.edges import Extremes
from perturbation_generator.settings import Settings


@dataclass(frozen=True)
class Onset:
    """Describes the start of a movement.

    Attributes
    ----------
    time
        Since the start of the signal [s].
    direction
        1 dorsiflexing, -1 plantarflexing.
    amplitude
        Size of the movement [rad], positive.
    """

    time: float
    direction: int
    amplitude: float


class Signal(ABC):
    """Makes a perturbation, sample after sample; its state is kept between calls.

    Parameters
    ----------
    settings
        Common to all signals.
    own
        Values of the signal's own parameters by their short names (``stretch`` for
        ``pulse_step.stretch``); those left out have their defaults.

    Raises
    ------
    QuantityError
        An unknown parameter, a value out of its range, or values that contradict each other.

    Attributes
    ----------
    name
        Value of the parameter ``signal``.
    parameters
        The signal's own, named ``<signal>.<short name>``; none unless it has some.
    own
        Their values.
    amplitude
        The amplitude in force for the next movement [rad].
    """

    name: ClassVar[str]
    parameters: ClassVar[tuple[Quantity, ...]] = ()

    def __init__(self, settings: Settings, **own: Value) -> None:
        declared = {parameter.name.split(".")[1]: parameter for parameter in self.parameters}
        unknown = sorted(own.keys() - declared.keys())
        if unknown:
            raise QuantityError(
                f"signal '{self.name}' has no parameter '{unknown[0]}'; it has "
                f"{', '.join(declared)}"
            )
        self.own = {
            short: parameter.check(own.get(short, parameter.default))
            for short, parameter in declared.items()
        }
        self.settings = settings
        self.amplitude = settings.amplitude
        self._given = 0
        self._onsets: list[Onset] = []
        self._free_at = 0.0

    @property
    def time(self) -> float:
        """Return the time [s] of the next sample since the start of the signal."""
        return self._given / self.settings.rate

    def next(self, n: int) -> np.ndarray:
        """Return the next n samples: position [rad], velocity [rad/s] and acceleration [rad/s^2].

        Behind the end of a signal with a duration the samples are at rest.
        """
        samples = self._samples(self._given, n)
        self._given += n
        return samples

    @property
    def awaits_requests(self) -> bool:
        """Tell whether the plate rests until `request` is called; else it moves by itself."""
        return False

    def request(self) -> float | None:
        """Begin what the signal gives on request with the next sample.

        Returns
        -------
        float | None
            Time of its onset since the start of the signal [s]; None where none can be given now.
        """
        return None

    def rest(self) -> None:
        """End what was requested: no further movement begins, and the plate goes back to rest.

        A signal that runs by itself goes on, and a single stretch ends by itself.
        """

    @property
    def busy_for(self) -> float:
        """Return the time [s] until a further request can be given; 0 now."""
        return max(0.0, self._free_at - self.time)

    def onsets(self) -> list[Onset]:
        """Return every movement that began before the next sample, in order: every edge, those
        back to rest included.

        The list is empty for a signal without edges.
        """
        return [onset for onset in self._onsets if onset.time < self.time]

    def forget_onsets(self) -> None:
        """Forget the movements that have begun, which a run of hours would pile up."""
        self._onsets = [onset for onset in self._onsets if onset.time >= self.time]

    def set_amplitude(self, amplitude: float) -> None:
        """Set a new amplitude [rad], which holds from the next movement on.

        The caller has checked `extremes` against the limits.
        """
        self.amplitude = amplitude

    @abstractmethod
    def extremes(self, amplitude: float) -> Extremes:
        """Return bounds of position, velocity and acceleration with an amplitude, in any run."""

    @abstractmethod
    def _samples(self, first: int, n: int) -> np.ndarray:
        """Return samples first ... first + n - 1, shape (n, 3); called with first growing by n."""
