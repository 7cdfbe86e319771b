"""How well a measure repeats over visits: intraclass correlation and standard error of measurement.

Shrout & Fleiss, Psychol. Bull. 86 (1979) 420-428: ICC(2,1), two-way random effects, absolute
agreement, single measure. Weir, J. Strength Cond. Res. 19 (2005) 231-240: the standard error of
measurement from the mean squares within.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

MIN_SUBJECTS, MIN_VISITS = 2, 2


@dataclass(frozen=True)
class Reliability:
    """Holds the reliability of one quantity over visits.

    Attributes
    ----------
    icc
        ICC(2,1); NaN with one subject.
    sem
        Standard error of measurement, in the quantity's unit.
    subjects, visits
        What it was computed from.
    """

    icc: float
    sem: float
    subjects: int
    visits: int


def reliability(values: np.ndarray) -> Reliability | None:
    """Compute the reliability of a measure.

    Parameters
    ----------
    values
        Shape (subjects, visits); rows with a NaN are left out.

    Returns
    -------
    Reliability | None
        None with fewer than two visits, or without a complete subject. One subject alone has a
        standard error of measurement, and no ICC.
    """
    table = np.asarray(values, dtype=float)
    table = table[np.isfinite(table).all(axis=1)] if table.ndim == 2 else np.empty((0, 0))
    n, k = table.shape
    if n < 1 or k < MIN_VISITS:
        return None
    total = table.mean()
    within = table - table.mean(axis=1, keepdims=True)
    if n < MIN_SUBJECTS:
        sem = float(np.sqrt(np.sum(within**2) / (k - 1)))
        return Reliability(float("nan"), sem, n, k)
    between_subjects = k * np.sum((table.mean(axis=1) - total) ** 2) / (n - 1)
    between_visits = n * np.sum((table.mean(axis=0) - total) ** 2) / (k - 1)
    residual = within - (table.mean(axis=0) - total)
    error = np.sum(residual**2) / ((n - 1) * (k - 1))
    spread = between_subjects + (k - 1) * error + k * (between_visits - error) / n
    icc = (between_subjects - error) / spread if spread > 0 else float("nan")
    # All that differs between visits of one subject, drift included: what absolute agreement asks.
    sem = float(np.sqrt(np.sum(within**2) / (n * (k - 1))))
    return Reliability(float(icc), sem, n, k)
