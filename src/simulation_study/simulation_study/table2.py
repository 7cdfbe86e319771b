"""Table II of van 't Veld et al. 2018, made again: the paper's numbers beside ours.

What the paper's rows are taken from (the paper does not say it row by row; the order of its rows
suggests it):

* VAF of K and the mean of G from the runs with random K; VAF of G and the mean of K from those with
  random G; B and I from the runs with both random. ``±`` is the standard deviation over all
  estimates after 30 s of all runs.
* VAF: equation 1 over all estimates after 30 s of all runs together.
* var: twice the standard deviation within the fixed run, in per cent of the mean.
* τ: `estimates.rise_time` in the jump run.
"""

from __future__ import annotations

import csv
from collections.abc import Callable
from dataclasses import dataclass
from importlib import resources
from typing import Any

import numpy as np
from scipy import stats

from simulation_study.estimates import GAINS
from simulation_study.protocol import COMBINATIONS

PUBLISHED_RUNS = 100
"""Of each random condition, van 't Veld et al. 2018, section III-A."""
FAMILY_LEVEL = 0.05
"""Probability that any mean of the table is called different though none is (Bonferroni)."""
RESAMPLES = 400
"""Bootstrap samples of the runs, for the spread of a VAF: 95 % limits to a tenth of their width."""


@dataclass(frozen=True)
class Cell:
    """Holds a number and the range within which it may lie.

    Attributes
    ----------
    value
        NaN where it is not defined.
    low, high
        Mean ± standard deviation, or the range over seeds, or the rounding of a printed number.
    digits
        After the decimal point when printed.
    standard_error
        Of a mean over runs, in the unit of the value; NaN for what is no mean.
    """

    value: float
    low: float
    high: float
    digits: int = 1
    standard_error: float = float("nan")

    def __str__(self) -> str:
        if np.isnan(self.value):
            return "never"
        return f"{self.value:.{self.digits}f}"


@dataclass(frozen=True)
class Row:
    """Holds a row of table II.

    It has the symbol, its unit, and for each combination the paper's cell and ours.
    """

    symbol: str
    unit: str
    published: dict[str, Cell]
    reproduced: dict[str, Cell]
    spread: str
    """Says what our range is."""

    def differs(self, combination: str) -> bool:
        """Say whether either value lies outside the other's range."""
        paper, ours = self.published[combination], self.reproduced[combination]
        if np.isnan(ours.value):
            return True
        return not (ours.low <= paper.value <= ours.high or paper.low <= ours.value <= paper.high)

    def deviation(self, combination: str) -> float:
        """Return how far our mean lies above the paper's, over the standard error of the
        difference [1]; NaN for what is no mean.
        """
        paper, ours = self.published[combination], self.reproduced[combination]
        error = np.hypot(paper.standard_error, ours.standard_error)
        return float((ours.value - paper.value) / error)


def significant_deviation(rows: list[Row]) -> float:
    """Return the deviation [1] from which a mean differs, with `FAMILY_LEVEL` over all means of
    the rows.
    """
    means = sum(np.isfinite(row.deviation(c)) for row in rows for c in COMBINATIONS)
    return float(stats.norm.isf(0.5 * FAMILY_LEVEL / max(int(means), 1)))


def published_numbers() -> dict[str, dict[str, str]]:
    """Return the paper's table as printed: metric, then column."""
    text = (
        resources.files("simulation_study")
        .joinpath("published_table2.csv")
        .read_text(encoding="utf-8")
    )
    lines = [line for line in text.splitlines() if not line.startswith("#")]
    return {line["metric"]: line for line in csv.DictReader(lines)}


def _published(metric: str, spread: str | None, digits: int) -> dict[str, Cell]:
    numbers = published_numbers()
    cells = {}
    for combination in COMBINATIONS:
        printed = numbers[metric][combination]
        value = float(printed)
        half = 0.5 * 10.0 ** -(len(printed.split(".")[1]) if "." in printed else 0)
        width = max(float(numbers[spread][combination]), half) if spread else half
        error = float("nan")
        if spread:
            # The paper's spread is that over all estimates of all runs, at least that of the runs'
            # means; a rounded number lies anywhere within its last digit.
            deviation = float(numbers[spread][combination])
            error = float(np.hypot(deviation / np.sqrt(PUBLISHED_RUNS), half / np.sqrt(3.0)))
        cells[combination] = Cell(value, value - width, value + width, digits, error)
    return cells


