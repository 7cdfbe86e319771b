"""Find out whether the velocity channel passes slow movement.

An amplifier that is coupled by a capacitor does not, ``V = g s / (s + 2 pi f_c)`` times the true
velocity: steps of position then look like steps with an overshoot, or like backlash.
"""

from __future__ import annotations

import numpy as np

from model_discrepancy.recording.clear_movement import clear_spectra
from model_discrepancy.recording.recording import Recording

# Corners that are looked for [Hz]: a slower one bends no movement of some seconds, and a faster one
# leaves nothing of a stretch.
CORNERS_HZ = np.geomspace(0.05, 20.0, 80)
# It must leave less than this share of what a gain, and of what a gain and a lag leave.
LEAST_CUT = 0.25
_LAGS_S = np.linspace(-0.02, 0.02, 41)
_BAND_HZ = (0.05, 20.0)
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
        f, true, read = clear_spectra(recording, recording.velocity, part, _BAND_HZ)
        if not len(f):
            return None
        coupled = [_left(1j * f / (1j * f + corner) * true, read) for corner in CORNERS_HZ]
        lagging = min(_left(np.exp(-2j * np.pi * f * lag) * true, read) for lag in _LAGS_S)
        if min(coupled) > LEAST_CUT * lagging:
            return None
        corners.append(float(CORNERS_HZ[int(np.argmin(coupled))]))
    return float(np.mean(corners)), float(np.std(corners) / np.sqrt(_PARTS))


def _left(expected: np.ndarray, read: np.ndarray) -> float:
    """Return the power that the best gain leaves between two spectra."""
    gain = float(np.real(np.vdot(expected, read)) / np.real(np.vdot(expected, expected)))
    return float(np.sum(np.abs(read - gain * expected) ** 2))
