"""`ankle export`: a bag as tables."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import Overwrite, console, progress


def verb(
    bag: Annotated[Path, typer.Argument(help="The bag.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for CSV, file for NPZ.")],
    form: Annotated[str, typer.Option("--format", help="'csv' or 'npz'.")] = "csv",
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Write the sampled topics of a bag as CSV or NPZ, columns named with their units.

    Example: ankle export session --out session_csv
    """
    from session_recorder.exporting import export_bag

    with progress(f"exporting {bag}") as share:
        written = export_bag(bag, out, form, overwrite=overwrite, progress=share)
    for path in written:
        console.print(str(path))
    return {"written": written}
