"""What a residual holds that no movement predicts: tremor, a line, and responses that differ from
one movement to the next.

A generic bank of regressors cannot see any of them, because they are no function of the movement.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.signal import welch

from model_discrepancy.criticism.locate import Onsets
from model_discrepancy.fit.fitter import Fit, Fitter
from model_discrepancy.recording.channel_gains import Finding

# Physiological tremor of the ankle: 6 to 12 Hz (Lakie, Vernooij, Osborne & Reynolds 2012, J.
# Physiol. 590, 6145), and a margin.
TREMOR_HZ = (5.5, 13.0)
LINES_HZ = (13.0, 78.0)
# Power of a peak over the median of its surroundings. Residuals of 10 simulated recordings without
# tremor or line: 1.0 to 1.7.
LEAST_PEAK = 4.0
# Periodograms of 2 s: half a hertz wide, 30 of them in a minute.
SEGMENT_S = 2.0
# Width of a tremor's peak, and of the surroundings that it is compared with.
_PEAK_HZ, _AROUND_HZ = 1.5, 5.0
# After a movement: intrinsic torque, short-latency reflex, its tail. Then the joint is at rest
# again.
WINDOWS_S = ((0.0, 0.04), (0.04, 0.12), (0.12, 0.25))
REST_S = 0.3
# Whitened power after movements over that at rest. Recordings without mismatch: 0.94 to 1.12 once
# the channels are aligned, up to 1.9 where torque is so clean (37 dB) that the noise of position
# shows.
LEAST_VARIATION = 2.2
# Rows at rest that give the ratio to 10 %.
_LEAST_ROWS = 200


@dataclass(frozen=True)
class Unpredictable:
    """What no movement predicts.

    Attributes
    ----------
    tremor
        A finding, or None.
    line_hz
        Frequency of a narrow line outside the tremor's band, or None.
    variation
        Largest ratio of the residual's power after movements to that at rest; NaN where the joint
        is never at rest.
    window
        In which window after the movement [s].
    """

    tremor: Finding | None
    line_hz: float | None
    variation: float
    window: tuple[float, float]

    @property
    def sentences(self) -> list[str]:
        """What is there, besides a tremor, in plain words."""
        found = []
        if self.line_hz is not None:
            found.append(
                f"the torque holds a line at {self.line_hz:.1f} Hz that no movement makes: "
                "pick-up or a vibration"
            )
        if self.variation > LEAST_VARIATION:
            low, high = (1000 * side for side in self.window)
            found.append(
                f"{low:.0f} to {high:.0f} ms after a movement the torque differs from one "
                f"movement to the next {self.variation:.1f} times "
                "as much (in power) as at rest: something that is no function of the movement "
                "changes the response"
            )
        return found


def unpredictable(fitter: Fitter, fit: Fit, onsets: Onsets) -> Unpredictable:
    """Look for it in the residual of this fit."""
    tremor, line = _peaks(fitter, fit)
    variation, window = _variation(fitter, fit, onsets)
    return Unpredictable(tremor, line, variation, window)


def _peaks(fitter: Fitter, fit: Fit) -> tuple[Finding | None, float | None]:
    rows = fitter.rows
    segments = int(rows.used.sum() / (SEGMENT_S * rows.rate))
    frequency, power = welch(fit.plain[rows.used], rows.rate, nperseg=int(SEGMENT_S * rows.rate))
    distance = np.abs(frequency[:, None] - frequency[None, :])
    around = np.array([np.median(power[(d < _AROUND_HZ) & (d > _PEAK_HZ)]) for d in distance])
    ratio = power / np.maximum(around, 1e-30)
    tremor = None
    k = _highest(ratio, frequency, TREMOR_HZ)
    if ratio[k] > LEAST_PEAK:
        inside = distance[k] < _PEAK_HZ
        excess = float(np.sum(power[inside] - around[inside]) * (frequency[1] - frequency[0]))
        rms = float(np.sqrt(max(excess, 0.0)))
        # A narrow-band process has 2 T Δf degrees of freedom, at least the number of segments.
        error = rms / np.sqrt(2.0 * max(segments, 1))
        sentence = (
            f"The muscles tremble at {frequency[k]:.1f} Hz with {rms:.2f} N.m rms, "
            "whatever the movement."
        )
        values = {
            "frequency[Hz]": (float(frequency[k]), float(frequency[1])),
            "rms[N.m]": (rms, error),
        }
        tremor = Finding("tremor", "activation", values, sentence)
    k = _highest(ratio, frequency, LINES_HZ)
    return tremor, float(frequency[k]) if ratio[k] > LEAST_PEAK else None


def _highest(ratio: np.ndarray, frequency: np.ndarray, band: tuple[float, float]) -> int:
    return int(np.argmax(np.where((frequency >= band[0]) & (frequency <= band[1]), ratio, 0.0)))


def _variation(fitter: Fitter, fit: Fit, onsets: Onsets) -> tuple[float, tuple[float, float]]:
    rows = fitter.rows
    since = np.full(rows.count, np.inf)
    for time in onsets.time:
        first = int(np.ceil(time * rows.rate))
        since[first:] = (np.arange(first, rows.count)) / rows.rate - time
    squared = fit.residual**2
    rest = rows.used & (since > REST_S)
    if rest.sum() < _LEAST_ROWS:
        return float("nan"), WINDOWS_S[0]
    level = float(np.mean(squared[rest]))
    ratios = [
        float(np.mean(squared[rows.used & (since >= low) & (since < high)])) / level
        for low, high in WINDOWS_S
    ]
    k = int(np.argmax(ratios))
    return ratios[k], WINDOWS_S[k]
