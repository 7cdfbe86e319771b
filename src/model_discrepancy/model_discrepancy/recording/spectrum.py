"""A signal's spectrum, extended at both ends by its own point reflection so that the ends do not
ring.
"""

from __future__ import annotations

import math

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.signal import butter, sosfiltfilt

# Anti-alias filter of a lower rate: cut-off as a share of it, and order of the zero-phase gain.
_ANTI_ALIAS = 0.4
_ANTI_ALIAS_ORDER = 24
_EXTENSION_S = 2.0


def low_pass(frequency: np.ndarray, cutoff: float, order: int) -> np.ndarray:
    """Return the gain of the zero-phase low-pass at each frequency [Hz]; half at the cutoff."""
    return 1.0 / (1.0 + (frequency / cutoff) ** order)


def band(signal: np.ndarray, rate: float, low: float, high: float) -> np.ndarray:
    """Return a signal behind a zero-phase band-pass of second order, shape (n,).

    Parameters
    ----------
    signal
        Shape (n,).
    rate
        Of its samples [Hz].
    low, high
        Between which frequencies [Hz] it passes.
    """
    return sosfiltfilt(butter(2, [low, high], "bandpass", fs=rate, output="sos"), signal)


class Spectrum:
    """Holds a signal, extended at its ends, in the frequency domain, to be filtered and read at a
    lower rate.
    """

    def __init__(self, signal: np.ndarray, rate: float, step: int) -> None:
        edge = int(_EXTENSION_S * rate) // step * step
        edge = min(edge, (len(signal) - 1) // step * step)
        before = 2.0 * signal[0] - signal[edge:0:-1]
        after = 2.0 * signal[-1] - signal[-2 : -2 - edge : -1]
        length = next_fast_len(math.ceil((len(signal) + 2 * edge) / step), real=True) * step
        known = np.concatenate([before, signal, after])
        # The rest of the period leads from the last value back to the first.
        filler = np.linspace(known[-1], known[0], length - len(known) + 2)[1:-1]
        self.values = rfft(np.concatenate([known, filler]))
        self.frequency = rfftfreq(length, 1.0 / rate)
        self._step, self._edge, self._length, self._rate = step, edge, length, rate
        self._samples = math.ceil(len(signal) / step)

    def read(self, gain: np.ndarray) -> np.ndarray:
        """Return the filtered signal at the lower rate."""
        short = self._length // self._step
        part = (self.values * gain)[: short // 2 + 1]
        start = self._edge // self._step
        return irfft(part, short)[start : start + self._samples] / self._step

    def power_of(self, density: float) -> float:
        """Return the power per bin of flat noise of this power density [unit^2/Hz]."""
        return 0.5 * density * self._length * self._rate

    def anti_alias(self) -> np.ndarray:
        """Return gain of the zero-phase low-pass that the lower rate needs, at each frequency."""
        highest = self.frequency[-1] / self._step
        return low_pass(self.frequency, 2.0 * _ANTI_ALIAS * highest, _ANTI_ALIAS_ORDER)


def signal_share(spectrum: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Return the Wiener gain: the share of a channel's power at each frequency that is movement,
    not noise, 0...1.

    Fitting with the movement that is expected, given what was read, keeps noise from biasing the
    parameters (regression calibration, Carroll et al. 2006, Measurement Error in Nonlinear Models,
    chapter 4).
    """
    return share_above(spectrum, noise_floor(spectrum, frequency))


def share_above(spectrum: np.ndarray, noise: float | np.ndarray) -> np.ndarray:
    """Return the share of the power at each frequency that is above a noise of this power per bin,
    0...1.
    """
    power = np.abs(spectrum) ** 2
    # Means over a sixteenth of an octave at least 40 bins wide, so that the estimate's own scatter
    # is small.
    total = np.concatenate([[0.0], np.cumsum(power)])
    index = np.arange(len(power))
    half = np.maximum(20, index // 32)
    low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, len(power))
    mean = (total[high] - total[low]) / (high - low)
    return np.clip(1.0 - noise / np.maximum(mean, 1e-30), 0.0, 1.0)


def white_density(signal: np.ndarray, rate: float) -> float:
    """Return the power density of a signal's flat noise [unit^2/Hz], from 50 % to 80 % of half its
    rate.
    """
    values = rfft((signal - signal.mean()) * np.hanning(len(signal)))
    floor = noise_floor(values, rfftfreq(len(signal), 1.0 / rate))
    return 2.0 * floor / (rate * float(np.sum(np.hanning(len(signal)) ** 2)))


def clear_share(
    spectrum: np.ndarray, frequency: np.ndarray, further_noise: np.ndarray
) -> np.ndarray:
    """Return the share of the power at each frequency that is not noise, and 0 where the power is
    less than twice the noise: such power may be noise alone.

    Parameters
    ----------
    spectrum, frequency
        As `signal_share` takes them.
    further_noise
        Power per bin of noise beside the flat one, of the spectrum's shape.
    """
    share = share_above(spectrum, noise_floor(spectrum, frequency) + further_noise)
    return np.where(share < 0.5, 0.0, share)


def noise_floor(spectrum: np.ndarray, frequency: np.ndarray) -> float:
    """Return the power of the flat noise in a spectrum (per bin): the median between 50 % and 80 %
    of the highest frequency.
    """
    top = frequency[-1]
    band = (frequency > 0.5 * top) & (frequency < 0.8 * top)
    # The median of an exponentially distributed power is ln 2 times its mean.
    floor = float(np.median(np.abs(spectrum[band]) ** 2)) / math.log(2.0)
    return max(floor, 1e-30)
