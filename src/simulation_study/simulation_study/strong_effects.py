"""Whether the diagnosis holds where an effect is strong: up to a third of the torque's variance.

Example: ``python -m simulation_study.strong_effects --seed 1 --out FOLDER``. Each effect that the
library names is in one recording of 60 s of the independent rig, at the largest strength of the
robustness study. Results are appended to ``results*.jsonl``; an interrupted run goes on where it
stopped, ``--part 1/2`` and ``--part 2/2`` share one study, and every run writes
``strong_effects.md``.
"""

from __future__ import annotations

import argparse
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from model_discrepancy.diagnose import diagnose
from model_discrepancy.recording.recording import Recording
from simulation_study.blind.acceptance import ANSWERS
from simulation_study.investigations import read_results
from simulation_study.robustness.conditions import FULL_SIZE, Condition, conditions
from simulation_study.robustness.recordings import recording
from simulation_study.verdict_report import named, rate_with_interval

SECONDS = 60.0
"""Length of a recording: with fewer the null of a recording is coarse."""
STRENGTH = "strong"
KEYS = ("K[N.m/rad]", "G[N.m.s/rad]")
SURE = 0.7
"""A name with at least this probability is a statement."""
Entry = dict[str, Any]


def strong_conditions(seed: int) -> list[Condition]:
    """Return one recording of each strong effect that the library names."""
    size = replace(FULL_SIZE, seconds=SECONDS, strengths=(STRENGTH,), jumps=0)
    return [c for c in conditions(size, seed) if c.effect in ANSWERS]


def counted(condition: Condition, folder: Path) -> Entry:
    """Make a recording and diagnose it.

    Parameters
    ----------
    condition
        What is in it.
    folder
        Where recordings are kept.
    """
    made = recording(condition, folder)
    verdict = diagnose(
        Recording(made.rate, made.position, made.torque, made.velocity, made.reference)
    ).verdict
    return {
        "case": condition.name,
        "effect": condition.effect,
        "servo": condition.servo,
        "right": [list(ANSWERS[condition.effect].names)],
        "verdict": verdict.verdict,
        "effects": [{key: e[key] for key in ("name", "probability")} for e in verdict.effects],
        # An offline method stands for just what it is given.
        "truth": made.truth[-1].tolist(),
        "values": [
            [verdict.parameters.get(key, {}).get(model) for model in ("base", "augmented")]
            for key in KEYS
        ],
    }


def report(entries: list[Entry], command: str) -> str:
    """Return the counts and every recording, as Markdown.

    Parameters
    ----------
    entries
        From `counted`.
    command
        With which they are made again.
    """
    stated = [
        e["name"] in entry["right"][0]
        for entry in entries
        for e in entry["effects"]
        if e["probability"] >= SURE
    ]
    lines = [
        "# Strong effects",
        "",
        f"`{command} --out FOLDER`: {len(entries)} recordings of the independent rig.",
        "",
        "| | counted (95 % interval) |",
        "| --- | --- |",
        *(
            f"| {label} | {rate_with_interval(sum(of), len(of))} |"
            for label, of in (
                ("named exactly", [named(entry, True) for entry in entries]),
                ("its family named", [named(entry, False) for entry in entries]),
                (f"names stated with {SURE:g} or more that are right", stated),
            )
        ),
        *(
            f"| {key}, {model}: median error (90 % of the recordings within) | "
            f"{_errors(entries, place, number)} |"
            for place, key in enumerate(KEYS)
            for number, model in enumerate(("base model", "with what was found"))
        ),
        "",
        "| effect | servo | verdict | named | K: truth, base model, with what was found | G |",
        "| --- | --- | --- | --- | --- | --- |",
    ]
    for entry in entries:
        said = ", ".join(f"{e['name']} {e['probability']:.2f}" for e in entry["effects"])
        cells = (
            ", ".join("-" if v is None else f"{v:.3g}" for v in (truth, *values))
            for truth, values in zip(entry["truth"], entry["values"], strict=True)
        )
        lines.append(
            f"| {entry['effect']} | {entry['servo']} | {entry['verdict']} | {said or 'nothing'} | "
            f"{' | '.join(cells)} |"
        )
    return "\n".join(lines) + "\n"


def _errors(entries: list[Entry], place: int, number: int) -> str:
    """Return the median absolute error in % of the truth, and what 90 % lie within."""
    found = [
        100.0 * abs(entry["values"][place][number] / entry["truth"][place] - 1.0)
        for entry in entries
        if entry["values"][place][number] is not None
    ]
    if not found:
        return "none"
    return f"{np.median(found):.1f} % ({np.percentile(found, 90):.0f} %)"


def main() -> None:
    """Count every recording that has no result yet."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--part", default="1/1", help="k/n: every n-th, beginning at the k-th")
    options = parser.parse_args()
    options.out.mkdir(parents=True, exist_ok=True)
    part, of = (int(word) for word in options.part.split("/"))
    command = f".venv/bin/python -m simulation_study.strong_effects --seed {options.seed}"
    done = {entry["case"] for entry in read_results(options.out)}
    for condition in strong_conditions(options.seed)[part - 1 :: of]:
        if condition.name in done:
            continue
        entry = counted(condition, options.out / "recordings")
        with (options.out / f"results-{part}.jsonl").open("a") as file:
            file.write(json.dumps(entry, default=float) + "\n")
        names = [e["name"] for e in entry["effects"]]
        print(f"{entry['case']}: {entry['verdict']}, {', '.join(names)}", flush=True)
        (options.out / "strong_effects.md").write_text(report(read_results(options.out), command))


if __name__ == "__main__":
    main()
