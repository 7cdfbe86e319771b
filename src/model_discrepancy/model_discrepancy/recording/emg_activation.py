"""Muscle activation from EMG, where it was recorded.

Slow torque tells what the muscles hold up to 0.3 Hz, and holds every error of the model as well.
EMG tells it faster, and shares no noise with torque. Its envelope, scaled by non-negative least
squares to the slow torque (Hof & van den Berg 1981, J. Biomech. 14, 747: torque in proportion to
the smoothed rectified EMG), takes the place of the slow torque where it follows it.
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import nnls
from scipy.signal import butter, resample_poly, sosfiltfilt

from model_discrepancy.recording.recording import Recording

# Sign of the torque that holds against a muscle: the calf pulls the foot down, the shin up.
TORQUE_SIGN = {"SOL": 1.0, "GL": 1.0, "GM": 1.0, "TA": -1.0}
# Voluntary changes of torque end near 2 Hz; the envelope's own noise rises with the bandwidth.
ENVELOPE_HZ = 1.0
# Movement artefacts and drifts lie below.
ARTEFACT_HZ = 20.0
# The answer to a movement is no background: EMG from its onset until the late responses have ended.
RESPONSE_S = 0.2
# Movement is faster than this share of its 99th percentile.
MOVING_SHARE = 0.15
# Of the slow torque's variance that the envelopes must explain to be believed.
LEAST_SHARE = 0.5
# Slow torque below this rms is rest, to which nothing can be scaled.
LEAST_TORQUE = 0.1  # N.m


def emg_activation(
    recording: Recording, velocity: np.ndarray, slow_torque: np.ndarray, rate: float, cutoff: float
) -> np.ndarray | None:
    """Return the background torque of the muscles by their EMG.

    Parameters
    ----------
    recording
        With EMG by muscle, or without.
    velocity
        Of the plate [rad/s], shape (n,).
    slow_torque
        Torque below `cutoff` that no movement makes [N.m], shape (n,), positive for calf activity.
    rate
        Of both [Hz].
    cutoff
        [Hz].

    Returns
    -------
    np.ndarray | None
        [N.m], shape (n,); None where no EMG was recorded or it does not follow the slow torque.
    """
    muscles = [name for name in TORQUE_SIGN if name in recording.emg]
    if not muscles or float(np.std(slow_torque)) < LEAST_TORQUE:
        return None
    quiet = _quiet(velocity, rate)
    envelopes = np.column_stack(
        [
            TORQUE_SIGN[name] * _envelope(recording, name, quiet, rate, len(slow_torque))
            for name in muscles
        ]
    )
    envelopes = envelopes - envelopes.mean(axis=0)
    target = slow_torque - slow_torque.mean()
    seen = _low_pass(envelopes, cutoff, rate)
    scale = np.linalg.norm(seen, axis=0)
    scale[scale == 0.0] = 1.0
    weights = nnls(seen / scale, target)[0] / scale
    explained = 1.0 - float(np.var(target - seen @ weights) / np.var(target))
    if explained < LEAST_SHARE:
        return None
    return np.asarray(slow_torque.mean() + envelopes @ weights)


def _quiet(velocity: np.ndarray, rate: float) -> np.ndarray:
    """Return 1 where no movement has just evoked a response, else 0, shape (n,)."""
    speed = np.abs(velocity)
    moving = speed > MOVING_SHARE * np.percentile(speed, 99.0)
    held = np.convolve(moving, np.ones(max(1, round(RESPONSE_S * rate))))[: len(speed)]
    quiet = (held < 0.5).astype(float)
    # Movement without a pause leaves no background to see: then all of it counts.
    return quiet if quiet.mean() > 0.05 else np.ones(len(speed))


def _envelope(
    recording: Recording, muscle: str, quiet: np.ndarray, rate: float, count: int
) -> np.ndarray:
    """Return the smoothed rectified EMG [V] at the model's rate, shape (count,)."""
    raw = np.nan_to_num(recording.emg[muscle])
    artefacts = butter(2, ARTEFACT_HZ, "highpass", fs=recording.rate, output="sos")
    rectified = np.abs(sosfiltfilt(artefacts, raw))
    step = round(recording.rate / rate)
    slow = resample_poly(rectified, 1, step, padtype="line")[:count] if step > 1 else rectified
    weight = np.maximum(_low_pass(quiet, ENVELOPE_HZ, rate), 0.02)
    return _low_pass(slow * quiet, ENVELOPE_HZ, rate) / weight


def _low_pass(signal: np.ndarray, cutoff: float, rate: float) -> np.ndarray:
    """Apply a zero-phase low-pass of second order along the first axis."""
    return np.asarray(
        sosfiltfilt(butter(2, cutoff, fs=rate, output="sos"), signal, axis=0), dtype=float
    )
