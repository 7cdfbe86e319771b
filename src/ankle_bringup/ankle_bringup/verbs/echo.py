"""`ankle echo`: the messages of a topic."""

from __future__ import annotations

from typing import Annotated

import typer

from ankle_bringup.terminal import Namespace


def verb(
    topic: Annotated[str, typer.Argument(help="Name of the topic, as in /impedance/estimate.")],
    count: Annotated[
        int, typer.Option("--count", "-n", help="End after so many messages; 0 goes on.")
    ] = 0,
    seconds: Annotated[
        float, typer.Option(help="End when nothing has come for so many seconds.")
    ] = 10.0,
    namespace: Namespace = "",
) -> None:
    """Show the messages of a topic: blocks as tables, all others as YAML.

    Example: ankle echo /impedance/estimate -n 1
    """
    from ankle_bringup.errors import RunError
    from ankle_bringup.live_graph import echo, observer
    from ankle_interfaces.topics import SESSION_EVENT

    # Names of topics as the laboratory's own documentation writes them, with a slash, are its own.
    name = topic.lstrip("/") if namespace else topic
    with observer(namespace=namespace) as node:
        shown = echo(node, name, lambda text: print(text, flush=True), count, seconds)
    if shown == 0:
        late = (
            "; events of before are not sent again: begin before they happen, or look into the bag"
            if SESSION_EVENT.among([topic])
            else ""
        )
        raise RunError(f"nothing came on '{topic}' within {seconds:g} s{late}")
