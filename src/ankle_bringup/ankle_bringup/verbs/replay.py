"""`ankle replay`: a bag to the graph again."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ankle_bringup.terminal import Namespace


def verb(
    bag: Annotated[Path, typer.Argument(help="The bag.")],
    rate: Annotated[
        float, typer.Option(help="Bag seconds per second; 0 is as fast as the readers follow.")
    ] = 1.0,
    topics: Annotated[
        str,
        typer.Option(
            help="Topics joined by commas; empty replays the recorded inputs, 'all' everything."
        ),
    ] = "",
    wait_for_readers: Annotated[
        int, typer.Option(help="Nodes that must read along before the start.")
    ] = 1,
    namespace: Namespace = "",
) -> None:
    """Send a bag to the graph again, without losing a block at any rate.

    Example: ankle replay session --rate 0
    """
    from ankle_bringup.processes import become_node

    become_node(
        "session_recorder",
        "replay",
        namespace,
        bag=str(bag),
        rate=rate,
        topics=topics,
        wait_for_readers=wait_for_readers,
    )
