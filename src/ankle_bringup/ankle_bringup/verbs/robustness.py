"""`ankle robustness`: every estimator on an independent rig with each effect."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import CORES, SEED, Scheduler, StudyOut, Workers, console, number_option
from ankle_interfaces.quantity import Quantity

SECONDS = Quantity("seconds", "s", 50.0, 3600.0, 120.0)
RECORDINGS = Quantity("recordings", "1", 1, 100_000, 159)
REPEATS = Quantity("repeats", "1", 1, 100, 1)


def verb(
    out: StudyOut = Path("robustness_study"),
    seed: Annotated[int, number_option(SEED, "Draws subjects, perturbations and noise.")] = 1,
    quick: Annotated[
        bool, typer.Option("--quick", help="24 recordings of 60 s instead of 159 of 120 s.")
    ] = False,
    seconds: Annotated[
        float | None, number_option(SECONDS, "Length of a recording; 120 s, or 60 s with --quick.")
    ] = None,
    recordings: Annotated[
        int | None,
        number_option(
            RECORDINGS, "Only so many of them, drawn at random; a larger number goes on."
        ),
    ] = None,
    repeats: Annotated[
        int,
        number_option(REPEATS, "So many recordings of each kind, of different subjects."),
    ] = 1,
    effect: Annotated[
        list[str] | None,
        typer.Option("--effect", help="Only recordings with this effect; may be repeated."),
    ] = None,
    workers: Workers = CORES,
    scheduler: Scheduler = None,
) -> dict[str, Any]:
    """Compare the estimators on an independent rig, with each effect of rig, fixation, joint,
    reflex and sensors at three strengths: bias, spread, arrival, coverage and doubt.

    Writes robustness.md and robustness.png. Recordings are kept: after a change of an estimator
    only the estimates are made again.

    Example: ankle robustness --quick --out robustness_study
    """
    from simulation_study.robustness.study import robustness as run_study

    shown = run_study(
        out,
        seed,
        quick,
        workers,
        seconds,
        recordings,
        scheduler,
        console,
        repeats,
        effect or (),
    )
    console.print(shown, soft_wrap=True)
    console.print(f"written to {out.resolve()}")
    return {"out": out.resolve()}
