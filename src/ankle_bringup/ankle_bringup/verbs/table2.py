"""`ankle table2`: the paper's simulation study."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import CORES, SEED, Scheduler, StudyOut, Workers, console, number_option


def verb(
    out: StudyOut = Path("table2_study"),
    seed: Annotated[int, number_option(SEED, "Draws K, G, perturbations and noise.")] = 1,
    quick: Annotated[
        bool, typer.Option("--quick", help="8 runs instead of 100, 5 seeds instead of 20.")
    ] = False,
    workers: Workers = CORES,
    scheduler: Scheduler = None,
) -> dict[str, Any]:
    """Make table II of van 't Veld and others 2018 again: six combinations of signal-model and
    algorithm, the paper's numbers beside ours.

    Writes table2.md, table2.csv, figure6.png and figure7.png.

    Example: ankle table2 --quick --out table2_study
    """
    import csv

    from simulation_study.table2_report import TABLE, reproduce_table2

    console.print(reproduce_table2(out, seed, quick, workers, scheduler, console), soft_wrap=True)
    console.print(f"written to {out.resolve()}")
    with open(out / TABLE, newline="") as stream:
        return {"out": out.resolve(), "table": list(csv.DictReader(stream))}
