"""What a laboratory stores of a fast course: filtered, sampled, noisy, and in steps."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.signal import butter, sosfilt, sosfilt_zi

from second_rig.drawing import evenly_in_ratio

# The engine runs at about 32 kHz, which a resonance of some 100 Hz and a stiff contact need:
# rate [Hz] -> steps between two samples.
STEPS_BETWEEN = {1000: 32, 1024: 32, 2000: 16, 2048: 16}
# The movement begins before the recording does, so that no transient of the start is in it [s].
LEAD_S = 3.0
# Corner of the anti-alias filter of all channels, in units of the rate.
CORNER = 0.36
# Steps of an encoder and of a converter [rad], [N.m].
POSITION_STEPS = (5e-6, 1e-5, 2e-5)
TORQUE_STEPS = (0.005, 0.01, 0.02)


@dataclass(frozen=True)
class Clock:
    """Holds the steps of the engine and the samples of a recording.

    Attributes
    ----------
    rate
        Of the samples [Hz].
    seconds
        Length of the recording [s].
    """

    rate: int
    seconds: float

    @property
    def fast_rate(self) -> int:
        """Return the rate of the engine [Hz]."""
        return self.rate * STEPS_BETWEEN[self.rate]

    @property
    def time(self) -> np.ndarray:
        """Return the time since the recording's start at each step [s]."""
        return np.arange(int((self.seconds + LEAD_S) * self.fast_rate)) / self.fast_rate - LEAD_S

    @property
    def first(self) -> int:
        """Return the step of the first sample."""
        return int(LEAD_S * self.fast_rate)

    @property
    def middle(self) -> int:
        """Return the step in the middle of the recording."""
        return self.first + int(0.5 * self.seconds * self.fast_rate)

    @property
    def samples(self) -> int:
        """Return how many samples there are."""
        return int(self.seconds * self.rate)

    def sampled(self, course: np.ndarray) -> np.ndarray:
        """Return the samples of a course behind the anti-alias filter.

        Parameters
        ----------
        course
            At every step of the engine.
        """
        sections = butter(4, CORNER * self.rate, fs=self.fast_rate, output="sos")
        filtered = sosfilt(sections, course, zi=sosfilt_zi(sections) * course[0])[0]
        return filtered[self.first :: STEPS_BETWEEN[self.rate]][: self.samples]


@dataclass(frozen=True)
class Noise:
    """Holds the noise of the channels.

    Attributes
    ----------
    position, velocity, torque
        Noise [rad], [rad/s], [N.m], each of shape (n,).
    deviations
        Standard deviation of each, by its name.
    """

    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray
    deviations: dict[str, float]


def draw_noise(count: int, generator: np.random.Generator) -> Noise:
    """Draw the noise of a recording.

    Parameters
    ----------
    count
        Samples.
    generator
        Draws it.
    """
    deviations = {
        "torque": evenly_in_ratio(generator, 0.02, 0.15),
        "position": evenly_in_ratio(generator, 1e-5, 1e-4),
        "velocity": evenly_in_ratio(generator, 2e-3, 1e-2),
    }
    drawn = {name: generator.standard_normal(count) * size for name, size in deviations.items()}
    return Noise(**drawn, deviations=deviations)


def draw_steps(generator: np.random.Generator) -> dict[str, float]:
    """Draw the steps in which position [rad] and torque [N.m] are stored.

    Parameters
    ----------
    generator
        Draws them.
    """
    return {
        "position": float(generator.choice(POSITION_STEPS)),
        "torque": float(generator.choice(TORQUE_STEPS)),
    }


def in_steps(channels: dict[str, Any], steps: dict[str, float]) -> dict[str, Any]:
    """Return channels with some of them rounded to steps.

    Parameters
    ----------
    channels
        By name, each of shape (n,).
    steps
        By the name of a channel.
    """
    rounded = {name: np.round(channels[name] / step) * step for name, step in steps.items()}
    return channels | rounded
