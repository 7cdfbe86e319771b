"""`ankle table2`: the whole study, its table as Markdown and CSV, its figures."""

from __future__ import annotations

import csv
from pathlib import Path

import numpy as np
from rich.console import Console

from simulation_study.estimates import carry_out
from simulation_study.figures import IntrinsicAccuracy, figure6, figure7, intrinsic_accuracies
from simulation_study.protocol import COMBINATIONS, FULL_SIZE, QUICK_SIZE, table2_trials
from simulation_study.study import run_study
from simulation_study.table2 import Row, significant_deviation, table2

REPORT, TABLE = "table2.md", "table2.csv"
PUBLISHED_VAF = {"CE": (99.6, 99.6), "O": (-32.1, -33.3)}
"""[%] Intrinsic torque, training and validation set. van 't Veld et al. 2018, section IV-B."""


def reproduce_table2(
    out: Path, seed: int, quick: bool, workers: int, scheduler: str | None, console: Console
) -> str:
    """Run the study or go on with it, and write ``table2.md``, ``table2.csv``, ``figure6.png`` and
    ``figure7.png`` into its folder.

    Returns
    -------
    str
        The Markdown.

    Raises
    ------
    StudyError
        Something else is in `out`.
    """
    size = QUICK_SIZE if quick else FULL_SIZE
    asked = {
        "study": "table2",
        "seed": seed,
        "runs": size.runs,
        "seeds": size.seeds,
        "seconds": size.seconds,
    }
    results = run_study(
        table2_trials(size, seed), asked, out, carry_out, workers, scheduler, console
    )
    with console.status("torque predictions and figures"):
        rows = table2(results)
        accuracies = intrinsic_accuracies(results)
        figure6(results, out / "figure6.png")
        figure7(results, out / "figure7.png")
    text = markdown(
        rows,
        accuracies,
        f"{size.runs} runs of each random condition, {size.seeds} seeds of the fixed and of the "
        f"jump run; seed {seed}",
    )
    (out / REPORT).write_text(text)
    write_csv(rows, out / TABLE)
    return text


def markdown(rows: list[Row], accuracies: list[IntrinsicAccuracy], what: str) -> str:
    """Return the paper's table beside ours."""
    lines = [
        f"Table II, {what}.",
        "",
        "Paper / ours. **Bold**: each lies outside the other's range.",
        "",
        "| | " + " | ".join(COMBINATIONS) + " | our range |",
        "|" + " --- |" * (len(COMBINATIONS) + 2),
    ]
    for row in rows:
        cells = []
        for combination in COMBINATIONS:
            paper, ours = row.published[combination], row.reproduced[combination]
            text = (
                f"{paper} / {ours} ({_range(ours.low, ours.digits)} to "
                f"{_range(ours.high, ours.digits)})"
            )
            cells.append(f"**{text}**" if row.differs(combination) else text)
        lines.append(f"| {row.symbol} [{row.unit}] | " + " | ".join(cells) + f" | {row.spread} |")
    lines += ["", *_means(rows)]
    lines += [
        "",
        "Intrinsic torque accounted for in the rig CE [%]: paper; ours over all samples; ours "
        "within 40 ms after each stretch.",
        "",
        "| algorithm | set | paper | all samples | first 40 ms |",
        "| --- | --- | --- | --- | --- |",
    ]
    for found in accuracies:
        for number, label in enumerate(("training", "validation")):
            lines.append(
                f"| {found.algorithm} | {label} | {PUBLISHED_VAF[found.algorithm][number]} | "
                f"{found.whole[number]:.1f} ± "
                f"{found.whole_spread[number]:.1f} | {found.window[number]:.1f} ± "
                f"{found.window_spread[number]:.1f} |"
            )
    return "\n".join(lines) + "\n"


def _means(rows: list[Row]) -> list[str]:
    """Return the table that compares means by their standard errors."""
    least = significant_deviation(rows)
    lines = [
        "Means: ours less the paper's ± standard error of the difference (the difference over it). "
        f"**Bold**: at least {least:.1f} of them, which happens to any mean of the table by chance "
        "in 5 % of all studies.",
        "",
        "| | " + " | ".join(COMBINATIONS) + " |",
        "|" + " --- |" * (len(COMBINATIONS) + 1),
    ]
    for row in rows:
        cells = []
        for combination in COMBINATIONS:
            paper, ours = row.published[combination], row.reproduced[combination]
            error = np.hypot(paper.standard_error, ours.standard_error)
            deviation = row.deviation(combination)
            if not np.isfinite(deviation):
                break
            digits = ours.digits + 1
            text = f"{ours.value - paper.value:+.{digits}f} ± {error:.{digits}f} ({deviation:+.1f})"
            cells.append(f"**{text}**" if abs(deviation) >= least else text)
        if len(cells) == len(COMBINATIONS):
            lines.append(f"| {row.symbol} [{row.unit}] | " + " | ".join(cells) + " |")
    return lines


def _range(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if value < float("inf") else "never"


def write_csv(rows: list[Row], path: Path) -> None:
    """Write one line for each row and combination.

    It holds the paper's value, its range, ours, its range, whether they differ, and for means their
    difference over its standard error.
    """
    with path.open("w", newline="") as stream:
        writer = csv.writer(stream)
        writer.writerow(
            [
                "quantity",
                "unit",
                "combination",
                "paper",
                "paper_low",
                "paper_high",
                "ours",
                "ours_low",
                "ours_high",
                "differs",
                "deviation",
            ]
        )
        for row in rows:
            for combination in COMBINATIONS:
                paper, ours = row.published[combination], row.reproduced[combination]
                numbers = [
                    f"{x:.6g}"
                    for x in (paper.value, paper.low, paper.high, ours.value, ours.low, ours.high)
                ]
                writer.writerow(
                    [
                        row.symbol,
                        row.unit,
                        combination,
                        *numbers,
                        int(row.differs(combination)),
                        f"{row.deviation(combination):.3g}",
                    ]
                )
