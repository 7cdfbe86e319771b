"""Stretches of a recording in which the plate keeps moving one way.

Dry friction has one sign there and does not change, whatever its law at rest: torque and motion are
those of a linear plate. The signal ``rig_calibration`` has such stretches in its sweeps of uneven
speed.
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np
from scipy.fft import irfft, next_fast_len
from scipy.signal import detrend

from calibration.errors import CalibrationError
from calibration.rig_spectra import HIGHEST_FREQUENCY, RigSpectra

# Of the plate, in ranges of its movement a second: half the slow speed of the sweeps, and twice the
# largest one of the slow sweeps.
LEAST_SPEED = 0.75  # 1/s
# Left out behind a reversal: six time constants of a torque sensor that lags by 5 ms.
REVERSAL_TIME = 0.03  # s
# Left out in front of the next reversal, where the filter reaches across it.
FORESIGHT = 0.005  # s
# What is left of a stretch must hold a few periods of the fast changes.
SHORTEST_STRETCH = 0.05  # s
# Less does not tell a delay to a tenth of a millisecond.
LEAST_TIME = 3.0  # s
# Above, a filter falls smoothly to nothing at `HIGHEST_FREQUENCY`: a sharp end would ring from each
# reversal into the stretches.
FLAT_FREQUENCY = 20.0  # Hz
# Samples a period of the highest frequency.
SAMPLES_PER_PERIOD = 4.0


def one_way_stretches(spectra: RigSpectra) -> list[tuple[float, float]]:
    """Return start and end [s] of each stretch in which the plate keeps its direction.

    Parameters
    ----------
    spectra
        Spectra of the recording.

    Raises
    ------
    CalibrationError
        They last less than `LEAST_TIME` together.
    """
    rate = spectra.rate
    speed = spectra.time_signal(spectra.position * spectra.omega)
    moving = np.abs(speed) > LEAST_SPEED * np.ptp(spectra.time_signal(spectra.position))
    direction = np.where(moving, np.sign(speed), 0.0)
    cuts = np.concatenate([[0], np.flatnonzero(np.diff(direction)) + 1, [len(direction)]])
    stretches = [
        (first / rate + REVERSAL_TIME, last / rate - FORESIGHT)
        for first, last in pairwise(cuts)
        if direction[first]
    ]
    stretches = [(first, last) for first, last in stretches if last - first >= SHORTEST_STRETCH]
    total = sum(last - first for first, last in stretches)
    if total < LEAST_TIME:
        raise CalibrationError(
            f"the plate keeps moving one way for {total:.1f} s in all; at least {LEAST_TIME:g} s "
            "are needed, which the signal rig_calibration has"
        )
    return stretches


class OneWayMotion:
    """Takes the stretches of spectra, each without its mean and slope.

    Parameters
    ----------
    spectra
        Spectra of the recording.

    Attributes
    ----------
    stretch
        Number of the stretch of each sample, shape (n,).
    """

    def __init__(self, spectra: RigSpectra) -> None:
        self._lines = np.flatnonzero(spectra.used)
        wanted = SAMPLES_PER_PERIOD * HIGHEST_FREQUENCY / spectra.rate
        self._size = next_fast_len(round(min(1.0, wanted) * spectra.length), real=True)
        self._scale = self._size / spectra.length
        rate = spectra.rate * self._scale
        highest = spectra.frequency[-1]
        above = np.clip((spectra.frequency - FLAT_FREQUENCY) / (highest - FLAT_FREQUENCY), 0.0, 1.0)
        self._filter = np.cos(0.5 * np.pi * above) ** 2
        parts = [
            np.arange(np.ceil(first * rate), np.ceil(last * rate)).astype(int)
            for first, last in one_way_stretches(spectra)
        ]
        self._samples = np.concatenate(parts)
        lengths = np.array([len(part) for part in parts])
        self.stretch = np.repeat(np.arange(len(parts)), lengths)
        self._starts = np.concatenate([[0], np.cumsum(lengths)[:-1]])
        self._lengths = lengths
        self._slope = np.concatenate([np.linspace(-1.0, 1.0, length) for length in lengths])
        self._slope_energy = np.add.reduceat(self._slope**2, self._starts)

    def __call__(self, spectrum: np.ndarray) -> np.ndarray:
        """Return the samples of a spectrum in all stretches, shape (n,).

        Parameters
        ----------
        spectrum
            At the lines, shape (lines,).
        """
        samples = self._signal(spectrum)[self._samples]
        samples -= (np.add.reduceat(samples, self._starts) / self._lengths)[self.stretch]
        slopes = np.add.reduceat(samples * self._slope, self._starts) / self._slope_energy
        return samples - slopes[self.stretch] * self._slope

    def variance(self, spectrum: np.ndarray, part: slice) -> float:
        """Return the variance of a spectrum's signal in a part of the recording's samples, cut into
        pieces as long as a stretch, each without its mean and slope.
        """
        first, last = (round(k * self._scale) for k in (part.start, part.stop))
        length = int(np.median(self._lengths))
        count = (last - first) // length
        pieces = self._signal(spectrum)[first : first + count * length].reshape(count, length)
        return float(np.mean(detrend(pieces, axis=1) ** 2))

    def _signal(self, spectrum: np.ndarray) -> np.ndarray:
        whole = np.zeros(self._size // 2 + 1, dtype=complex)
        whole[self._lines] = spectrum * self._filter
        return np.asarray(irfft(whole, self._size)) * self._scale
