"""`ankle demo`: the main job once."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from ankle_bringup.terminal import SEED, console, number_option
from ankle_interfaces.quantity import Quantity

SECONDS = Quantity("seconds", "s", 10.0, 3600.0, 90.0)


def verb(
    out: Annotated[Path, typer.Option("--out", "-o", help="A new folder for all results.")] = Path(
        "demo_results"
    ),
    seconds: Annotated[
        float,
        number_option(
            SECONDS,
            "Length of the live run; below 75 s the estimates do not reach the jump's end.",
        ),
    ] = 90.0,
    trials: Annotated[
        Path | None,
        typer.Option(
            exists=True,
            file_okay=False,
            help="Folder of real trials, as bags or .npz files; those of 'ankle fetch-trials' "
            "unless given.",
        ),
    ] = None,
    seed: Annotated[
        int, number_option(SEED, "Draws the rig with faults that is calibrated, and its subject.")
    ] = 1,
) -> None:
    """Run the main job once: simulated ankle live, estimates made again from the bag, real human
    trials, a rig with faults without and with calibration, a session on the pages.

    Example: ankle demo --out demo_results
    """
    from ankle_bringup.demo import run_demo

    if not run_demo(out, seconds, trials or _fetched(), seed, console):
        raise typer.Exit(1)


def _fetched() -> Path:
    """Return the folder of the public trials; offers to fetch them where somebody can answer."""
    from ankle_bringup.errors import RunError
    from ankle_bringup.human_trials import MCGILL, cache_folder, fetch, import_trials

    folder = cache_folder() / "human_trials"
    question = "Fetch public recordings of a human ankle for the demo (2 MB)?"
    if not folder.exists() and sys.stdin.isatty() and typer.confirm(question, default=True):
        try:
            import_trials(fetch(MCGILL, folder.parent), folder)
        except RunError as error:
            console.print(f"{error}. Going on without.")
    return folder
