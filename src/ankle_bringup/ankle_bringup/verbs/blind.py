"""`ankle blind`: the diagnosis on concealed recordings of another engine."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import CORES, SEED, Scheduler, StudyOut, Workers, console, number_option


def verb(
    cases: Annotated[int, typer.Option(help="Recordings to conceal and to diagnose.")] = 100,
    seed: Annotated[int, number_option(SEED, "Draws subjects, effects and noise.")] = 1,
    out: StudyOut = Path("blind_study"),
    workers: Workers = CORES,
    scheduler: Scheduler = None,
) -> dict[str, Any]:
    """Diagnose recordings of an independent rig whose truth is sealed; then open the seal and
    score.

    Writes result.md, the verdicts and, at the end, the truth of each case.

    Example: ankle blind --cases 100 --seed 7 --out blind_study
    """
    from simulation_study.blind.study import blind

    diagnose = [sys.executable, "-m", "ankle_bringup.command_line", "diagnose"]
    command = [*diagnose, "{bag}", "--out", "{out}"]
    result = blind(cases, seed, out, command, workers, scheduler=scheduler, console=console)
    console.print((out / "result.md").read_text())
    return result
