"""Whether responses to movements differ from one movement to the next, more than torque at rest."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import numpy as np
from scipy.fft import irfft, rfft, rfftfreq

from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.reflex_variation import (
    LEAST_ROWS,
    REST_S,
    ReflexVariation,
    moved_from_rest,
    since_movement,
)
from model_discrepancy.fit.rows import Rows

# After the plate's last movement: intrinsic torque, and the short-latency reflex. Its tail is not
# judged, in which the reflex' own variation is not known well where responses overlap.
WINDOWS_S = ((0.0, 0.04), (0.04, 0.12))
# Whitened power after movements over that at rest, the reflex' variation taken out. Recordings
# without mismatch: 0.94 to 1.9, and up to 3.5 where the reflex changes in the course of a response.
LEAST_VARIATION = 4.0
# Bands in which torque that varies is told from torque that does not, the lowest with all below it.
# On a servo that gives way the whitened excess lay at 45 to 80 Hz, a hundredth of a newton metre.
_OCTAVES = 5
# Filters of an octave are longer than the windows, and mix them with the rest around them.
LEAST_IN_OCTAVE = 0.5 * LEAST_VARIATION
# Where rest is rarer than this, responses overlap and cannot be compared one by one.
_LEAST_REST_SHARE = 0.15


def response_variation(
    fitter: Fitter, fit: Fit, reflex: ReflexVariation
) -> tuple[float, tuple[float, float], float]:
    """Return the `variation`, `window` [s] and `varying_share` of `variability.Variability`.

    Parameters
    ----------
    fitter, fit
        Of the recording.
    reflex
        How its reflex varies, which is taken out.
    """
    rows = fitter.rows
    since = since_movement(fitter)
    squared = reflex.residual**2
    rest = rows.used & (since > REST_S)
    if rest.sum() < max(LEAST_ROWS, _LEAST_REST_SHARE * rows.used.sum()):
        return float("nan"), WINDOWS_S[0], 0.0
    level = float(np.mean(squared[rest]))
    # Otherwise an earlier reflex, which varies, counts as this movement's response.
    single = rows.used & moved_from_rest(fitter)
    ratios = {
        window: float(np.mean(squared[inside])) / level
        for window in WINDOWS_S
        if (inside := single & _within(since, window)).sum() >= LEAST_ROWS
    }
    if not ratios:
        return float("nan"), WINDOWS_S[0], 0.0
    largest = max(ratios, key=lambda window: ratios[window])
    inside = single & _within(since, largest)
    # The size of a whitened power says nothing of newton metres, and the reflex' own variation is
    # most of the plain one: what varies counts where it does.
    bands = zip(
        _in_octaves(rows, reflex.residual),
        _in_octaves(rows, fit.plain - reflex.torque),
        strict=True,
    )
    excess = sum(
        float(np.mean(plain[inside] ** 2) - np.mean(plain[rest] ** 2))
        for whitened, plain in bands
        if np.mean(whitened[inside] ** 2) > LEAST_IN_OCTAVE * np.mean(whitened[rest] ** 2)
    )
    share = (rows.used & _within(since, largest)).sum() / rows.used.sum()
    variance = float(np.var(fitter.plain_target[rows.used]))
    return ratios[largest], largest, excess * share / variance


def _in_octaves(rows: Rows, series: np.ndarray) -> Iterator[np.ndarray]:
    """Yield what each of `_OCTAVES` bands below the limit holds of a series, shape (n,)."""
    spectrum, frequency = rfft(series), rfftfreq(len(series), 1.0 / rows.rate)
    edges = [0.0, *(rows.limit / 2.0**k for k in range(_OCTAVES - 1, -1, -1))]
    for low, high in pairwise(edges):
        inside = (frequency >= low) & (frequency < high)
        yield irfft(np.where(inside, spectrum, 0.0), len(series))


def _within(since: np.ndarray, window: tuple[float, float]) -> np.ndarray:
    return (since >= window[0]) & (since < window[1])
