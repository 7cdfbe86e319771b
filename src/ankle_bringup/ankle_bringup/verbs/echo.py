"""`ankle echo`: the messages of a topic."""

from __future__ import annotations

from typing import Annotated

import typer


def verb(
    topic: Annotated[str, typer.Argument(help="Name of the topic, as in /impedance/estimate.")],
    count: Annotated[
        int, typer.Option("--count", "-n", help="End after so many messages; 0 goes on.")
    ] = 0,
    seconds: Annotated[
        float, typer.Option(help="End when nothing has come for so many seconds.")
    ] = 10.0,
) -> None:
    """Show the messages of a topic: blocks as tables, all others as YAML.

    Example: ankle echo /impedance/estimate -n 1
    """
    from ankle_bringup.errors import RunError
    from ankle_bringup.live_graph import echo, observer
    from ankle_interfaces.topics import SESSION_EVENT

    with observer() as node:
        shown = echo(node, topic, lambda text: print(text, flush=True), count, seconds)
    if shown == 0:
        late = (
            "; events of before are not sent again: begin before they happen, or look into the bag"
            if SESSION_EVENT.among([topic])
            else ""
        )
        raise RunError(f"nothing came on '{topic}' within {seconds:g} s{late}")
