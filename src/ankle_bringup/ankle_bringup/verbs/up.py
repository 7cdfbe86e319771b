"""`ankle up`: start a graph."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ankle_bringup.terminal import Namespace, console, number_option
from ankle_interfaces.quantity import Quantity

SECONDS = Quantity("seconds", "s", 0.0, 1e6, 0.0)
VISIT = Quantity("visit", "1", 0, 10_000, 0)
Settings = Annotated[
    list[str], typer.Option("--set", help="A parameter, as node.parameter=value. May be repeated.")
]


def verb(
    graph: Annotated[
        str, typer.Argument(help="A graph that comes with the package, or the path of a YAML file.")
    ] = "simulated",
    settings: Settings = [],  # noqa: B006
    seconds: Annotated[
        float, number_option(SECONDS, "Stop after so many seconds; 0 runs until Ctrl-C.")
    ] = 0.0,
    logs: Annotated[Path, typer.Option(help="Folder for one log file a node.")] = Path(
        "ankle_logs"
    ),
    namespace: Namespace = "",
    params_file: Annotated[
        Path | None,
        typer.Option(
            "--params-file",
            help="ROS parameter file; a value of --set replaces the file's.",
            exists=True,
        ),
    ] = None,
    emulator: Annotated[
        bool,
        typer.Option("--emulator", help="With a rig: start the rig emulator as the other end."),
    ] = False,
    study: Annotated[
        Path | None, typer.Option(help="Record into this study; see 'ankle study init'.")
    ] = None,
    subject: Annotated[str, typer.Option(help="Pseudonym in the study, as S07.")] = "",
    visit: Annotated[int, number_option(VISIT, "Visit in the study, from 1.")] = 0,
    sidecar: Annotated[
        Path | None,
        typer.Option(help="A JSON file with posture, side, body mass, ... of the visit."),
    ] = None,
) -> None:
    """Start a graph of nodes and show what it says, until Ctrl-C.

    A recording that is there is never overwritten: a second session makes a second recording.

    Example: ankle up simulated --set ankle_sim.subject=2 --seconds 30, or: ankle up rig --emulator,
    or: ankle up rig --study my_study --subject S07 --visit 3
    """
    from ankle_bringup.errors import GraphError
    from ankle_bringup.graph import load_graph
    from ankle_bringup.recorded_estimator import set_as_recorded
    from ankle_bringup.recording_place import in_study, what_follows, with_free_place
    from ankle_bringup.up import run_graph
    from session_analysis.study.layout import read_stated

    if (subject or visit) and study is None:
        study = Path()
    if sidecar is not None and study is None:
        raise GraphError("--sidecar states what is known of a visit: it needs --study")
    if study is not None and not (subject and visit):
        raise GraphError("a recording of a study needs --subject and --visit")

    chosen = load_graph(graph).with_options(["emulator"] if emulator else [])
    chosen = chosen.in_namespace(namespace)
    if params_file is not None:
        chosen = chosen.with_parameter_file(params_file)
    chosen = chosen.with_settings(settings)
    chosen, sentences = set_as_recorded(chosen, logs)
    for sentence in sentences:
        console.print(sentence, soft_wrap=True)
    if study is not None:
        stated = read_stated(sidecar) if sidecar is not None else None
        chosen, place = in_study(chosen, study, subject, visit, stated)
        console.print(f"recording into {place}", soft_wrap=True)
    else:
        chosen, sentence = with_free_place(chosen, settings)
        if sentence:
            console.print(sentence, soft_wrap=True)
    run_graph(chosen, logs, seconds, console)
    for sentence in what_follows(chosen, study) if study is not None else ():
        console.print(sentence, soft_wrap=True)
