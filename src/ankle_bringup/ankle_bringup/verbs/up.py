"""`ankle up`: start a graph."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ankle_bringup.terminal import console

Settings = Annotated[
    list[str], typer.Option("--set", help="A parameter, as node.parameter=value. May be repeated.")
]


def verb(
    graph: Annotated[
        str, typer.Argument(help="A graph that comes with the package, or the path of a YAML file.")
    ] = "simulated",
    settings: Settings = [],  # noqa: B006
    seconds: Annotated[
        float, typer.Option(help="Stop after so many seconds; 0 runs until Ctrl-C.")
    ] = 0.0,
    logs: Annotated[Path, typer.Option(help="Folder for one log file a node.")] = Path(
        "ankle_logs"
    ),
    namespace: Annotated[
        str,
        typer.Option(help="Namespace of all nodes and topics: a laboratory of its own, as 'left'."),
    ] = "",
    params_file: Annotated[
        Path | None,
        typer.Option(
            "--params-file", help="ROS parameter file; --set goes before it.", exists=True
        ),
    ] = None,
    emulator: Annotated[
        bool,
        typer.Option("--emulator", help="With a rig: start the rig emulator as the other end."),
    ] = False,
) -> None:
    """Start a graph of nodes and show what it says, until Ctrl-C.

    Example: ankle up simulated --set ankle_sim.subject=2 --seconds 30, or: ankle up rig --emulator
    """
    from ankle_bringup.graph import load_graph
    from ankle_bringup.up import run_graph

    chosen = load_graph(graph).with_options(["emulator"] if emulator else [])
    chosen = chosen.in_namespace(namespace)
    if params_file is not None:
        chosen = chosen.with_parameter_file(params_file)
    run_graph(chosen.with_settings(settings), logs, seconds, console)
