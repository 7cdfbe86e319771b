"""The results of all recordings are summarised for each effect and estimator."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from impedance_estimator.simultaneous.doubt import DOUBT_THRESHOLD
from simulation_study.robustness.conditions import JUMP, JUMPS, NO_MISMATCH
from simulation_study.robustness.estimation import OFFLINE, ONLINE

ESTIMATORS = (*ONLINE, OFFLINE)
GAINS = ("K", "G")
WIDTH = 1.96
"""Standard errors on either side of an estimate that hold the truth in 95 % of cases."""
LARGE_ERROR = {"K": 15.0, "G": 25.0}
"""Larger errors [%] should be called doubtful."""
RESAMPLED = 4000
"""Draws of the bootstrap: the ends of a 95 % interval then vary by some per cent."""


@dataclass(frozen=True)
class Errors:
    """Holds errors of one gain, of one estimator, over some recordings.

    Attributes
    ----------
    bias
        Median of the signed error [%].
    spread
        Median over recordings of the standard deviation within one [%]; NaN for offline methods.
    median, ninety, worst
        Of the absolute error [%]: median, 90 % of the recordings within, largest.
    covered
        Share of snapshots for which the truth over their memory lies within `WIDTH` stated standard
        errors [%]; NaN where none is stated.
    """

    bias: float
    spread: float
    median: float
    ninety: float
    worst: float
    covered: float


@dataclass(frozen=True)
class Doubt:
    """Counts how often an estimator doubted its estimates, and how often rightly.

    Attributes
    ----------
    called
        Share of snapshots called doubtful [%].
    large
        Number of snapshots with a large error (`LARGE_ERROR`) of K or G.
    flagged
        Share of those that are called doubtful [%]; NaN where there are none.
    """

    called: float
    large: int
    flagged: float


@dataclass(frozen=True)
class Arrivals:
    """Holds the arrivals after one kind of jump.

    Attributes
    ----------
    median
        [s], over the runs that arrive.
    spread
        Interquartile range [s].
    arrived, runs
        Numbers of runs.
    times
        [s] of each run; NaN where it does not arrive.
    """

    median: float
    spread: float
    arrived: int
    runs: int
    times: tuple[float, ...]


Results = Mapping[str, dict[str, Any]]


def select(results: Results, effect: str | None) -> list[dict[str, Any]]:
    """Return results of one effect; None: of all recordings with an effect."""
    known = [r for r in results.values() if r["condition"]["effect"] != JUMP]
    if effect is None:
        return [r for r in known if r["condition"]["effect"] != NO_MISMATCH]
    return [r for r in known if r["condition"]["effect"] == effect]


def effects_of(results: Results) -> list[str]:
    """Return the effects of a study by name; no mismatch first."""
    names = {r["condition"]["effect"] for r in results.values()} - {JUMP}
    return sorted(names, key=lambda name: (name != NO_MISMATCH, name))


def errors(chosen: Iterable[dict[str, Any]], estimator: str, gain: str) -> Errors:
    """Return errors of one estimator over some results."""
    index = GAINS.index(gain)
    signed, spreads, covered = [], [], []
    for result in chosen:
        found = result["estimates"][estimator]
        truth = found["truth"][index]
        signed.append(100.0 * (found["value"][index] / truth - 1.0))
        if found["spread"] is not None:
            spreads.append(100.0 * found["spread"][index] / abs(truth))
        for snapshot in found["snapshots"] or ():
            momentary = snapshot[5 + index]
            covered.append(abs(snapshot[index] - momentary) <= WIDTH * snapshot[2 + index])
    size = np.abs(np.nan_to_num(signed, nan=100.0))
    if not len(size):
        return Errors(*[float("nan")] * 6)
    return Errors(
        float(np.nanmedian(signed)),
        float(np.nanmedian(spreads)) if spreads else float("nan"),
        float(np.median(size)),
        float(np.quantile(size, 0.9)),
        float(size.max()),
        100.0 * float(np.mean(covered)) if covered else float("nan"),
    )


def error_ratio(
    chosen: Sequence[dict[str, Any]], gain: str, estimator: str, reference: str
) -> tuple[float, float, float]:
    """Return the ratio of the median absolute errors of two estimators over the same recordings,
    and its 95 % interval by the bootstrap over recordings (Efron & Tibshirani 1993, chapter 13).

    Parameters
    ----------
    chosen
        Results.
    gain
        K or G.
    estimator, reference
        Names; the ratio is the first one's error over the other one's.
    """
    index = GAINS.index(gain)
    sizes = np.array(
        [
            [abs(found["value"][index] / found["truth"][index] - 1.0) for found in both]
            for both in (
                [result["estimates"][name] for name in (estimator, reference)] for result in chosen
            )
        ]
    )
    drawn = np.random.default_rng(0).integers(len(sizes), size=(RESAMPLED, len(sizes)))
    medians = np.nanmedian(sizes[drawn], axis=1)
    # A ratio of two errors that are zero is none.
    with np.errstate(invalid="ignore", divide="ignore"):
        mine, other = np.nanmedian(sizes, axis=0)
        ratios = medians[:, 0] / medians[:, 1]
        low, high = np.quantile(ratios, [0.025, 0.975])
        return float(mine / other), float(low), float(high)


def doubt(chosen: Iterable[dict[str, Any]], estimator: str) -> Doubt:
    """Return how often an estimator called its estimates doubtful, and how often rightly."""
    called, large = [], []
    for result in chosen:
        for snapshot in result["estimates"][estimator]["snapshots"] or ():
            K, G = snapshot[5:]
            off = [100.0 * abs(snapshot[i] / true - 1.0) for i, true in ((0, K), (1, G))]
            large.append(off[0] > LARGE_ERROR["K"] or off[1] > LARGE_ERROR["G"])
            called.append(snapshot[4] >= DOUBT_THRESHOLD)
    if not called:
        return Doubt(float("nan"), 0, float("nan"))
    wrong = [c for c, is_large in zip(called, large, strict=True) if is_large]
    flagged = 100.0 * float(np.mean(wrong)) if wrong else float("nan")
    return Doubt(100.0 * float(np.mean(called)), len(wrong), flagged)


def arrivals(results: Results, estimator: str, jump: tuple[float, float]) -> Arrivals:
    """Return the arrival after one of `JUMPS`."""
    index = 0 if jump[0] != 1.0 else 1
    times = []
    for result in results.values():
        condition = result["condition"]
        if condition["effect"] == JUMP and tuple(condition["jump"]) == jump:
            found = result["estimates"][estimator]["arrival"][index]
            times.append(float("nan") if found is None else float(found))
    there = [t for t in times if np.isfinite(t)]
    return Arrivals(
        float(np.median(there)) if there else float("nan"),
        float(np.subtract(*np.quantile(there, [0.75, 0.25]))) if there else float("nan"),
        len(there),
        len(times),
        tuple(times),
    )


def earlier(results: Results, estimator: str, than: str) -> tuple[int, int]:
    """Return runs with a jump in which an estimator arrives before another one, and runs in all.

    A run in which neither arrives counts for none; one in which only the first does, counts.
    """
    first, runs = 0, 0
    for jump in JUMPS:
        mine, other = (arrivals(results, name, jump).times for name in (estimator, than))
        for a, b in zip(mine, other, strict=True):
            runs += 1
            first += bool(np.isfinite(a) and (not np.isfinite(b) or a < b))
    return first, runs
