"""Tables and picture of the robustness study."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from simulation_study.robustness.conditions import JUMPS, NO_MISMATCH
from simulation_study.robustness.estimation import ONLINE
from simulation_study.robustness.summary import (
    ESTIMATORS,
    GAINS,
    Errors,
    Results,
    arrivals,
    doubt,
    earlier,
    effects_of,
    error_ratio,
    errors,
    select,
)
from simulation_study.verdict_report import rate_with_interval

TABLE, PICTURE = "robustness.md", "robustness.png"
REFERENCE = "CE all"
"""The paper's algorithm with all signals high-passed: what others are compared with."""
LARGEST_SHOWN_ERROR = 100.0
"""[%] The picture's axis ends here; larger errors lie on its edge."""
LARGEST_RATIO = 1.2
"""An effect is listed as worse where the ratio of the median errors is larger."""
COLOURS = dict(zip(ESTIMATORS, ("tab:blue", "tab:orange", "tab:red", "tab:green"), strict=True))


def write_report(results: Results, out: Path, command: str) -> str:
    """Write ``robustness.md`` and ``robustness.png``.

    Parameters
    ----------
    results
        By the name of the recording.
    out
        Folder to write the report to.
    command
        Stated in the table, so that anyone can run it again.

    Returns
    -------
    str
        The text of the table.
    """
    text = "\n".join(
        [
            f"![errors of K and G by effect and estimator, and arrival after jumps]({PICTURE})",
            "",
            f"Command: `{command}`. {len(results)} recordings of an independent rig "
            "(`blind_rig`, MuJoCo).",
            "",
            *_overview(results),
            "",
            *_arrivals(results),
            "",
            *_worse(results),
            "",
            *_by_effect(results),
            "",
        ]
    )
    (out / TABLE).write_text(text)
    _picture(results, out / PICTURE)
    return text


