"""A bag shows the noise of each channel and how the actuator follows its reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import coherence, csd, welch

from model_discrepancy.recording.recording import Recording

# The band above all movement and below the anti-alias filter, as shares of half the sampling rate.
_NOISE_BAND = (0.5, 0.8)
# Resolution of 0.5 Hz: enough for a bandwidth of some tens of hertz, and thirty averages from a
# minute.
_SEGMENT_S = 2.0
# Where less of position follows the reference than this, the response there is not counted.
_LEAST_COHERENCE = 0.5
# Held positions: any actuator follows below this frequency.
_SLOW_HZ = 2.0


@dataclass(frozen=True)
class FollowingResponse:
    """Holds the reference-to-position response.

    Attributes
    ----------
    frequency
        [Hz], shape (k,), where the two are coherent.
    gain
        Magnitude [1], shape (k,).
    phase
        Unwrapped [rad], shape (k,).
    slow_gain
        Below 2 Hz [1].
    bandwidth
        Where the gain has fallen to 0.707 of the slow one [Hz]; None where it does not within the
        coherent band.
    delay
        Slope of the phase up to 10 Hz [s].
    """

    frequency: np.ndarray
    gain: np.ndarray
    phase: np.ndarray
    slow_gain: float
    bandwidth: float | None
    delay: float


def noise_levels(recording: Recording) -> dict[str, float]:
    """Return the standard deviation of each channel's white noise, by ``position[rad]`` and so on,
    from the flat part of its spectrum.
    """
    channels = {"position[rad]": recording.position, "torque[N.m]": recording.torque}
    if recording.velocity is not None:
        channels["velocity[rad/s]"] = recording.velocity
    half = 0.5 * recording.rate
    levels = {}
    for name, values in channels.items():
        frequency, density = welch(values, recording.rate, nperseg=int(_SEGMENT_S * recording.rate))
        band = (frequency > _NOISE_BAND[0] * half) & (frequency < _NOISE_BAND[1] * half)
        levels[name] = float(np.sqrt(np.median(density[band]) * half))
    return levels


def following_response(recording: Recording) -> FollowingResponse | None:
    """Return how position follows the reference; None without a reference that moves."""
    reference = recording.reference
    if reference is None or np.std(reference) == 0.0:
        return None
    length = int(_SEGMENT_S * recording.rate)
    frequency, own = welch(reference, recording.rate, nperseg=length)
    _, cross = csd(reference, recording.position, recording.rate, nperseg=length)
    _, alike = coherence(reference, recording.position, recording.rate, nperseg=length)
    inside = (frequency > 0.0) & (frequency <= 0.4 * recording.rate)
    # The band ends where the two stop being coherent for good.
    lost = np.flatnonzero(inside & (alike < _LEAST_COHERENCE) & (frequency > _SLOW_HZ))
    inside &= frequency < (frequency[lost[0]] if len(lost) else np.inf)
    if inside.sum() < 2 * _SLOW_HZ * _SEGMENT_S:
        return None
    f, response = frequency[inside], cross[inside] / own[inside]
    gain, phase = np.abs(response), np.unwrap(np.angle(response))
    slow = float(np.mean(gain[f <= _SLOW_HZ]))
    fallen = np.flatnonzero(gain < slow / np.sqrt(2.0))
    early = f <= 10.0
    delay = -float(f[early] @ phase[early]) / (2.0 * np.pi * float(f[early] @ f[early]))
    return FollowingResponse(
        f, gain, phase, slow, float(f[fallen[0]]) if len(fallen) else None, delay
    )
