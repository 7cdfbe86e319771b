"""Torque that a model predicts from other data than it was fitted to, and how much of the measured
torque that is.

All signals pass the same zero-phase filters, so every model is judged within the same band and no
delay is added.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from scipy import signal

from ankle_interfaces.errors import SamplingError
from impedance_estimator.errors import EstimateError

LOWPASS = 80.0
"""[Hz] Above, the position of the real trials is noise; the perturbation has its power below 40 Hz.
"""
HIGHPASS = 0.1
"""[Hz] Below, torque is voluntary.

One step of the perturbation lasts 0.2 to 0.7 s, well within the pass band.
"""
FILTER_ORDER = 2
"""Each Butterworth filter has this order and runs forwards and backwards."""
PADDING = 1.0 / HIGHPASS
"""[s] The signals are mirrored at both ends for so long, a period of the high-pass: its transient
would otherwise be taken for torque, the more the fewer samples a second there are."""
WORKING_RATE = 250.0
"""[Hz] Three times the low-pass; the factor of decimation is a whole number, so 2048 Hz gives 256
Hz.
"""


@dataclass(frozen=True)
class Prediction:
    """Holds torques after the filters, at the working rate. All of shape (n,)."""

    time: np.ndarray
    """Time [s] since the first sample given."""
    intrinsic: np.ndarray
    """[N.m]"""
    reflex: np.ndarray
    """[N.m]"""
    measured: np.ndarray
    """Measured torque [N.m] through the same filters; NaN where none was given."""

    @property
    def torque(self) -> np.ndarray:
        """Return the intrinsic and reflex torque together [N.m]."""
        return self.intrinsic + self.reflex

    @property
    def vaf(self) -> float:
        """Return the variance of the measured torque that is accounted for [%]."""
        return 100.0 * (1.0 - float(np.var(self.measured - self.torque) / np.var(self.measured)))


def predict_torque(
    rate: float,
    parameters: np.ndarray,
    response: np.ndarray,
    position: np.ndarray,
    torque: np.ndarray,
    velocity: np.ndarray | None = None,
) -> Prediction:
    """Return the torque under an online estimate.

    Parameters
    ----------
    rate
        Sampling rate [Hz], at least 250.
    parameters
        K [N.m/rad], B [N.m.s/rad], I [kg.m^2].
    response
        Reflex impulse response, shape (k, 2), columns lag [s] and h [N.m/rad], evenly spaced.
    position, torque, velocity
        Shape (n,), as `working_signals`.

    Raises
    ------
    EstimateError
        A response that is not finite.
    ValueError
        As `checked_signals`.
    """
    if not np.all(np.isfinite(response)) or not np.all(np.isfinite(parameters)):
        raise EstimateError("the estimate is not finite: no valid estimate yet?")
    position, torque_checked, velocity = checked_signals(rate, position, torque, velocity)
    x, v, a, rectified, y = working_signals(rate, position, torque_checked, velocity)
    step = decimation(rate) / rate
    lags = np.arange(math.ceil(response[-1, 0] / step) + 1)
    h = np.interp(lags * step, response[:, 0], response[:, 1], left=0.0, right=0.0)
    reflex = np.convolve(rectified, h * step)[: len(x)]
    intrinsic = parameters[0] * x + parameters[1] * v + parameters[2] * a
    rows = np.arange(len(lags), len(x))
    return Prediction(rows * step, intrinsic[rows], reflex[rows], y[rows])


def checked_signals(
    rate: float, position: np.ndarray, torque: np.ndarray | None, velocity: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray | None, np.ndarray | None]:
    """Return position, torque and velocity as arrays of floats.

    Raises
    ------
    ValueError
        Shapes that differ.
    EstimateError
        Values that are not finite, or a record shorter than 5 s.
    SamplingError
        A rate below 250 Hz.
    """
    if rate < WORKING_RATE:
        raise SamplingError(
            f"sampling rate {rate:g} Hz is refused; allowed: {WORKING_RATE:g} Hz and more"
        )
    position = np.asarray(position, dtype=float)
    if position.ndim != 1 or len(position) < 5.0 * rate:
        raise EstimateError(
            f"position of shape {position.shape} is refused; needed: one row of at least 5 s "
            f"({math.ceil(5.0 * rate)} samples)"
        )
    named: tuple[tuple[str, np.ndarray | None], ...] = (
        ("position", position),
        ("torque", torque),
        ("velocity", velocity),
    )
    for name, values in named:
        if values is None:
            continue
        if np.shape(values) != position.shape:
            raise ValueError(
                f"{name} of shape {np.shape(values)} does not fit position of shape "
                f"{position.shape}"
            )
        bad = int(np.sum(~np.isfinite(values)))
        if bad:
            raise EstimateError(f"{name} has {bad} values that are NaN or infinite")
    return (
        position,
        None if torque is None else np.asarray(torque, dtype=float),
        None if velocity is None else np.asarray(velocity, dtype=float),
    )


def decimation(rate: float) -> int:
    """Return samples at `rate` [Hz] for each one at the working rate."""
    return max(int(rate // WORKING_RATE), 1)


def without_drift(values: np.ndarray, rate: float) -> np.ndarray:
    """Return a signal without what is slower than `HIGHPASS`, by a filter without delay.

    Parameters
    ----------
    values
        Shape (n,), in any unit.
    rate
        Sampling rate [Hz].

    Returns
    -------
    np.ndarray
        Shape (n,), in the unit of the values.
    """
    highpass = signal.butter(FILTER_ORDER, HIGHPASS, "highpass", fs=rate, output="sos")
    padding = min(len(values) - 1, round(PADDING * rate))
    return np.asarray(signal.sosfiltfilt(highpass, values, padtype="even", padlen=padding))


def working_signals(
    rate: float, position: np.ndarray, torque: np.ndarray | None, velocity: np.ndarray | None
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return position [rad], velocity [rad/s], acceleration [rad/s^2], rectified velocity [rad/s]
    and torque [N.m], at the working rate.

    Filtered; the torque is NaN where none was given. Velocity is the derivative of position where
    none was measured.
    """
    lowpass = signal.butter(FILTER_ORDER, LOWPASS, fs=rate, output="sos")
    every = decimation(rate)

    def smooth(values: np.ndarray) -> np.ndarray:
        return signal.sosfiltfilt(lowpass, values)

    def differentiate(values: np.ndarray) -> np.ndarray:
        # Fourth order: 0.1 % at 40 Hz and 500 Hz, where second order has 4 %. Ends are held.
        padded = np.pad(values, 2, mode="edge")
        return (8.0 * (padded[3:-1] - padded[1:-3]) - padded[4:] + padded[:-4]) * rate / 12.0

    def finish(values: np.ndarray) -> np.ndarray:
        return without_drift(values, rate)[::every]

    x = smooth(position)
    v = differentiate(x) if velocity is None else smooth(velocity)
    y = np.full(len(x[::every]), np.nan) if torque is None else finish(smooth(torque))
    return finish(x), finish(v), finish(differentiate(v)), finish(np.maximum(v, 0.0)), y
