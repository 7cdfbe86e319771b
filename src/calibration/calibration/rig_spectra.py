"""A rig's recording in the frequency domain: what of each channel follows the reference."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq

from calibration.errors import CalibrationError

# Width over which a transfer is taken as smooth: modes of rigs are wider (5 % of 60 Hz).
FREQUENCY_RESOLUTION = 1.0  # Hz
# A servo's motion differs from its second-order description by about this share.
SERVO_MODEL_ERROR = 0.02
# Fast edges reach no further through a drive of 30 Hz.
HIGHEST_FREQUENCY = 120.0  # Hz
# A plate holds still for at least this long at the start.
MIN_REST_DURATION = 0.5  # s
# Left out behind the start of rest, while the plate settles.
SETTLING_TIME = 0.5  # s
# Below, a reference does not move; noise of a measured reference lies below it.
REFERENCE_RESOLUTION = 1e-6  # rad


@dataclass(frozen=True)
class Signals:
    """Holds a recording of a rig.

    Attributes
    ----------
    rate
        [Hz].
    position
        [rad], shape (n,).
    velocity
        [rad/s], shape (n,); None where it was not measured.
    torque
        [N.m], shape (n,).
    reference
        Commanded angle [rad] at the samples' times, shape (n,).
    """

    rate: float
    position: np.ndarray
    velocity: np.ndarray | None
    torque: np.ndarray
    reference: np.ndarray


def rest_of(signals: Signals) -> slice:
    """Return the samples at which the plate rests before it first moves.

    Raises
    ------
    CalibrationError
        It does not move, or does not rest long enough.
    """
    moving = np.flatnonzero(np.abs(signals.reference - signals.reference[0]) > REFERENCE_RESOLUTION)
    if not len(moving):
        raise CalibrationError("the reference does not move: nothing can be calibrated")
    first, last = round(SETTLING_TIME * signals.rate), int(moving[0])
    if last < (MIN_REST_DURATION + SETTLING_TIME) * signals.rate:
        raise CalibrationError(
            f"the plate rests for {last / signals.rate:.2f} s before it first moves; at least "
            f"{MIN_REST_DURATION + SETTLING_TIME:g} s are needed"
        )
    return slice(first, last)


def scatter(samples: np.ndarray) -> float:
    """Return the standard deviation without slow drift: from differences of neighbours."""
    return float(np.std(np.diff(samples)) / math.sqrt(2.0))


class RigSpectra:
    """Holds the spectra of a whole recording, and finds what of them follows the reference.

    Parameters
    ----------
    signals
        Signals of the recording.
    rest
        Samples at which the plate rests; their mean is taken off.

    Attributes
    ----------
    frequency
        Of the lines [Hz]; `omega` is 2 pi i times it [rad/s].
    reference, position, torque, velocity
        Spectra at these lines; None where there is no velocity.
    """

    def __init__(self, signals: Signals, rest: slice) -> None:
        n = len(signals.reference)
        self.length = next_fast_len(n + round(signals.rate), real=True)
        frequency = rfftfreq(self.length, 1.0 / signals.rate)
        used = (frequency > 0.0) & (frequency <= min(HIGHEST_FREQUENCY, 0.4 * signals.rate))
        self.frequency = frequency[used]
        self.rate = signals.rate
        self.used = used
        self.omega = 2j * np.pi * self.frequency
        self._half = max(1, round(0.5 * FREQUENCY_RESOLUTION * self.length / signals.rate))
        self.reference = self._raw(signals.reference - signals.reference[0])
        self.position = self._raw(signals.position - signals.position[rest].mean())
        self.torque = self._raw(signals.torque - signals.torque[rest].mean())
        self._position_noise = self._noise(signals.position, rest) / len(self.frequency)
        self.velocity = None
        if signals.velocity is not None:
            self.velocity = self._raw(signals.velocity - signals.velocity[rest].mean())

    def _noise(self, signal: np.ndarray, rest: slice) -> float:
        """Return the energy that the noise at rest has in a spectrum of the whole signal."""
        resting = signal[rest] - signal[rest].mean()
        return float(np.sum(np.abs(self._raw(resting)) ** 2)) * len(signal) / len(resting)

    def _raw(self, signal: np.ndarray) -> np.ndarray:
        return rfft(signal, self.length)[self.used]

    def following(self, signal: np.ndarray, model: np.ndarray, known: bool = True) -> np.ndarray:
        """Return what of a spectrum follows a model of it, through a transfer that is smooth.

        With `known` the model is right but for `SERVO_MODEL_ERROR`; without, it is only
        proportional to what the signal follows. The nearer the model, the flatter is the transfer,
        and the less does smoothing distort it. At the lowest frequencies responses are steeper than
        the resolution, and the signal is far above its noise: there it stays as it is.
        """
        power = np.maximum(self.smooth(np.abs(model) ** 2), 1e-300)
        transfer = self.smooth(signal * model.conj()) / power
        left = self.smooth(np.abs(signal - transfer * model) ** 2)
        # Where the signal sinks in its noise the model is the better guide.
        noise = left / power / (2 * self._half + 1)
        weight = SERVO_MODEL_ERROR**2 / (SERVO_MODEL_ERROR**2 + noise) if known else 1.0
        followed = (1.0 + weight * (transfer - 1.0) if known else transfer) * model
        return np.where(self.frequency < 2.0 * FREQUENCY_RESOLUTION, signal, followed)

    def motion(self, model: np.ndarray) -> np.ndarray:
        """Return the spectrum of the plate's motion [rad]: a model of it, and what the measured
        position says of it beyond its noise.

        It is Wiener's filter of what the model misses: nothing where that is as large as the noise
        at rest, all of it where it is far above.

        Parameters
        ----------
        model
            Of the position, by the reference [rad].
        """
        missed = self.position - model
        power = np.maximum(self.smooth(np.abs(missed) ** 2), 1e-300)
        return model + np.maximum(0.0, 1.0 - self._position_noise / power) * missed

    def smooth(self, values: np.ndarray, width: float = FREQUENCY_RESOLUTION) -> np.ndarray:
        """Return the mean over neighbouring lines.

        Parameters
        ----------
        values
            At the lines, shape (lines,).
        width
            Of the mean [Hz].
        """
        half = max(1, round(0.5 * width * self.length / self.rate))
        padded = np.pad(values, half, mode="edge")
        total = np.cumsum(np.concatenate([[0.0], padded]))
        return (total[2 * half + 1 :] - total[: -2 * half - 1]) / (2 * half + 1)

    def time_signal(self, spectrum: np.ndarray) -> np.ndarray:
        """Return the signal of a spectrum, shape (length,)."""
        whole = np.zeros(self.length // 2 + 1, dtype=complex)
        whole[self.used] = spectrum
        return irfft(whole, self.length)

    def spectrum(self, signal: np.ndarray) -> np.ndarray:
        """Return the spectrum of a signal of shape (length,)."""
        return rfft(signal, self.length)[self.used]
