"""Verbs that run a whole study."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated

import typer

from ankle_bringup.terminal import Out, console, steps

verbs = typer.Typer()


@verbs.command()
def table2(
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder of the study; an interrupted one goes on.")
    ] = Path("table2_study"),
    seed: Annotated[int, typer.Option(help="Draws K, G, perturbations and noise.")] = 1,
    quick: Annotated[
        bool, typer.Option("--quick", help="8 runs instead of 100, 5 seeds instead of 20.")
    ] = False,
    workers: Annotated[int, typer.Option(help="Processes on this machine.")] = os.cpu_count() or 1,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a running Dask scheduler instead.")
    ] = None,
) -> None:
    """Make table II of van 't Veld et al. 2018 again: six combinations of signal-model and
    algorithm, the paper's numbers beside ours.

    Writes table2.md, table2.csv, figure6.png and figure7.png.

    Example: ankle table2 --quick --out table2_study
    """
    from simulation_study.table2_report import reproduce_table2

    console.print(
        reproduce_table2(out, seed, quick, workers, scheduler, console),
        markup=False,
        highlight=False,
        soft_wrap=True,
    )
    console.print(f"written to {out.resolve()}")


@verbs.command()
def validate(
    bags: Annotated[
        list[str], typer.Argument(help="Recorded sessions, each as BAG or as SUBJECT=BAG.")
    ],
    out: Out = Path("validation"),
    recompute: Annotated[
        bool,
        typer.Option(
            "--recompute", help="Estimates and EMG responses from the samples, not as recorded."
        ),
    ] = False,
    algorithm: Annotated[
        str,
        typer.Option(
            help="Of estimates from the samples, as the estimator node's parameter of that name."
        ),
    ] = "",
) -> None:
    """Correlate K and G with EMG over the hold periods of recorded sessions: the paper's Table III
    and figures 4, 5, 8.

    Writes report.html, the pictures, table3.csv and holds.csv.

    Example: ankle validate anna=monday_1 anna=monday_2 ben=tuesday_1 --out validation
    """
    from impedance_estimator.algorithms import DEFAULT
    from session_analysis.console import report_validation

    with steps() as step:
        report_validation(bags, out, recompute, step, console, algorithm or DEFAULT)


@verbs.command("virtual-study")
def virtual_study(
    out: Out = Path("virtual_study"),
    steady: Annotated[
        bool,
        typer.Option(
            "--cannot-modulate", help="Subjects whose stiffness and reflexes stay the same."
        ),
    ] = False,
    seed: Annotated[int, typer.Option(help="Of states, noise and perturbation.")] = 1,
) -> None:
    """Three virtual subjects through the paper's experiment, recorded as bags, then validated like
    real ones (about 15 minutes).

    Writes subject_1 to subject_3 (bags of 45 minutes, together 1.2 GB) and validation/; bags that
    are there are used again.

    Example: ankle virtual-study --out virtual_study
    """
    from session_analysis.console import report_validation
    from session_analysis.virtual_study import paper_study, record_study

    with steps() as step:
        bags = record_study(paper_study(not steady, seed), out, step)
        report_validation([str(bag) for bag in bags], out / "validation", False, step, console)


@verbs.command()
def blind(
    cases: Annotated[int, typer.Option(help="Recordings to conceal and to diagnose.")] = 100,
    seed: Annotated[int, typer.Option(help="Draws subjects, effects and noise.")] = 1,
    out: Annotated[
        Path, typer.Option("--out", "-o", help="Folder of the study; an interrupted one goes on.")
    ] = Path("blind_study"),
    workers: Annotated[int, typer.Option(help="Processes on this machine.")] = os.cpu_count() or 1,
    scheduler: Annotated[
        str | None, typer.Option(help="Address of a running Dask scheduler instead.")
    ] = None,
) -> None:
    """Diagnose recordings of an independent rig whose truth is sealed; then open the seal and
    score.

    Example: ankle blind --cases 100 --seed 7 --out blind_study
    """
    from simulation_study.blind.study import blind as run_study

    command = [
        sys.executable,
        "-m",
        "ankle_bringup.command_line",
        "diagnose",
        "{bag}",
        "--out",
        "{out}",
    ]
    run_study(cases, seed, out, command, workers, scheduler=scheduler, console=console)
    console.print((out / "result.md").read_text(), markup=False, highlight=False)
