"""Tables and picture of the comparison of estimators, from the results of its trials."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from simulation_study.estimates import GAINS

REPORT, PICTURE = "comparison.md", "comparison.png"
NO_VOLUNTARY_TORQUE = "none"
SHORTEST_RISE = 1.0 / 64.0
"""[s] Between two estimates: a shorter rise time, which the logarithmic axis could not show, is
drawn there.
"""
CONFIDENCE_HALF_WIDTH = 1.96
"""Standard errors either side that hold 95 % of a normal distribution."""
GAIN_INDICES = {"K": 0, "G": 3}
BASELINES = ("CE", "CE all")
COMPARISONS = (
    ("jump", "shorter rise time", "rise_time"),
    ("jump", "earlier arrival", "arrival"),
    ("fixed", "less variability", "variation"),
)
"""Part of the study, in words, and the number of `speed_and_variability` in which estimators are
compared run by run.
"""


def write_comparison(results: dict[str, dict[str, Any]], out: Path) -> str:
    """Write ``comparison.md`` and ``comparison.png`` into `out`.

    Parameters
    ----------
    results
        Of the trials of `comparison.comparison_trials`, by name.
    out
        Folder to write into.

    Returns
    -------
    str
        The Markdown.
    """
    speed = speed_and_variability(results)
    text = "\n\n".join(
        [
            "Rise time of a jump [s], time until the estimate has arrived within 10 % of it [s], "
            "coefficient of variation of a fixed ankle "
            "[%]: median, largest",
            _speed_table(speed),
            "Run by run",
            _duel_table(results),
            "Bias over reflexes with omega 15-30 rad/s, z 0.6-1.0, delay 35-55 ms [% of the true "
            "value]: median, largest of all runs",
            _bias_table(results),
            "Tracking error [% of half the range]: root mean square, K and G",
            _tracking_table(results),
            "True value within ±1.96 standard errors [% of snapshots: every 30 s from 60 s on]",
            _calibration_table(results),
        ]
    )
    (out / REPORT).write_text(text + "\n")
    _picture(speed, out / PICTURE)
    return text


def _part(results: dict[str, dict[str, Any]], part: str) -> dict[str, dict[str, Any]]:
    return {name: result for name, result in results.items() if name.split("_")[0] == part}


def speed_and_variability(
    results: dict[str, dict[str, Any]],
) -> dict[tuple[str, str], dict[str, np.ndarray]]:
    """Return ``rise_time`` of K and G over seeds by voluntary torque and estimator.

    Its shape is (seeds, 2) [s]; ``arrival`` and ``variation`` [%] are alike.

    A rise time that is never reached is infinite, so that it counts in a median.
    """
    found: dict[tuple[str, str], dict[str, list[list[float]]]] = {}
    for name, result in {**_part(results, "jump"), **_part(results, "fixed")}.items():
        part, voluntary, _ = name.split("_")
        for estimator, numbers in result["estimates"].items():
            entry = found.setdefault(
                (voluntary, estimator), {"rise_time": [], "arrival": [], "variation": []}
            )
            if part == "jump":
                for quantity in ("rise_time", "arrival"):
                    entry[quantity].append(
                        [np.inf if np.isnan(value) else value for value in numbers[quantity]]
                    )
            else:
                entry["variation"].append(
                    [100.0 * numbers["sd"][i] / numbers["mean"][i] for i in GAIN_INDICES.values()]
                )
    return {
        key: {name: np.array(values) for name, values in entry.items()}
        for key, entry in found.items()
    }


def _table(header: list[str], lines: list[list[str]]) -> str:
    return "\n".join(
        [
            "| " + " | ".join(header) + " |",
            "|" + " --- |" * len(header),
            *("| " + " | ".join(line) + " |" for line in lines),
        ]
    )


def _speed_table(speed: dict[tuple[str, str], dict[str, np.ndarray]]) -> str:
    lines = []
    for (voluntary, estimator), entry in sorted(
        speed.items(), key=lambda item: item[0][0] != NO_VOLUNTARY_TORQUE
    ):
        cells = []
        for name, digits in (("rise_time", 2), ("arrival", 1), ("variation", 2)):
            for column in range(2):
                values = entry[name][:, column]
                cells.append(
                    f"{np.median(values):.{digits}f}, {values.max():.{digits}f}".replace(
                        "inf", "never"
                    )
                )
        lines.append([voluntary, estimator, *cells])
    return _table(
        ["voluntary torque", "estimator", "τ K", "τ G", "arrival K", "arrival G", "cv K", "cv G"],
        lines,
    )


def _bias_table(results: dict[str, dict[str, Any]]) -> str:
    bias: dict[str, list[list[float]]] = {}
    for result in _part(results, "reflex").values():
        truth = np.array([result["trial"]["ankle"]["K"], result["trial"]["ankle"]["G"]])
        for estimator, numbers in result["estimates"].items():
            mean = np.array([numbers["mean"][i] for i in GAIN_INDICES.values()])
            bias.setdefault(estimator, []).append(list(100.0 * (mean / truth - 1.0)))
    lines = []
    for estimator, values in bias.items():
        found = np.array(values)
        cells = [
            f"{np.median(column):+.2f}, {column[np.argmax(np.abs(column))]:+.2f}"
            for column in found.T
        ]
        lines.append([estimator, *cells])
    return _table(["estimator", "K", "G"], lines)


def _tracking_table(results: dict[str, dict[str, Any]]) -> str:
    error: dict[str, dict[str, list[list[float]]]] = {}
    for part, label in (("sinusoid", "{} Hz"), ("ramp", "ramp of {} s")):
        for name, result in _part(results, part).items():
            course = label.format(name.split("_")[1])
            for estimator, numbers in result["estimates"].items():
                error.setdefault(course, {}).setdefault(estimator, []).append(
                    numbers["tracking_error"]
                )
    estimators = list(next(iter(error.values())))
    lines = []
    for course, found in error.items():
        cells = []
        for estimator in estimators:
            K, G = 100.0 * np.median(found[estimator], axis=0)
            cells.append(f"{K:.0f}, {G:.0f}")
        lines.append([course, *cells])
    return _table(["course", *estimators], lines)


def coverage(results: dict[str, dict[str, Any]]) -> dict[str, np.ndarray]:
    """Return by estimator how many snapshots have the true value within ±1.96 standard errors.

    The shares are those of K, B, I, G; shape (4,) [%].
    """
    inside: dict[str, list[np.ndarray]] = {}
    for result in results.values():
        for estimator, numbers in result["estimates"].items():
            value, error, truth = (
                np.array(numbers["snapshots"][key]) for key in ("value", "error", "truth")
            )
            inside.setdefault(estimator, []).append(
                np.abs(value - truth) < CONFIDENCE_HALF_WIDTH * error
            )
    return {
        estimator: 100.0 * np.mean(np.concatenate(values), axis=0)
        for estimator, values in inside.items()
    }


def _calibration_table(results: dict[str, dict[str, Any]]) -> str:
    lines = []
    for part, label in (("calibration", "the paper's reflex"), ("reflex", "all reflexes")):
        found = _part(results, part)
        lines += [
            [f"{label}, {len(found)} runs", name, *(f"{share:.1f}" for share in shares)]
            for name, shares in coverage(found).items()
        ]
    return _table(["ankle", "estimator", *GAINS], lines)


def _duel_table(results: dict[str, dict[str, Any]], ours: str = "simultaneous") -> str:
    """Return in how many runs, each read by all estimators, ours is faster, or varies less."""
    lines = []
    for part, quantity, number in COMPARISONS:
        found = [
            speed_and_variability({name: result}) for name, result in _part(results, part).items()
        ]
        for against in BASELINES:
            better = []
            for one in found:
                by_estimator = {
                    estimator: entry[number][0] for (_, estimator), entry in one.items()
                }
                better.append(by_estimator[ours] < by_estimator[against])
            K, G = np.sum(better, axis=0)
            lines.append([quantity, against, str(len(found)), str(K), str(G)])
    return _table(["simultaneous has the", "than", "runs", "K", "G"], lines)


def _picture(speed: dict[tuple[str, str], dict[str, np.ndarray]], path: Path) -> None:
    """Draw rise time against variability, each dot the median over seeds of an estimator with one
    setting.
    """
    figure = Figure(figsize=(11.0, 7.0), layout="constrained")
    cases = sorted(
        {voluntary for voluntary, _ in speed}, key=lambda case: (case != NO_VOLUNTARY_TORQUE, case)
    )
    axes = figure.subplots(2, len(cases), sharex=True, sharey="row", squeeze=False)
    families = {
        "CE": ("tab:orange", "o"),
        "CE all": ("tab:green", "s"),
        "simultaneous": ("tab:blue", "D"),
        "simultaneous, fixed memory": ("tab:cyan", "v"),
    }
    for column, voluntary in enumerate(cases):
        for row, parameter in enumerate(GAIN_INDICES):
            axis = axes[row, column]
            dots: dict[str, list[tuple[float, float]]] = {family: [] for family in families}
            for (other, estimator), entry in speed.items():
                if other != voluntary:
                    continue
                family = (
                    "simultaneous, fixed memory"
                    if estimator.endswith("fixed")
                    else estimator.split(" x")[0]
                )
                family = (
                    "simultaneous"
                    if family.startswith("simultaneous ") and family != "simultaneous, fixed memory"
                    else family
                )
                rise = max(float(np.median(entry["rise_time"][:, row])), SHORTEST_RISE)
                dots[family].append((rise, float(np.median(entry["variation"][:, row]))))
            for family, (colour, marker) in families.items():
                reached = sorted(dot for dot in dots[family] if np.isfinite(dot[0]))
                if reached:
                    axis.plot(
                        *np.transpose(reached),
                        color=colour,
                        marker=marker,
                        linewidth=0.8,
                        label=family,
                    )
            axis.set_xscale("log")
            axis.set_yscale("log")
            axis.set_title(f"{parameter}, voluntary torque: {voluntary}", fontsize="medium")
            if row == len(GAIN_INDICES) - 1:
                axis.set_xlabel("rise time 10-90 % (s)")
        axes[0, 0].set_ylabel("coefficient of variation of K (%)")
        axes[1, 0].set_ylabel("coefficient of variation of G (%)")
    axes[0, 0].legend(frameon=False)
    figure.savefig(path, dpi=110)
