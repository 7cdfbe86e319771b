"""`ankle recover`: a complete bag from a damaged one."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import console, progress


def verb(
    bag: Annotated[Path, typer.Argument(help="The damaged bag.")],
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="The repaired bag; beside the damaged one unless given."),
    ] = None,
) -> dict[str, Any]:
    """Make a complete bag from one whose recorder was killed.

    Example: ankle recover session --out session_repaired
    """
    from session_recorder.recovery import recover

    with progress(f"reading {bag}") as share:
        recovered = recover(bag, out, progress=share)
    for sentence in recovered.problems:
        console.print(f"note: {sentence}")
    console.print(f"{recovered.messages} messages in {recovered.path}")
    return {
        "out": recovered.path,
        "messages": recovered.messages,
        "notes": recovered.problems,
    }