def _overview(results: Results) -> list[str]:
    lines = [
        "Absolute error in % of the truth: median (90 % of the recordings within; largest). Truth "
        "is what the joint was over the memory of an estimate (10 s, CE 18 s). "
        "Covered: truth within 1.96 stated standard errors, % of snapshots. Doubtful: share of "
        "snapshots with `doubt` of 0.5 or more; flagged: the same among those with an error above "
        "15 % (K) or 25 % (G).",
        "",
        "| recordings | estimator | K | G | covered K, G | doubtful | flagged |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for label, effect in (("no mismatch", NO_MISMATCH), ("one effect", None)):
        chosen = select(results, effect)
        if not chosen:
            continue
        for name in ESTIMATORS:
            found = {gain: errors(chosen, name, gain) for gain in GAINS}
            said = doubt(chosen, name)
            flagged = f"{said.flagged:.0f} % of {said.large}" if said.large else "-"
            lines.append(
                f"| {label} ({len(chosen)}) | {name} | {_sizes(found['K'])} | "
                f"{_sizes(found['G'])} | {_number(found['K'].covered)}, "
                f"{_number(found['G'].covered)} | {_number(said.called)} | {flagged} |"
            )
    return lines


def _arrivals(results: Results) -> list[str]:
    if not any(arrivals(results, REFERENCE, jump).runs for jump in JUMPS):
        return []
    lines = [
        "Arrival after a jump in the middle of the recording [s]: median (interquartile range), "
        "runs that arrive; the reflex varies by 25 % from stretch to stretch.",
        "",
        "| jump | " + " | ".join(ONLINE) + " |",
        "| --- |" + " --- |" * len(ONLINE),
    ]
    for jump in JUMPS:
        cells = []
        for name in ONLINE:
            a = arrivals(results, name, jump)
            cells.append(
                f"{_number(a.median, 1)} ({_number(a.spread, 1)}), {a.arrived} of {a.runs}"
            )
        lines.append(f"| {_jump(jump)} | " + " | ".join(cells) + " |")
    for name in ONLINE:
        first, runs = earlier(results, name, REFERENCE)
        if name != REFERENCE and runs:
            lines += [
                "",
                f"Runs in which `{name}` arrives before `{REFERENCE}`: "
                f"{rate_with_interval(first, runs)}.",
            ]
    return lines


def _worse(results: Results) -> list[str]:
    """Return the effects with which the default's median error is larger than the reference's."""
    default = next(iter(ONLINE))
    lines = [
        f"Effects with which the median error of `{default}` is more than {LARGEST_RATIO:g} times "
        f"that of `{REFERENCE}` [%], with the ratio and its 95 % interval (bootstrap over "
        "recordings). Where it reaches below 1 the recordings do not tell which one is better.",
        "",
        f"| effect | recordings | gain | {default} | {REFERENCE} | ratio | doubtful |",
        "| --- | --- | --- | --- | --- | --- | --- |",
    ]
    for effect in effects_of(results):
        chosen = select(results, effect)
        for gain in GAINS:
            ratio, low, high = error_ratio(chosen, gain, default, REFERENCE)
            if ratio > LARGEST_RATIO:
                mine, other = (errors(chosen, name, gain).median for name in (default, REFERENCE))
                lines.append(
                    f"| {effect} | {len(chosen)} | {gain} | {mine:.1f} | {other:.1f} | "
                    f"{ratio:.1f} ({low:.1f} to {high:.1f}) | "
                    f"{_number(doubt(chosen, default).called)} |"
                )
    return lines


def _by_effect(results: Results) -> list[str]:
    lines = [
        "By effect: bias ± spread in % of the truth (median of the signed error over strengths and "
        "servos; standard deviation within a recording), and the largest absolute error.",
        "",
        "| effect | gain | " + " | ".join(ESTIMATORS) + " | covered, " + next(iter(ONLINE)) + " |",
        "| --- | --- |" + " --- |" * (len(ESTIMATORS) + 1),
    ]
    for effect in effects_of(results):
        chosen = select(results, effect)
        for gain in GAINS:
            found = [errors(chosen, name, gain) for name in ESTIMATORS]
            cells = " | ".join(_bias(e) for e in found)
            lines.append(f"| {effect} | {gain} | {cells} | {_number(found[0].covered)} |")
    return lines


def _sizes(e: Errors) -> str:
    return f"{e.median:.1f} ({e.ninety:.0f}; {e.worst:.0f})"


def _bias(e: Errors) -> str:
    spread = f" ± {e.spread:.0f}" if np.isfinite(e.spread) else ""
    return f"{e.bias:+.0f}{spread}; {e.worst:.0f}"


def _number(value: float, digits: int = 0) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"


def _jump(jump: tuple[float, float]) -> str:
    gain, factor = ("K", jump[0]) if jump[0] != 1.0 else ("G", jump[1])
    return f"{gain} times {factor:g}"


def _picture(results: Results, path: Path) -> None:
    """Draw errors by effect, one panel a gain, and arrival after jumps."""
    effects = effects_of(results)
    figure = Figure(figsize=(13.0, 2.5 + 0.27 * len(effects)), layout="constrained")
    axes = figure.subplots(1, 3, width_ratios=(3, 3, 2))
    for axis, gain in zip(axes, GAINS, strict=False):
        _errors_panel(axis, results, effects, gain)
    axes[1].set_yticklabels([])
    handles, labels = axes[0].get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside upper center", ncols=len(labels))
    _arrival_panel(axes[2], results)
    figure.savefig(path, dpi=110)


def _errors_panel(axis: Axes, results: Results, effects: Sequence[str], gain: str) -> None:
    rows = np.arange(len(effects))[::-1]
    for offset, name in zip((0.27, 0.09, -0.09, -0.27), ESTIMATORS, strict=True):
        for row, effect in zip(rows, effects, strict=True):
            index = GAINS.index(gain)
            found = [r["estimates"][name] for r in select(results, effect)]
            values = [100.0 * (one["value"][index] / one["truth"][index] - 1.0) for one in found]
            shown = np.clip(values, -LARGEST_SHOWN_ERROR, LARGEST_SHOWN_ERROR)
            axis.plot(
                shown,
                np.full(len(shown), row + offset),
                "o",
                ms=3.5,
                color=COLOURS[name],
                label=name if effect == effects[0] else None,
            )
    axis.axvline(0.0, color="0.5", lw=0.8)
    axis.set_xscale("symlog", linthresh=10.0)
    axis.set_xticks([-100, -30, -10, 0, 10, 30, 100])
    axis.set_xticklabels(["-100", "-30", "-10", "0", "10", "30", "100"])
    axis.set_ylim(-0.7, len(effects) - 0.3)
    axis.set_yticks(rows, [effect.replace("_", " ") for effect in effects])
    axis.grid(axis="y", color="0.92")
    axis.set_xlabel(f"error of {gain} [% of the truth]")


def _arrival_panel(axis: Axes, results: Results) -> None:
    ticks, labels = [], []
    for row, jump in enumerate(reversed(JUMPS)):
        for offset, name in zip((0.2, 0.0, -0.2), ONLINE, strict=True):
            times = np.array(arrivals(results, name, jump).times)
            there = times[np.isfinite(times)]
            axis.plot(there, np.full(len(there), row + offset), "o", ms=4, color=COLOURS[name])
        ticks.append(row)
        labels.append(_jump(jump))
    axis.set_yticks(ticks, labels)
    axis.set_ylim(-0.6, len(JUMPS) - 0.4)
    axis.set_xlim(left=0.0)
    axis.grid(axis="x", color="0.92")
    axis.set_xlabel("arrival after a jump [s]")
