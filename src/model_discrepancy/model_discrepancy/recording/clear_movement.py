"""Position and velocity are compared where the movement is clear above the encoder's noise, which a
derivative magnifies.
"""

from __future__ import annotations

import numpy as np

from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.spectrum import white_density

# Power of the movement over that of the encoder's noise: less than this bends a gain by 1 %, a
# third of the least that is found.
_LEAST_CLEARNESS = 100.0


def clear_spectra(
    recording: Recording, velocity: np.ndarray, part: np.ndarray, band: tuple[float, float]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return frequency [Hz], spectrum of the derivative of position and that of the velocity
    channel [rad/s], each shape (k,), at the k frequencies where the movement is clear.

    Parameters
    ----------
    recording
        With its position.
    velocity
        The velocity channel [rad/s], shape (n,).
    part
        Samples that count, shape (m,).
    band
        Lowest and highest frequency [Hz].
    """
    rate, window = recording.rate, np.hanning(len(part))
    f = np.fft.rfftfreq(len(part), 1.0 / rate)
    true, read = (
        np.fft.rfft((signal[part] - signal[part].mean()) * window)
        for signal in (np.gradient(recording.position) * rate, velocity)
    )
    white = 0.5 * white_density(recording.position, rate) * rate * float(window @ window)
    clear = np.abs(true) ** 2 > _LEAST_CLEARNESS * white * (2.0 * np.pi * f) ** 2
    clear &= (f > band[0]) & (f < band[1])
    # The gain of a central difference.
    return f[clear], true[clear] / np.sinc(2.0 * f[clear] / rate), read[clear]
