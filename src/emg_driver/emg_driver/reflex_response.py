"""Background and reflex activity about one onset.

``background = mean(r)`` over the 40 ms before the onset, ``reflex = sum(r - background) / rate``
from 40 to 60 ms after it, with r the rectified EMG: the area under the curve minus the background.

Source: van 't Veld et al. 2018, section III-B.3 and figure 4.
"""

from __future__ import annotations

import numpy as np

from emg_driver.settings import Settings

# A sample on the edge of a window belongs to it whatever the rounding of its time; far below any
# sampling interval.
TIME_ROUNDING = 1e-7  # s


def window(time: np.ndarray, start: float, end: float, rate: float) -> slice | None:
    """Return the samples with start <= t < end; None unless all of them are there.

    Parameters
    ----------
    time
        Ascending times [s], shape (n,).
    start
        Time of the first sample [s].
    end
        First time that no longer counts [s].
    rate
        Sampling rate [Hz].
    """
    first, stop = (
        int(k) for k in np.searchsorted(time, [start - TIME_ROUNDING, end - TIME_ROUNDING])
    )
    # How many samples fall into the window depends on where they lie by one.
    if stop - first < (end - start) * rate - 1.0:
        return None
    return slice(first, stop)


def respond(
    time: np.ndarray, rectified: np.ndarray, rate: float, onset: float, settings: Settings
) -> tuple[np.ndarray, np.ndarray]:
    """Return background [V] and reflex [V.s] of m muscles, each of shape (m,).

    A value is NaN where a sample of its window is missing.

    Parameters
    ----------
    time
        Times of the samples [s], shape (n,).
    rectified
        [V], shape (n, m).
    rate
        Sampling rate [Hz].
    onset
        Time of the onset [s].
    settings
        Windows of background and reflex.
    """
    before = window(time, onset - settings.background_window, onset, rate)
    after = window(time, onset + settings.reflex_start, onset + settings.reflex_end, rate)
    if before is None or after is None:
        missing = np.full(rectified.shape[1], np.nan)
        return missing, missing
    background = rectified[before].mean(axis=0)
    return background, (rectified[after] - background).sum(axis=0) / rate
