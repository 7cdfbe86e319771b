"""`ankle open`: a recording to scroll through."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.errors import RunError
from ankle_bringup.terminal import Overwrite, console, working


def verb(
    bag: Annotated[Path, typer.Argument(help="A recording.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="The page to write; else BAG.html beside the bag."),
    ] = None,
    diagnosis: Annotated[
        Path | None,
        typer.Option(
            exists=True,
            file_okay=False,
            help="Folder of its diagnosis; else BAG_diagnosis, where that is there.",
        ),
    ] = None,
    estimates: Annotated[
        Path | None,
        typer.Option(
            exists=True, help="Bag of its estimates; else BAG_estimates, where that is there."
        ),
    ] = None,
    browser: Annotated[bool, typer.Option(help="Show the page in the browser.")] = True,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Show a recording, its estimates, events and diagnosis as one local page to scroll through.

    Example: ankle open session
    """
    from session_analysis.recording_page import write_recording_page

    path = bag.resolve()
    target = out or path.with_name(f"{path.name}.html")
    if target.exists() and not overwrite:
        raise RunError(f"{target} is there already; replace it with --overwrite")
    if diagnosis is None:
        diagnosis = path.with_name(f"{path.name}_diagnosis")
    if estimates is None:
        beside = path.with_name(f"{path.name}_estimates")
        estimates = beside if beside.is_dir() else None
    with working(f"reading {bag}"):
        write_recording_page(bag, target, diagnosis, estimates)
    console.print(f"page: {target.resolve()}", soft_wrap=True)
    if browser and not webbrowser.open(target.resolve().as_uri()):
        console.print("no browser was found; open the page by hand")
    return {"out": target.resolve()}
