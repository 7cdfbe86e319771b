"""The command of a study that works through drawn recordings and writes one table."""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Iterable
from pathlib import Path
from typing import TypeVar

from simulation_study.verdict_cases import Plan
from simulation_study.verdict_study import ordered

HIDDEN = {
    "null": "recordings without a mismatch",
    "effect": "recordings that hide one effect",
    "pair": "recordings that hide two",
}
"""What the recordings of each kind hide, in words."""

Row = TypeVar("Row")


def write_table(
    module: str,
    description: str,
    counts: dict[str, int],
    work: Callable[[Plan], Iterable[Row]],
    report: Callable[[list[Row], str], str],
) -> None:
    """Read the options of a study, work through its recordings, and write and print its table.

    Parameters
    ----------
    module
        Name of the study's module in `simulation_study`, and of its table.
    description
        What the study does, for its help.
    counts
        How many recordings of each kind of `HIDDEN` are drawn unless options say otherwise.
    work
        Returns what the study keeps of a recording.
    report
        Returns the table in Markdown, from all that was kept and the command that makes it again.
    """
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("--seed", type=int, required=True)
    for kind, count in counts.items():
        parser.add_argument(f"--{kind}s", type=int, default=count, help=HIDDEN[kind])
    parser.add_argument("--out", type=Path, required=True)
    options = parser.parse_args()
    asked = {kind: int(getattr(options, f"{kind}s")) for kind in counts}
    todo = ordered(asked, options.seed, [])
    found: list[Row] = []
    for number, plan in enumerate(todo, start=1):
        found += work(plan)
        print(f"{number} of {len(todo)}: {plan.name}", file=sys.stderr, flush=True)
    sizes = " ".join(f"--{kind}s {count}" for kind, count in asked.items())
    program = f".venv/bin/python -m simulation_study.{module}"
    command = f"{program} --seed {options.seed} {sizes} --out FOLDER"
    options.out.mkdir(parents=True, exist_ok=True)
    text = report(found, command)
    (options.out / f"{module}.md").write_text(text)
    print(text)
