"""Pearson's r with its 95 % interval: bias-corrected accelerated bootstrap over pairs (Efron 1987),
by `scipy.stats.bootstrap`.

Source: van 't Veld et al. 2018, section III-B.4.
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass

import numpy as np
from scipy import stats

RESAMPLES = 9999
"""Number of bootstrap samples: the ends of a 95 % interval then vary by less than 0.01 from seed to
seed."""
CONFIDENCE = 0.95
LEAST_PAIRS = 6
"""Least number of pairs: fewer give no interval worth the name: resamples repeat too few points."""


@dataclass(frozen=True)
class Correlation:
    """Holds a correlation over n pairs.

    Attributes
    ----------
    r
        Pearson's correlation coefficient; NaN where it is not defined.
    low, high
        Ends of the confidence interval.
    n
        Number of pairs.
    """

    r: float
    low: float
    high: float
    n: int


def z_scores(values: np.ndarray, groups: np.ndarray) -> np.ndarray:
    """Return ``(value - mean) / standard deviation`` within each group, shape (n,).

    Each subject has a slope and an intercept of their own (paper, figure 5). A group with fewer
    than three finite values or without variation has no z-score: NaN.

    Parameters
    ----------
    values
        Shape (n,); those that are not finite stay NaN and count for nothing.
    groups
        Label of each value, shape (n,).
    """
    out = np.full(len(values), np.nan)
    for group in dict.fromkeys(groups.tolist()):
        own = (groups == group) & np.isfinite(values)
        deviation = np.std(values[own], ddof=1) if own.sum() >= 3 else 0.0
        if deviation > 0.0:
            out[own] = (values[own] - np.mean(values[own])) / deviation
    return out


def correlate(
    x: np.ndarray, y: np.ndarray, seed: int = 0, resamples: int = RESAMPLES
) -> Correlation:
    """Correlate two measures over the pairs in which both are finite.

    Parameters
    ----------
    x, y
        Paired values, shape (n,).
    seed
        Seed of the bootstrap.
    resamples
        Draws of the bootstrap.
    """
    good = np.isfinite(x) & np.isfinite(y)
    x, y, n = x[good], y[good], int(good.sum())
    if n < LEAST_PAIRS or np.ptp(x) == 0.0 or np.ptp(y) == 0.0:
        return Correlation(float("nan"), float("nan"), float("nan"), n)
    with warnings.catch_warnings():
        # A resample that repeats one point has no correlation; scipy leaves it out and says so each
        # time.
        warnings.simplefilter("ignore", stats.DegenerateDataWarning)
        result = stats.bootstrap(
            (x, y),
            _pearson,
            paired=True,
            vectorized=True,
            n_resamples=resamples,
            confidence_level=CONFIDENCE,
            method="BCa",
            rng=np.random.default_rng(seed),
        )
    interval = result.confidence_interval
    return Correlation(float(_pearson(x, y)), float(interval.low), float(interval.high), n)


def _pearson(x: np.ndarray, y: np.ndarray, axis: int = -1) -> np.ndarray:
    x = x - x.mean(axis=axis, keepdims=True)
    y = y - y.mean(axis=axis, keepdims=True)
    return (x * y).sum(axis=axis) / np.sqrt((x * x).sum(axis=axis) * (y * y).sum(axis=axis))
