"""Position, velocity and acceleration for fitting: zero-phase, band-limited, from what was
measured.

Everything is done on the spectrum of the recording, extended at both ends by its own point
reflection so that the ends do not ring. Motion is limited by its own noise only (Wiener), because a
nonlinear term, friction for one, must see the movement as sharp as it was; the 80 Hz low-pass comes
afterwards, in `rows`, on torque and model torque alike.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from model_discrepancy.recording.recording import Recording

# Terms are simulated at this rate or just above: six times the highest frequency that is fitted.
MODEL_RATE_HZ = 500.0
# Anti-alias filter of the model's rate: cut-off as a share of it, and order of the zero-phase gain.
_ANTI_ALIAS = 0.4
_ANTI_ALIAS_ORDER = 24
# Slow torque stands for muscle activation: a subject changes it over seconds, perturbations over
# tenths of a second.
ACTIVATION_HZ = 0.3
_EXTENSION_S = 2.0


@dataclass(frozen=True)
class Motion:
    """What the model is driven by and compared with, at the model's rate.

    Attributes
    ----------
    rate
        [Hz].
    position, velocity, acceleration
        Of the footplate [rad, rad/s, rad/s^2], each of shape (n,).
    torque
        [N.m], shape (n,).
    activation
        Background torque that muscles hold [N.m], shape (n,): slow torque, positive for calf
        activity; `diagnose` takes out of it what the base model makes of the movement.
    sample_time
        Between two samples of the recording [s]: channels are aligned no better than to half of it;
        0 for a simulation.
    """

    rate: float
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    torque: np.ndarray
    activation: np.ndarray
    sample_time: float = 0.0

    @property
    def time(self) -> np.ndarray:
        """Time since the first sample [s], shape (n,)."""
        return np.arange(len(self.position)) / self.rate


def low_pass(frequency: np.ndarray, cutoff: float, order: int) -> np.ndarray:
    """Gain of the zero-phase low-pass at each frequency [Hz]; half at the cutoff."""
    return 1.0 / (1.0 + (frequency / cutoff) ** order)


class _Spectrum:
    """A signal, extended at its ends, in the frequency domain, to be filtered and read at a lower
    rate.
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
        self._step, self._edge, self._length = step, edge, length
        self._samples = math.ceil(len(signal) / step)

    def read(self, gain: np.ndarray) -> np.ndarray:
        """Filtered signal at the lower rate."""
        short = self._length // self._step
        part = (self.values * gain)[: short // 2 + 1]
        start = self._edge // self._step
        return irfft(part, short)[start : start + self._samples] / self._step


def motion_of(recording: Recording) -> Motion:
    """Filtered motion and torque of a recording at the model's rate.

    Where velocity was measured it is merged with position, each frequency weighted by the two
    channels' noise floors (the best linear combination for independent white noises).
    """
    step = max(1, int(recording.rate // MODEL_RATE_HZ))
    position = _Spectrum(recording.position, recording.rate, step)
    frequency = position.frequency
    keep = low_pass(frequency, _ANTI_ALIAS * recording.rate / step, _ANTI_ALIAS_ORDER)
    s = 2j * np.pi * frequency
    merged = position.values
    if recording.velocity is not None:
        merged = _merge(position, _Spectrum(recording.velocity, recording.rate, step), s)
    position.values = merged * signal_share(merged, frequency)
    torque = _Spectrum(recording.torque, recording.rate, step)
    return Motion(
        rate=recording.rate / step,
        position=position.read(keep),
        velocity=position.read(keep * s),
        acceleration=position.read(keep * s**2),
        torque=torque.read(keep),
        activation=torque.read(low_pass(frequency, ACTIVATION_HZ, 4)),
        sample_time=1.0 / recording.rate,
    )


def _merge(position: _Spectrum, velocity: _Spectrum, s: np.ndarray) -> np.ndarray:
    """Spectrum of position from both channels; at zero frequency position alone."""
    noise_x = noise_floor(position.values, position.frequency)
    noise_v = noise_floor(velocity.values, position.frequency)
    # Velocity v = s x tells x with noise noise_v / |s|^2.
    weight_x = 1.0 / noise_x
    weight_v = np.abs(s) ** 2 / noise_v
    # 0.5 Hz and below: a small offset of the velocity channel must not become drift of position.
    weight_v[position.frequency < 0.5] = 0.0
    s_safe = np.where(s == 0, 1.0, s)
    return (weight_x * position.values + weight_v * velocity.values / s_safe) / (
        weight_x + weight_v
    )


def signal_share(spectrum: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Wiener gain: the share of a channel's power at each frequency that is movement, not noise,
    0...1.

    Fitting with the movement that is expected, given what was read, keeps noise from biasing the
    parameters (regression calibration, Carroll et al. 2006, Measurement Error in Nonlinear Models,
    chapter 4).
    """
    noise = noise_floor(spectrum, frequency)
    power = np.abs(spectrum) ** 2
    # Means over a sixteenth of an octave at least 40 bins wide, so that the estimate's own scatter
    # is small.
    total = np.concatenate([[0.0], np.cumsum(power)])
    index = np.arange(len(power))
    half = np.maximum(20, index // 32)
    low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, len(power))
    mean = (total[high] - total[low]) / (high - low)
    return np.clip(1.0 - noise / np.maximum(mean, 1e-30), 0.0, 1.0)


def noise_floor(spectrum: np.ndarray, frequency: np.ndarray) -> float:
    """Power of the flat noise in a spectrum (per bin): the median between 50 % and 80 % of the
    highest frequency.
    """
    top = frequency[-1]
    band = (frequency > 0.5 * top) & (frequency < 0.8 * top)
    # The median of an exponentially distributed power is ln 2 times its mean.
    floor = float(np.median(np.abs(spectrum[band]) ** 2)) / math.log(2.0)
    return max(floor, 1e-30)
