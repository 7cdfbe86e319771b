"""`ankle record`: the running graph into a bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ankle_bringup.terminal import Namespace


def verb(
    name: Annotated[
        Path | None, typer.Argument(help="The new bag; another way to say --out.")
    ] = None,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help="The new bag; 'session' unless given.")
    ] = None,
    topics: Annotated[
        str, typer.Option(help="Topics joined by commas; empty records all of them.")
    ] = "",
    rig: Annotated[
        Path | None,
        typer.Option(
            help="The calibrated rig in force (rig.yaml), which the bag carries.",
            exists=True,
            dir_okay=False,
        ),
    ] = None,
    namespace: Namespace = "",
) -> None:
    """Record the running graph into a bag, until Ctrl-C.

    Example: ankle record --out session --rig rig.yaml
    """
    from ankle_bringup.errors import RunError
    from ankle_bringup.processes import become_node

    if name is not None and out is not None:
        raise RunError(f"the new bag has two names, '{name}' and --out '{out}'; give one")
    bag = out or name or Path("session")
    become_node(
        "session_recorder",
        "record",
        namespace,
        out=str(bag),
        topics=topics,
        rig=str(rig) if rig is not None else "",
    )
