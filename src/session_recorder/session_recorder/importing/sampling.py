"""Whether the times of a file are evenly spaced, rounded, or irregular; and an even grid where they
are not.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ankle_interfaces.continuity import STEP_TOLERANCE, sampling_rate
from ankle_interfaces.errors import SamplingError
from ankle_interfaces.resampling import regular_grid, resample
from session_recorder.errors import ImportRefused

MAX_IRREGULAR_SHARE = 0.01
"""Largest share of the steps that may be off without being whole numbers of intervals; a late
sample once in a while is a fault of the recording, more is its nature."""
MAX_REPEATED_SHARE = 0.01
"""Largest share of samples that may have the time of the one before, as where a writer repeats a
row once in a while; more are times with too few digits."""
CUT_STEPS = 16
"""Steps within which a time that was cut to whole milliseconds makes up for a repeated one."""
MAX_BRIDGED_INTERVALS = 5.0
"""Largest number of median intervals that resampling bridges by a line; a longer pause stays a gap.
"""
MAX_GRID = 200_000_000
"""Largest number of samples of an even grid: a day at 2048 Hz. More come from damaged times."""
GAP_TOLERANCE = 0.2
"""Part of an interval by which a gap may differ from a whole number of intervals."""


@dataclass(frozen=True)
class Sampling:
    """Describes the spacing of a column of times.

    Attributes
    ----------
    kind
        ``regular`` (gaps allowed), ``rounded`` (even, but written with few digits) or
        ``irregular``.
    rate
        Sampling rate [Hz]; for irregular times the mean rate outside pauses.
    sentence
        What is odd, with numbers; empty for regular times.
    """

    kind: str
    rate: float
    sentence: str = ""


def repeated_times(time: np.ndarray) -> np.ndarray:
    """Return which samples have the time of the sample before and can be left out.

    Parameters
    ----------
    time
        [s], shape (n,).

    Returns
    -------
    np.ndarray
        Booleans of shape (n,); all False where more than `MAX_REPEATED_SHARE` repeat a time, and
        where the times are even ones with their digits cut off.
    """
    repeated = np.diff(time, prepend=np.nan) == 0.0
    few = np.count_nonzero(repeated) <= MAX_REPEATED_SHARE * len(time)
    return repeated & (few and not _are_cut(np.diff(time)))


def _are_cut(steps: np.ndarray) -> bool:
    """Return whether every repeated time is made up for by a doubled step nearby, as where
    ``0.29 * 1000`` is cut to 289 ms.
    """
    step = float(np.median(steps))
    repeated = np.flatnonzero(steps == 0.0)
    doubled = np.flatnonzero(np.abs(steps - 2.0 * step) < GAP_TOLERANCE * step)
    return (
        len(repeated) > 0
        and len(repeated) == len(doubled)
        and int(np.max(np.abs(repeated - doubled))) <= CUT_STEPS
    )


def judge_times(time: np.ndarray) -> Sampling:
    """Judge a column of times.

    Parameters
    ----------
    time
        [s], finite, shape (n,).

    Raises
    ------
    SamplingError
        Fewer than two times, or time does not increase at all.
    """
    if len(time) < 2:
        raise SamplingError(f"{len(time)} sample(s) do not tell a sampling rate")
    steps = np.diff(time)
    if np.all(steps <= 0):
        raise SamplingError(f"time does not increase: median step {float(np.median(steps)):g} s")
    rounded = _rounded(time, steps)
    if rounded is not None:
        return rounded
    rate = sampling_rate(time)
    counts = steps * rate
    nearest = np.maximum(np.round(counts), 1.0)
    off = np.abs(counts - nearest) > np.where(nearest == 1.0, STEP_TOLERANCE, GAP_TOLERANCE)
    off &= steps > 0
    uneven = np.std(counts[(counts > 0) & (counts < MAX_BRIDGED_INTERVALS)]) > GAP_TOLERANCE / 2
    if off.mean() <= MAX_IRREGULAR_SHARE and not uneven:
        return Sampling("regular", rate)
    short = steps[(steps > 0) & (counts < MAX_BRIDGED_INTERVALS)]
    mean = 1.0 / float(np.mean(short))
    lowest, highest = np.percentile(short, [1.0, 99.0])
    return Sampling(
        "irregular",
        float(round(mean)) if mean > 100 else mean,
        f"the sampling is irregular: steps of {1e3 * lowest:.3g} to {1e3 * highest:.3g} ms, on "
        f"average {1e3 / mean:.3g} ms",
    )


def _rounded(time: np.ndarray, steps: np.ndarray) -> Sampling | None:
    """Return even times that were written with few digits: all lie within one digit of a line."""
    different, counts = np.unique(np.round(steps, 9), return_counts=True)
    if not 2 <= len(different) <= 3 or np.any(steps < 0):
        return None
    digit = float(np.min(np.diff(different)))
    step = float((time[-1] - time[0]) / (len(time) - 1))
    few = np.sort(counts)[-2] < MAX_IRREGULAR_SHARE * len(steps) and not _are_cut(steps)
    if few or digit > MAX_BRIDGED_INTERVALS * step:
        return None  # a gap or two, not rounding
    line = time[0] + step * np.arange(len(time))
    if np.max(np.abs(time - line)) > 1.01 * digit or digit < 0.02 * step:
        return None
    # The ends are rounded as well; a rate that is whole within what they leave open is meant.
    rate = 1.0 / step
    open_ = 2.0 * digit / (time[-1] - time[0])
    if abs(round(rate) / rate - 1.0) <= max(open_, 1e-4):
        rate = float(round(rate))
    return Sampling(
        "rounded",
        rate,
        f"times are rounded to {1e3 * digit:.3g} ms; the samples are taken as evenly spaced at "
        f"{rate:.6g} Hz",
    )


def resample_columns(
    time: np.ndarray, columns: dict[str, np.ndarray], rate: float
) -> tuple[np.ndarray, dict[str, np.ndarray], int]:
    """Return columns on an even grid.

    Even samples without a gap go through a filter that keeps what both rates can hold, and lets
    nothing fold down from above. Others are put onto the grid by lines between neighbours.

    Parameters
    ----------
    time
        [s], shape (n,); where it runs back, samples are put into order.
    columns
        Samples of each column, shape (n,).
    rate
        Of the grid [Hz].

    Returns
    -------
    tuple[np.ndarray, dict[str, np.ndarray], int]
        Times of shape (k,), columns of shape (k,), and how many grid points were left out because
        they lie in a pause.

    Raises
    ------
    ImportRefused
        The times span more than `MAX_GRID` samples.
    """
    span = float(np.max(time) - np.min(time))
    if not span * rate <= MAX_GRID:
        raise ImportRefused(
            f"time column: from {np.min(time):g} to {np.max(time):g} s at {rate:g} Hz would be "
            f"{span * rate:.3g} samples; allowed: {MAX_GRID:g}. Is a time damaged, or in ms?"
        )
    even = _band_limited(time, columns, rate)
    if even is not None:
        return *even, 0
    order = np.argsort(time, kind="stable")
    keep = np.concatenate([[True], np.diff(time[order]) > 0])
    chosen = order[keep]
    grid, values = regular_grid(
        time[chosen], np.column_stack([column[chosen] for column in columns.values()]), rate
    )
    own = time[chosen]
    behind = np.clip(np.searchsorted(own, grid, side="right"), 1, len(own) - 1)
    pause = (own[behind] - own[behind - 1]) * rate > MAX_BRIDGED_INTERVALS
    on_sample = np.minimum(np.abs(own[behind] - grid), np.abs(own[behind - 1] - grid)) * rate < 0.5
    kept = ~pause | on_sample
    return (
        grid[kept],
        {name: values[kept, k] for k, name in enumerate(columns)},
        int(np.count_nonzero(~kept)),
    )


def _band_limited(
    time: np.ndarray, columns: dict[str, np.ndarray], rate: float
) -> tuple[np.ndarray, dict[str, np.ndarray]] | None:
    """Return even samples at another rate, None where a time or a value is missing."""
    try:
        sampling = judge_times(time)
    except ValueError:
        return None
    line = time[0] + np.arange(len(time)) / sampling.rate
    if sampling.kind == "irregular" or np.max(np.abs(time - line)) * sampling.rate > 1.0:
        return None
    if not all(np.isfinite(values).all() for values in columns.values()):
        return None
    made = {name: resample(values, sampling.rate, rate) for name, values in columns.items()}
    count = int(np.floor((line[-1] - line[0]) * rate + 1e-6)) + 1
    grid = time[0] + np.arange(count) / rate
    return grid, {name: values[:count] for name, values in made.items()}
