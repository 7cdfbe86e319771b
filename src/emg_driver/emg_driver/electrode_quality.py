"""Whether a channel carries EMG: flat lines, saturation, mains hum, amplitudes that skin electrodes
do not give.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from emg_driver.settings import ElectrodeSettings

WINDOW = 1.0
"""[s] Length that is checked at once: 1 Hz resolution separates a mains line from EMG."""
SHORTEST_STRETCH = 0.5
"""[s] Shortest stretch that is checked: with less, a mains line is not resolved (2 Hz)."""
BAND = (20.0, 450.0)
"""[Hz] Band in which EMG has its power (De Luca 2010: 20 to 450 Hz)."""
FLAT_PIECE_TIME = 0.025
"""[s] Length of a flat piece: no EMG stays within `flat_range` for so long: at 20 Hz and above it
would have passed through half a period."""
SATURATED_RUN = 5
"""Number of equal samples in a row at the largest or smallest value: noise of an amplifier does not
repeat five times at its extreme."""
SATURATED_SHARE = 0.01
"""Share of equal samples at the largest or smallest value; noise reaches its extreme once or,
coarsely sampled, a few times.
"""
LINE = 2
"""Number of bins on either side of a mains line that a Hann window spreads it to."""
HARMONICS = 3
"""Number of mains lines that are checked: the first three hold nearly all the hum of a loose
electrode."""


@dataclass(frozen=True)
class Defect:
    """Describes the defect of a channel.

    Attributes
    ----------
    kind
        ``not_finite``, ``flat``, ``saturated``, ``hum`` or ``too_large``.
    message
        Half a sentence with numbers.
    """

    kind: str
    message: str


def defects(emg: np.ndarray, rate: float, limits: ElectrodeSettings) -> list[Defect | None]:
    """Return what is wrong with each channel, None where nothing is.

    Parameters
    ----------
    emg
        Raw EMG [V], shape (n, m), equally spaced, at least `SHORTEST_STRETCH` long.
    rate
        Sampling rate [Hz].
    limits
        Beyond which a channel is bad.
    """
    return [
        _defect(np.ascontiguousarray(emg[:, channel]), rate, limits)
        for channel in range(emg.shape[1])
    ]


def _defect(emg: np.ndarray, rate: float, limits: ElectrodeSettings) -> Defect | None:
    bad = int(np.count_nonzero(~np.isfinite(emg)))
    if bad:
        return Defect("not_finite", f"{bad} of {len(emg)} samples are NaN or infinite")
    piece = max(round(FLAT_PIECE_TIME * rate), 2)
    pieces = emg[: len(emg) // piece * piece].reshape(-1, piece)
    spread = float(np.ptp(pieces, axis=1).min())
    if spread < limits.flat_range:
        return Defect(
            "flat", f"flat line: varies by {spread * 1e6:.3g} uV in {1e3 * FLAT_PIECE_TIME:g} ms"
        )
    count, run = at_extreme(emg)
    if run >= SATURATED_RUN or count >= SATURATED_SHARE * len(emg):
        largest = float(np.max(np.abs(emg)))
        return Defect(
            "saturated",
            f"saturated: {count} of {len(emg)} samples at the end of its range "
            f"({largest * 1e3:.3g} mV)",
        )
    power, total = mains_power(emg, rate, limits.mains_frequency)
    rms = float(np.sqrt(total))
    if rms > limits.largest_rms:
        return Defect(
            "too_large",
            f"{rms * 1e3:.3g} mV rms is more than skin electrodes give "
            f"({limits.largest_rms * 1e3:.3g} mV): "
            "another unit than declared, or a loose electrode",
        )
    if total > 0 and power / total > limits.hum_share:
        return Defect(
            "hum",
            f"{100 * power / total:.0f} % of its power is {limits.mains_frequency:g} Hz mains hum "
            f"({np.sqrt(power) * 1e6:.3g} uV rms)",
        )
    return None


def at_extreme(emg: np.ndarray) -> tuple[int, int]:
    """Return how many samples equal an extreme value of shape (n,), and how many in a row.

    Each number is the larger one of those for the largest and the smallest value.

    The extreme is the largest or the smallest value, whichever occurs more often.
    """
    count = longest = 0
    for extreme in (emg.max(), emg.min()):
        there = np.concatenate([[0], (emg == extreme).astype(int), [0]])
        steps = np.flatnonzero(np.diff(there))
        count = max(count, int(there.sum()))
        longest = max(longest, int(np.max(steps[1::2] - steps[::2])))
    return count, longest


def mains_power(emg: np.ndarray, rate: float, frequency: float) -> tuple[float, float]:
    """Return the power of the mains lines and of all of `BAND` [V^2], for EMG of shape (n,).

    The power of the lines is what exceeds their surroundings.
    """
    n = len(emg)
    window = np.hanning(n)
    spectrum = np.abs(np.fft.rfft((emg - emg.mean()) * window)) ** 2 * 2.0 / (n * np.sum(window**2))
    resolution = rate / n
    in_band = slice(
        int(np.ceil(BAND[0] / resolution)), int(min(BAND[1], rate / 2) / resolution) + 1
    )
    total = float(np.sum(spectrum[in_band]))
    lines = 0.0
    for harmonic in range(1, HARMONICS + 1):
        centre = round(harmonic * frequency / resolution)
        near = np.concatenate(
            [
                spectrum[centre - 4 * LINE : centre - LINE],
                spectrum[centre + LINE + 1 : centre + 4 * LINE + 1],
            ]
        )
        if centre + 4 * LINE < len(spectrum):
            lines += max(
                float(
                    np.sum(spectrum[centre - LINE : centre + LINE + 1])
                    - (2 * LINE + 1) * np.mean(near)
                ),
                0.0,
            )
    return lines, total