def table2(results: dict[str, dict[str, Any]]) -> list[Row]:
    """Return all rows of table II.

    Parameters
    ----------
    results
        Of the trials of `protocol.table2_trials`, by name.
    """

    def runs(combination: str, condition: str) -> list[tuple[dict[str, Any], dict[str, Any]]]:
        rig, algorithm = COMBINATIONS[combination]
        return [
            (result["trial"], result["estimates"][algorithm])
            for name, result in results.items()
            if name.rsplit("_", 2)[0] == condition and result["trial"]["rig"] == rig
        ]

    def each(cell: Callable[[str], Cell]) -> dict[str, Cell]:
        return {combination: cell(combination) for combination in COMBINATIONS}

    rows = []
    for parameter, varied, other in (("K", "random_K", "G"), ("G", "random_G", "K")):
        rows.append(
            Row(
                f"VAF {parameter}",
                "%",
                _published(f"VAF_{parameter}", None, 1),
                each(lambda c, p=parameter, v=varied: _accuracy(runs(c, v), p)),  # type: ignore[misc]
                "95 % over resampled runs",
            )
        )
        rows.append(_mean_row(other, varied, runs, each))
    rows += [_mean_row(parameter, "random_K_and_G", runs, each) for parameter in ("B", "I")]
    for parameter in ("K", "G"):
        rows.append(
            Row(
                f"var {parameter}",
                "% of mean",
                _published(f"var_{parameter}", None, 1),
                each(
                    lambda c, p=parameter: _over_seeds(  # type: ignore[misc]
                        [_variability(e, p) for _, e in runs(c, "fixed")]
                    )
                ),  # type: ignore[misc]
                "range over seeds",
            )
        )
    for index, parameter in enumerate(("K", "G")):
        rows.append(
            Row(
                f"τ {parameter}",
                "s",
                _published(f"tau_{parameter}", None, 1),
                each(
                    lambda c, i=index: _over_seeds(  # type: ignore[misc]
                        [e["rise_time"][i] for _, e in runs(c, "jump")]
                    )
                ),  # type: ignore[misc]
                "range over seeds",
            )
        )
    return rows


UNITS = {"K": "N.m/rad", "B": "N.m.s/rad", "I": "kg.m²", "G": "N.m.s/rad"}
DIGITS = {"K": 1, "B": 2, "I": 4, "G": 1}


def _mean_row(parameter: str, condition: str, runs: Callable, each: Callable) -> Row:
    digits = DIGITS[parameter]
    return Row(
        f"{parameter}",
        UNITS[parameter],
        _published(f"{parameter}_hat_mean", f"{parameter}_hat_sd", digits),
        each(lambda c: _mean(runs(c, condition), parameter, digits)),
        "standard deviation",
    )


def _mean(runs: list[tuple[dict[str, Any], dict[str, Any]]], parameter: str, digits: int) -> Cell:
    index = GAINS.index(parameter)
    means = np.array([estimates["mean"][index] for _, estimates in runs])
    within = np.array([estimates["sd"][index] for _, estimates in runs])
    mean, deviation = float(means.mean()), float(np.sqrt(np.mean(within**2) + np.var(means)))
    error = float(means.std(ddof=1) / np.sqrt(len(means))) if len(means) > 1 else float("nan")
    return Cell(mean, mean - deviation, mean + deviation, digits, error)


def _accuracy(runs: list[tuple[dict[str, Any], dict[str, Any]]], parameter: str) -> Cell:
    index = GAINS.index(parameter)
    true = np.array([trial["ankle"][parameter] for trial, _ in runs])
    error = np.array([estimates["mean"][index] for _, estimates in runs]) - true
    within = np.array([estimates["sd"][index] for _, estimates in runs])

    def vaf(chosen: np.ndarray) -> float:
        return float(
            100.0
            * (1.0 - (np.mean(within[chosen] ** 2) + np.var(error[chosen])) / np.var(true[chosen]))
        )

    random = np.random.default_rng(0)
    spread = [vaf(random.integers(len(true), size=len(true))) for _ in range(RESAMPLES)]
    low, high = np.percentile(spread, [2.5, 97.5])
    return Cell(vaf(np.arange(len(true))), float(low), float(high))


def _variability(estimates: dict[str, Any], parameter: str) -> float:
    index = GAINS.index(parameter)
    return 200.0 * estimates["sd"][index] / estimates["mean"][index]


def _over_seeds(values: list[float]) -> Cell:
    """Return median and range; a value that is never reached counts as longer than all others."""
    known = np.where(np.isnan(values), np.inf, values)
    middle = float(np.median(known))
    return Cell(middle if np.isfinite(middle) else np.nan, float(known.min()), float(known.max()))
