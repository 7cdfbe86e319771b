"""Verbs of the running graph: start it, look at it, record and replay it."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated, Optional

import typer
from rich.table import Table

from ankle_bringup.terminal import Out, console

verbs = typer.Typer()

Settings = Annotated[
    list[str], typer.Option("--set", help="A parameter, as node.parameter=value. May be repeated.")
]


@verbs.command()
def demo(
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


@verbs.command()
def up(
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
    run_graph(chosen.with_settings(settings), logs, seconds, console)


@verbs.command()
def graphs() -> None:
    """List the graphs that come with the package.

    Example: ankle graphs
    """
    from ankle_bringup.graph import known_graphs, load_graph

    for name in known_graphs():
        console.print(f"[bold]{name}[/bold]: {load_graph(name).description}")


@verbs.command(
    context_settings={
        "allow_extra_args": True,
        "ignore_unknown_options": True,
        "help_option_names": [],
    }
)
def run(context: typer.Context, package: str, executable: str) -> None:
    """Run a single node, as `ros2 run` does.

    Example: ankle run ankle_sim ankle_sim --ros-args -p K:=80.0
    """
    from ankle_bringup.processes import node_command

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    command = node_command(package, executable) + context.args
    os.execv(command[0], command)


@verbs.command()
def record(
    out: Annotated[Path, typer.Argument(help="The new bag.")],
    topics: Annotated[
        str, typer.Option(help="Topics joined by commas; empty records all of them.")
    ] = "",
) -> None:
    """Record the running graph into a bag, until Ctrl-C.

    Example: ankle record session
    """
    _become_node("session_recorder", "record", out=str(out), topics=topics)


@verbs.command()
def replay(
    bag: Path,
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
) -> None:
    """Send a bag to the graph again, without losing a block at any rate.

    Example: ankle replay session --rate 0
    """
    _become_node(
        "session_recorder",
        "replay",
        bag=str(bag),
        rate=rate,
        topics=topics,
        wait_for_readers=wait_for_readers,
    )


def _become_node(package: str, executable: str, **parameters: object) -> None:
    from ankle_bringup.graph import NodeDescription
    from ankle_bringup.processes import node_command

    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    command = (
        node_command(package, executable)
        + NodeDescription(package, executable, executable, parameters).ros_arguments()
    )
    os.execv(command[0], command)


@verbs.command()
def topics() -> None:
    """List the topics of the running graph, with their types and how many publish and read them.

    Example: ankle topics
    """
    from ankle_bringup.live_graph import observer
    from ankle_bringup.live_graph import topics as live_topics

    table = Table("topic", "type", "publishers", "readers")
    with observer() as node:
        for name, types, publishers, readers in live_topics(node):
            table.add_row(name, types, str(publishers), str(readers))
    console.print(table)


@verbs.command()
def echo(
    topic: str,
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
    from ankle_bringup.live_graph import echo as live_echo
    from ankle_bringup.live_graph import observer

    with observer() as node:
        shown = live_echo(node, topic, lambda text: print(text, flush=True), count, seconds)
    if shown == 0:
        raise RunError(f"nothing came on '{topic}' within {seconds:g} s")


@verbs.command()
def params(
    node: Annotated[str, typer.Argument(help="Name of a running node.")],
    parameter: Annotated[Optional[str], typer.Argument(help="Show this one only.")] = None,  # noqa: UP045
    value: Annotated[Optional[str], typer.Argument(help="Set it to this value.")] = None,  # noqa: UP045
) -> None:
    """Show the parameters of a running node with unit, range and description, or set one.

    Example: ankle params ankle_sim K 120.0
    """
    from ankle_bringup.live_graph import describe_parameters, observer, set_parameter

    with observer() as looking:
        if parameter is not None and value is not None:
            set_parameter(looking, node, parameter, value)
            console.print(f"{node}: {parameter} = {value}")
            return
        table = Table("parameter", "value", "what it is", "allowed")
        for descriptor, present in describe_parameters(looking, node):
            if parameter is None or descriptor.name == parameter:
                table.add_row(
                    descriptor.name,
                    str(present),
                    descriptor.description,
                    descriptor.additional_constraints,
                )
    console.print(table)
