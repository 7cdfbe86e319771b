"""What one hold gives: mean K and G of its estimates, mean background and reflex of its EMG
responses.

Averaging the responses one by one is the same as responding to the ensemble average, because
background and area are linear in the rectified EMG (van 't Veld et al. 2018, section III-B.3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from emg_driver.muscles import (
    BACKGROUND,
    DORSIFLEXING,
    MUSCLES,
    REFLEX,
    RESPONSE_COLUMNS,
    STRETCHED_BY,
)
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.simultaneous.doubt import DOUBT_THRESHOLD
from session_analysis.holds import Excluded, Hold

LEAST_VALID = 0.9
"""Least share of a hold's estimates that must be valid; more missing and its mean is of another
stretch of time than the EMG's."""
LEAST_RESPONSES = 50
"""Least number of responses of a muscle in a hold (the paper: about 100). With 50 the mean of a
reflex that varies by 30 % from stretch to stretch is known to 4 %."""


@dataclass(frozen=True)
class HoldMeasures:
    """Holds one hold's paired data.

    Attributes
    ----------
    subject
        Whose.
    hold
        When, at which torque target.
    K
        Mean intrinsic stiffness [N.m/rad].
    G
        Mean reflex gain [N.m.s/rad].
    background
        Mean background of each muscle [V], shape (4,), NaN where it has too few responses.
    reflex
        Mean reflex of each muscle [V.s], shape (4,), likewise.
    responses
        Number of responses of each muscle to its own stretch, shape (4,).
    doubtful
        Share of the estimates behind K and G that are doubtful, 0 to 1; NaN where the estimator
        states no doubt.
    bag
        The recording.
    """

    subject: str
    hold: Hold
    K: float
    G: float
    background: np.ndarray
    reflex: np.ndarray
    responses: np.ndarray
    doubtful: float = math.nan
    bag: Path = Path()


def measure_hold(
    subject: str, hold: Hold, estimates: np.ndarray, responses: np.ndarray
) -> tuple[HoldMeasures | None, list[Excluded]]:
    """Return a hold's data and what was left out; the data are None where it cannot be used.

    The background is that before dorsiflexing onsets for all muscles, the reflex that after the
    onsets that stretch the muscle (paper, section III-B.3).

    Parameters
    ----------
    subject
        Whose hold it is.
    hold
        When it began and ended, and its target.
    estimates
        Of the session, shape (n, 12), columns `ESTIMATE_COLUMNS`.
    responses
        Of the session, shape (k, 10), columns `RESPONSE_COLUMNS`.
    """
    what = f"{subject}, hold {hold.number} ({hold.target:g} N.m)"
    during = estimates[(estimates[:, 0] >= hold.start) & (estimates[:, 0] <= hold.end)]
    valid = during[during[:, ESTIMATE_COLUMNS.index("valid[1]")] > 0]
    if not len(during):
        return None, [Excluded(what, "there is no estimate in it")]
    if len(valid) < LEAST_VALID * len(during):
        share = 100.0 * len(valid) / len(during)
        return None, [
            Excluded(
                what, f"{share:.0f} % of its estimates are valid, less than {100 * LEAST_VALID:g} %"
            )
        ]
    K, G = (
        float(np.mean(valid[:, ESTIMATE_COLUMNS.index(name)]))
        for name in ("K[N.m/rad]", "G[N.m.s/rad]")
    )
    rows = responses[(responses[:, 0] >= hold.start) & (responses[:, 0] <= hold.end)]
    background, reflex, counts = np.full(4, np.nan), np.full(4, np.nan), np.zeros(4, dtype=int)
    excluded = []
    for index, muscle in enumerate(MUSCLES):
        before = _column(rows, BACKGROUND[index], DORSIFLEXING)
        after = _column(rows, REFLEX[index], STRETCHED_BY[muscle])
        counts[index] = min(len(before), len(after))
        if counts[index] < LEAST_RESPONSES:
            excluded.append(
                Excluded(
                    f"{what}, {muscle}",
                    f"{counts[index]} usable responses, fewer than {LEAST_RESPONSES}",
                )
            )
            continue
        background[index], reflex[index] = before.mean(), after.mean()
    if not np.isfinite(reflex).any():
        return None, [Excluded(what, f"no muscle has {LEAST_RESPONSES} usable responses")]
    doubtful = _doubtful_share(valid)
    return HoldMeasures(subject, hold, K, G, background, reflex, counts, doubtful), excluded


def _doubtful_share(valid: np.ndarray) -> float:
    """Return the share of valid estimates that are doubtful; NaN where none states a doubt."""
    doubt = valid[:, ESTIMATE_COLUMNS.index("doubt[1]")]
    known = doubt[np.isfinite(doubt)]
    return float(np.mean(known >= DOUBT_THRESHOLD)) if len(known) else math.nan


def _column(rows: np.ndarray, name: str, direction: int) -> np.ndarray:
    """Return values of a column that are finite, of the onsets of one direction."""
    values = rows[rows[:, 1] == direction, RESPONSE_COLUMNS.index(name)]
    return values[np.isfinite(values)]
