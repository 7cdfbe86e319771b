"""`ankle parameter-file`: every parameter of every node at its default."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ankle_bringup.terminal import console


def verb(
    out: Annotated[Path, typer.Option("--out", "-o", help="The new file.")] = Path(
        "laboratory.yaml"
    ),
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace the file.")] = False,
) -> None:
    """Write a ROS parameter file with every parameter, its unit, range and default, to be changed.

    Example: ankle parameter-file --out mine.yaml, then: ankle up simulated --params-file mine.yaml
    """
    from ankle_bringup.errors import RunError
    from ankle_bringup.parameter_file import of_every_node

    if out.exists() and not overwrite:
        raise RunError(f"{out} is there already; give another --out, or --overwrite")
    out.write_text(of_every_node())
    console.print(f"wrote {out}", highlight=False)
