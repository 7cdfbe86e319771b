"""Samples follow from the true signals by an anti-alias filter, sampling and noise.

Filter: fourth-order Butterworth at 90 % of the Nyquist frequency of the samples (frequency: van 't
Veld et al. 2018, section II-C; order: not in the paper, a common analog anti-alias filter). All
channels have the same one, so that none lags another. Noise: white, Gaussian, ``standard deviation
= std(clean signal) / 10^(SNR/20)``.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numba import njit

from ankle_physics.errors import ModelError

FILTER_ORDER = 4
FILTER_CORNER = 0.9  # of the Nyquist frequency
# Labels the noise's random streams, so that they differ from those of the terms for the same seed.
_NOISE_STREAM = 7_301


class Sampler:
    """Filters against aliases and samples, stretch by stretch; settled at the first value.

    Parameters
    ----------
    rate
        Of the samples [Hz].
    factor
        Internal samples for each of them.
    """

    def __init__(self, rate: float, factor: int) -> None:
        from scipy.signal import butter  # takes a second to load: for those who sample

        self._factor = factor
        self._sections = butter(
            FILTER_ORDER, FILTER_CORNER * rate / 2.0, fs=rate * factor, output="sos"
        )
        self._state: np.ndarray | None = None

    def run(self, *signals: np.ndarray) -> np.ndarray:
        """Return samples of shape (n, m) from m internal signals of shape (n * factor,)."""
        if self._state is None:
            from scipy.signal import sosfilt_zi

            rest = sosfilt_zi(self._sections)
            self._state = np.array([rest * signal[0] for signal in signals])
        samples = np.empty((len(signals), len(signals[0]) // self._factor))
        for signal, state, out in zip(signals, self._state, samples, strict=True):
            _filter_and_sample(signal, self._sections, state, self._factor, out)
        return samples.T


@njit(cache=True)
def _filter_and_sample(
    signal: np.ndarray, sections: np.ndarray, state: np.ndarray, factor: int, out: np.ndarray
) -> None:
    """Filter through two second-order sections in transposed direct form II; every factor-th output
    is kept.

    Changes `state`, shape (2, 2), and `out`.
    """
    b0, b1, b2, a1, a2 = (
        sections[0, 0],
        sections[0, 1],
        sections[0, 2],
        sections[0, 4],
        sections[0, 5],
    )
    c0, c1, c2, d1, d2 = (
        sections[1, 0],
        sections[1, 1],
        sections[1, 2],
        sections[1, 4],
        sections[1, 5],
    )
    p1, p2 = state[0, 0], state[0, 1]
    q1, q2 = state[1, 0], state[1, 1]
    k = 0
    for row in range(out.size):
        z = 0.0
        for _ in range(factor):
            x = signal[k]
            k += 1
            y = b0 * x + p1
            p1 = b1 * x - a1 * y + p2
            p2 = b2 * x - a2 * y
            z = c0 * y + q1
            q1 = c1 * y - d1 * z + q2
            q2 = c2 * y - d2 * z
        out[row] = z
    state[0, 0], state[0, 1] = p1, p2
    state[1, 0], state[1, 1] = q1, q2


@dataclass(frozen=True)
class SignalToNoise:
    """Holds signal-to-noise ratios [dB]: 20 log10 of the standard deviations of clean signal and
    noise.

    Defaults of van 't Veld et al. 2018, sections II-C and II-D, measured on their device. Infinite:
    no noise.

    Raises
    ------
    ModelError
        A ratio below 0 dB.
    """

    position: float = 52.7
    velocity: float = 37.7
    torque: float = 24.1

    def __post_init__(self) -> None:
        for name, value in (
            ("position", self.position),
            ("velocity", self.velocity),
            ("torque", self.torque),
        ):
            if not value >= 0.0:
                raise ModelError(f"signal-to-noise ratio of {name} = {value:g} dB is below 0 dB")

    def deviations(self, clean: np.ndarray) -> np.ndarray:
        """Return the deviations of the noise, shape (3,), for clean signals of shape (n, 3)."""
        ratios = np.array([self.position, self.velocity, self.torque])
        return clean.std(axis=0) * 10.0 ** (-ratios / 20.0)


NO_NOISE = SignalToNoise(np.inf, np.inf, np.inf)


class Noise:
    """Adds white noise to the samples; the same for a seed whatever the size of the stretches.

    Parameters
    ----------
    deviations
        Standard deviations [rad, rad/s, N.m], shape (3,).
    seed
        Of the random streams, one for each channel.
    """

    def __init__(self, deviations: np.ndarray, seed: int) -> None:
        self._deviations = deviations
        self._streams = [
            np.random.default_rng([_NOISE_STREAM, seed, channel])
            for channel in range(len(deviations))
        ]

    def add(self, clean: np.ndarray) -> np.ndarray:
        """Return the measured samples of shape (n, 3)."""
        measured = np.empty_like(clean)
        for channel, (stream, deviation) in enumerate(
            zip(self._streams, self._deviations, strict=True)
        ):
            drawn = stream.standard_normal(len(clean))
            drawn *= deviation
            np.add(clean[:, channel], drawn, out=measured[:, channel])
        return measured
