"""The movements of a recording, and the windows and bands in which its torque is compared."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from model_discrepancy.fit.columns import Columns

# Before the movement (control), intrinsic, short-latency reflex, its tail and later reflexes, late.
WINDOWS_S = ((-0.04, 0.0), (0.0, 0.04), (0.04, 0.12), (0.12, 0.2), (0.2, 0.4))
BANDS_HZ = ((0.5, 3.0), (3.0, 8.0), (8.0, 15.0), (15.0, 30.0), (30.0, 60.0))
# Movement begins where speed passes this share of its 99th percentile after at least 0.1 s below
# it.
_ONSET_SHARE = 0.15
_QUIET_S = 0.1
# A movement's response, its reflexes included, is over after this time.
RESPONSE_S = 0.4


@dataclass(frozen=True)
class Onsets:
    """Holds the time [s], direction (+1 dorsiflexion) and size [rad] of movements, each of shape
    (k,).
    """

    time: np.ndarray
    direction: np.ndarray
    size: np.ndarray


def find_onsets(columns: Columns) -> Onsets:
    """Find the movements of a recording."""
    m = columns.motion
    speed = np.abs(m.velocity)
    fast = speed > _ONSET_SHARE * np.percentile(speed, 99.0)
    starts = np.flatnonzero(fast[1:] & ~fast[:-1]) + 1
    quiet = int(_QUIET_S * m.rate)
    kept = [
        s for s in starts if s > quiet and not fast[s - quiet : s].any() and s + quiet < len(speed)
    ]
    index = np.array(kept, dtype=int)
    # A pulse returns within 40 ms: size and direction are those of the first 30 ms.
    reach = np.array(
        [m.position[min(s + int(0.03 * m.rate), len(speed) - 1)] - m.position[s] for s in index]
    )
    return Onsets(index / m.rate, np.sign(reach), np.abs(reach))


@dataclass(frozen=True)
class Peak:
    """Holds the largest torque that something adds.

    Attributes
    ----------
    torque
        Its mean after movements in the direction where that is larger, counted from its value at
        their onset; under a continuous movement its largest deviation from its mean [N.m]. With
        its sign.
    time
        After the onset [s]; None under a continuous movement.
    direction
        ``dorsiflexion`` or ``plantarflexion``; None under a continuous movement.
    """

    torque: float
    time: float | None = None
    direction: str | None = None

    @property
    def sentence(self) -> str:
        """Return it in words that follow a subject."""
        word = "adds" if self.torque >= 0 else "takes away"
        size = f"{word} up to {abs(self.torque):.2f} N.m"
        if self.time is None:
            return size
        return f"{size}, {1000 * self.time:.0f} ms after a {self.direction} movement"


def peak_after(rate: float, torque: np.ndarray, onsets: Onsets) -> Peak:
    """Return the largest torque after movements.

    Parameters
    ----------
    rate
        Rows per second [Hz].
    torque
        [N.m], shape (n,).
    onsets
        Of the movements.
    """
    reach = np.arange(int(RESPONSE_S * rate))
    peaks = []
    for sign, word in ((1.0, "dorsiflexion"), (-1.0, "plantarflexion")):
        index = np.round(onsets.time[onsets.direction == sign] * rate).astype(int)
        index = index[index + len(reach) < len(torque)]
        if len(index):
            mean = (torque[index[:, None] + reach] - torque[index - 2][:, None]).mean(axis=0)
            k = int(np.argmax(np.abs(mean)))
            peaks.append(Peak(float(mean[k]), float(reach[k] / rate), word))
    away = torque - np.mean(torque)
    peaks = peaks or [Peak(float(away[np.argmax(np.abs(away))]))]
    return max(peaks, key=lambda peak: abs(peak.torque))
