"""Share of the true intrinsic torque that the identified K, B and I account for.

These are the numbers beside the paper's figure 7.
"""

from __future__ import annotations

import numpy as np
from scipy import signal

from ankle_physics.virtual_rig import Recording
from impedance_estimator.correlation.correlation_estimator import LOWPASS_ORDER
from impedance_estimator.correlation.differences import backward_difference
from impedance_estimator.digital_filters import butterworth_lowpass
from impedance_estimator.settings import Settings
from simulation_study.rigs import intrinsic_torque

WINDOW = 0.040
"""[s] after the start of a movement: the intrinsic time frame, before any reflex.

van 't Veld et al. 2018, section IV-B.
"""


def motion(recording: Recording, measured_velocity: bool, filtered: bool) -> np.ndarray:
    """Return position [rad], velocity [rad/s] and acceleration [rad/s^2] as an algorithm sees them,
    shape (n, 3).

    Parameters
    ----------
    recording
        A trial.
    measured_velocity
        Whether velocity is the measured one.
    filtered
        With 100 Hz low-pass and 4th-order differences (C and CE) or without and 1st-order
        differences (O).
    """
    x, v = recording.position, recording.velocity
    weights = backward_difference(4 if filtered else 1, recording.rate)
    if filtered:
        lowpass = butterworth_lowpass(LOWPASS_ORDER, Settings.lowpass_cutoff, recording.rate)
        x, v = signal.sosfilt(lowpass, x), signal.sosfilt(lowpass, v)
    if not measured_velocity:
        v = signal.lfilter(weights, 1.0, x)
    return np.column_stack([x, v, signal.lfilter(weights, 1.0, v)])


def true_torque(recording: Recording, filtered: bool) -> np.ndarray:
    """Return the true intrinsic torque [N.m] behind the motion's low-pass, shape (n,)."""
    torque = intrinsic_torque(recording)
    if not filtered:
        return torque
    return signal.sosfilt(
        butterworth_lowpass(LOWPASS_ORDER, Settings.lowpass_cutoff, recording.rate), torque
    )


def after_stretch(velocity: np.ndarray, rate: float) -> np.ndarray:
    """Say which samples lie within `WINDOW` after a dorsiflexing movement starts, shape (n,).

    Parameters
    ----------
    velocity
        True velocity [rad/s], shape (n,).
    rate
        Sampling rate [Hz].
    """
    # A tenth of a movement's velocity: within 3 ms of its start.
    moving = velocity > 0.1 * np.max(velocity)
    starts = np.flatnonzero(moving[1:] & ~moving[:-1]) + 1
    inside = np.zeros(len(velocity), dtype=bool)
    for start in starts:
        inside[start : start + round(WINDOW * rate)] = True
    return inside


def accuracy(predicted: np.ndarray, true: np.ndarray) -> float:
    """Return VAF, equation 1 of van 't Veld et al. 2018 [%]."""
    return 100.0 * (1.0 - float(np.var(predicted - true) / np.var(true)))
