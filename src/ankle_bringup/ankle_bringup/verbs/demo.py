"""`ankle demo`: the main job once."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ankle_bringup.terminal import Out, console


def verb(
    out: Out = Path("demo_results"),
    seconds: Annotated[
        float,
        typer.Option(
            help="Length of the live run; below 75 s the estimates do not reach the jump's end."
        ),
    ] = 90.0,
    trials: Annotated[Path, typer.Option(help="Folder of real trials as .npz files.")] = Path(
        "../shared/recordings"
    ),
) -> None:
    """Run the main job once: simulated ankle live, estimates made again from the bag, real human
    trials.

    Example: ankle demo --out demo_results
    """
    from ankle_bringup.demo import run_demo

    if not run_demo(out, seconds, trials, console):
        raise typer.Exit(1)
