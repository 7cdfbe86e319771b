"""Find out whether the velocity channel passes slow movement.

An amplifier that is coupled by a capacitor does not, ``V = g s / (s + 2 pi f_c)`` times the true
velocity: steps of position then look like steps with an overshoot, or like backlash.
"""

from __future__ import annotations

import numpy as np

from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.spectrum import white_density

# Corners that are looked for [Hz]: a slower one bends no movement of some seconds, and a faster one
# leaves nothing of a stretch.
CORNERS_HZ = np.geomspace(0.05, 20.0, 80)
# It must leave less than this share of what a gain, and of what a gain and a lag leave.
LEAST_CUT = 0.25
_LAGS_S = np.linspace(-0.02, 0.02, 41)
_BAND_HZ = (0.05, 20.0)
# Power of the movement over that of the encoder's noise at a frequency that is compared.
_LEAST_CLEARNESS = 100.0
_PARTS = 3


def coupling_corner(recording: Recording) -> tuple[float, float] | None:
    """Return the corner frequency of the velocity channel's coupling and its standard error [Hz];
    None where the channel passes slow movement, and without such a channel.

    Parameters
    ----------
    recording
        A usable one.
    """
    if recording.velocity is None:
        return None
    corners = []
    for part in np.array_split(np.arange(len(recording.position)), _PARTS):
        f, true, read = _clear_spectra(recording, recording.velocity, part)
        if not len(f):
            return None
        coupled = [_left(1j * f / (1j * f + corner) * true, read) for corner in CORNERS_HZ]
        lagging = min(_left(np.exp(-2j * np.pi * f * lag) * true, read) for lag in _LAGS_S)
        if min(coupled) > LEAST_CUT * lagging:
            return None
        corners.append(float(CORNERS_HZ[int(np.argmin(coupled))]))
    return float(np.mean(corners)), float(np.std(corners) / np.sqrt(_PARTS))


def _clear_spectra(
    recording: Recording, velocity: np.ndarray, part: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frequency, spectrum of the derivative of position and that of the velocity channel,
    where the movement is clear.
    """
    rate, window = recording.rate, np.hanning(len(part))
    f = np.fft.rfftfreq(len(part), 1.0 / rate)
    true, read = (
        np.fft.rfft((signal[part] - signal[part].mean()) * window)
        for signal in (np.gradient(recording.position) * rate, velocity)
    )
    white = 0.5 * white_density(recording.position, rate) * rate * float(window @ window)
    noise = white * (2.0 * np.pi * f) ** 2
    clear = np.abs(true) ** 2 > _LEAST_CLEARNESS * noise
    clear &= (f > _BAND_HZ[0]) & (f < _BAND_HZ[1])
    return f[clear], true[clear], read[clear]


def _left(expected: np.ndarray, read: np.ndarray) -> float:
    """Return the power that the best gain leaves between two spectra."""
    gain = float(np.real(np.vdot(expected, read)) / np.real(np.vdot(expected, expected)))
    return float(np.sum(np.abs(read - gain * expected) ** 2))
