"""The result of an opened study as files: Markdown, JSON, and the confusion matrix as a picture."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from simulation_study.blind.scoring import CaseScore

# What the proof asks for, so that a reader sees at once what fell short; rates [1].
GOALS = {
    "false alarms among nulls": ("false_alarms", "at most", 0.05),
    "moderate effects named, alone or in a set of three": ("moderate", "at least", 0.85),
    "unexplained recall": ("unexplained_recall", "at least", 0.75),
    "bad recordings caught": ("bad_recordings_caught", "at least", 1.0),
}
GAP_GOAL = 0.9


def _percent(rate: dict[str, Any]) -> str:
    return (
        "none of this kind"
        if rate["rate"] is None
        else f"{100 * rate['rate']:.0f} % ({rate['hits']} of {rate['of']})"
    )


def _judged(rate: dict[str, Any], sense: str, goal: float) -> str:
    if rate["rate"] is None:
        return "–"
    return (
        "reached"
        if (rate["rate"] <= goal if sense == "at most" else rate["rate"] >= goal)
        else "**short**"
    )


def _table(header: list[str], rows: list[list[str]]) -> list[str]:
    return [
        "| " + " | ".join(header) + " |",
        "| " + " | ".join("---" for _ in header) + " |",
        *("| " + " | ".join(row) + " |" for row in rows),
        "",
    ]


def markdown(
    result: dict[str, Any], scores: list[CaseScore], truths: dict[str, dict[str, Any]]
) -> str:
    """Return the result as a page."""
    return "\n".join(
        [
            f"# Blind study: {result['cases']} cases, seed {result['seed']}",
            "",
            f"Root hash, printed before the first diagnosis: `{result['root']}`. "
            f"Truth concealed by {result['concealed_by']}.",
            "",
            *_goals(result),
            *_by_strength(result),
            *_remarks(result),
            *_calibration(result["calibration"]),
            *_errors("Parameters of named effects", result["parameter_error_median"]),
            *_errors(
                "Base parameters of rightly explained cases",
                result["base_parameter_error_median_when_right"],
            ),
            *_cases(scores, truths),
        ]
    )


def _goals(result: dict[str, Any]) -> list[str]:
    """Return what was measured beside what the proof asks for."""
    rates = {**result, "moderate": result["known"]["moderate"]["exact_or_set"]}
    rows = [
        [
            what,
            _percent(rates[key]),
            f"{sense} {100 * goal:.0f} %",
            _judged(rates[key], sense, goal),
        ]
        for what, (key, sense, goal) in GOALS.items()
    ]
    gap = result["gap_closed_median_named"]
    if gap is not None:
        rows.append(
            [
                "gap closed, median of named",
                f"{100 * gap:.0f} %",
                f"at least {100 * GAP_GOAL:.0f} %",
                "reached" if gap >= GAP_GOAL else "**short**",
            ]
        )
    return _table(["", "measured", "goal", ""], rows)


def _by_strength(result: dict[str, Any]) -> list[str]:
    unknown = result["unknown_by_strength"]
    answers = ("exact", "exact_or_set", "family", "confident_wrong_name")
    return [
        "## By strength (one known effect)",
        "",
        *_table(
            [
                "strength",
                *(answer.replace("_", " ") for answer in answers),
                "unknown effects called unexplained",
            ],
            [
                [
                    strength,
                    *(_percent(rates[answer]) for answer in answers),
                    _percent(unknown[strength]),
                ]
                for strength, rates in result["known"].items()
            ],
        ),
    ]


def _remarks(result: dict[str, Any]) -> list[str]:
    within = ", ".join(
        f"{key} {_percent(rate)}" for key, rate in result["within_two_standard_errors"].items()
    )
    return [
        f"Pairs: both named {_percent(result['pairs']['both'])}, at least one "
        f"{_percent(result['pairs']['at_least_one'])}. "
        f"Good recordings called bad: {_percent(result['good_recordings_called_bad'])}. "
        f"Within two standard errors: {within}. "
        f"One diagnosis took {result['diagnosis_seconds_median']:.1f} s (median).",
        "",
    ]


def _calibration(calibration: dict[str, Any]) -> list[str]:
    """Return how often answers were right, by the probability that they stated."""
    rows = [
        [
            f"{b['from']:g}",
            f"{b['to']:g}",
            str(b["count"]),
            f"{b['stated']:.2f}",
            f"{b['right']:.2f}",
        ]
        for b in calibration["bins"]
    ]
    score = calibration["brier"]
    return [
        "## Stated probabilities",
        "",
        *_table(["from", "to", "count", "stated", "right"], rows),
        "No probability was stated." if score is None else f"Brier score {score:.3f}.",
        "",
    ]


def _errors(title: str, errors: dict[str, dict[str, Any]]) -> list[str]:
    rows = [[k, f"{100 * v['median']:.1f} %", str(v["count"])] for k, v in errors.items()]
    return [f"## {title}", "", *_table(["parameter", "median error", "cases"], rows)]


def _cases(scores: list[CaseScore], truths: dict[str, dict[str, Any]]) -> list[str]:
    rows = [
        [
            s.case,
            " + ".join(s.hidden) or "nothing",
            _strengths(truths[s.case]),
            s.verdict,
            ", ".join(s.stated),
            s.outcome,
        ]
        for s in scores
    ]
    header = ["case", "hidden", "strength", "verdict", "stated", "outcome"]
    return ["## Every case", "", *_table(header, rows)]


def _strengths(truth: dict[str, Any]) -> str:
    """Return reached strengths with their shares of the torque's variance."""
    parts = []
    for about in truth["effects"]:
        share = about.get("share")
        parts.append(
            about.get("strength", "") + (f" ({100 * share:.1f} %)" if share is not None else "")
        )
    return ", ".join(part for part in parts if part)


def confusion_picture(table: dict[str, dict[str, int]], file: Path) -> None:
    """Draw hidden (rows) against answered (columns), counts in the cells."""
    rows = list(table)
    columns = sorted({answer for row in table.values() for answer in row})
    counts = np.array([[table[row].get(column, 0) for column in columns] for row in rows])
    figure = Figure(
        figsize=(3.5 + 0.36 * len(columns), 2.2 + 0.26 * len(rows)), layout="constrained"
    )
    axes = figure.add_subplot()
    axes.imshow(counts, cmap="Blues", aspect="auto", vmin=0, vmax=max(int(counts.max()), 1))
    axes.set_xticks(range(len(columns)), columns, rotation=90)
    axes.set_yticks(range(len(rows)), rows)
    axes.set_xlabel("answered")
    axes.set_ylabel("hidden")
    for i, j in zip(*np.nonzero(counts), strict=True):
        axes.text(
            j,
            i,
            str(counts[i, j]),
            ha="center",
            va="center",
            color="white" if counts[i, j] > counts.max() / 2 else "black",
        )
    figure.savefig(file, dpi=150)


def write_report(
    out: Path, result: dict[str, Any], scores: list[CaseScore], truths: dict[str, dict[str, Any]]
) -> None:
    """Write ``result.md``, ``result.json`` and ``confusion.png`` into the study's folder."""
    (out / "result.md").write_text(markdown(result, scores, truths))
    content = {
        "summary": result,
        "cases": [{**score._asdict(), "truth": truths[score.case]} for score in scores],
    }
    (out / "result.json").write_text(json.dumps(content, indent=1))
    confusion_picture(result["confusion"], out / "confusion.png")
