"""`ankle run`: a single node."""

from __future__ import annotations

from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Annotated

import typer

from ankle_bringup.errors import RunError
from ankle_bringup.terminal import console, new_table

HELP = {"-h", "--help"}
# What follows the executable is for the node, its --help included.
CONTEXT = {"allow_extra_args": True, "ignore_unknown_options": True, "help_option_names": []}


def verb(
    context: typer.Context,
    package: Annotated[
        str, typer.Argument(help="The package; --help lists them.", show_default=False)
    ] = "--help",
    executable: Annotated[
        str,
        typer.Argument(
            help="The executable; --help lists those of the package.", show_default=False
        ),
    ] = "--help",
) -> None:
    """Run a single node, as `ros2 run` does. With --help behind the executable, show what the node
    reads, publishes and has as parameters.

    Example: ankle run ankle_sim ankle_sim --ros-args -p K:=80.0
    """
    from ankle_bringup.executables import become, find_executable, is_node, node_command

    if package in HELP:
        console.print(context.get_help())
        _list_executables()
        return
    if executable in HELP:
        _list_executables(package)
        return
    entry = find_executable(package, executable)
    for option, file in zip(context.args, context.args[1:], strict=False):
        if option == "--params-file" and not Path(file).is_file():
            raise RunError(f"no parameter file at {file}")
    if is_node(entry) and HELP & set(context.args):
        _describe(entry)
    else:
        become(node_command(package, executable) + context.args)


def _list_executables(package: str = "") -> None:
    from ankle_bringup.executables import executables, packages_with_nodes

    table = new_table(("package", "executable"))
    for name in [package] if package else packages_with_nodes():
        for executable in executables(name):
            table.add_row(name, executable)
    console.print(table)


def _describe(entry: EntryPoint) -> None:
    from importlib import import_module

    from ankle_bringup.executables import declared_parameters

    console.print(import_module(entry.module).__doc__ or "", soft_wrap=True)
    declared = declared_parameters(entry, {})
    if declared is None:
        return
    table = new_table(("parameter", "default", "allowed", "what it is"))
    for name, parameter in declared.items():
        table.add_row(name, str(parameter.default), parameter.allowed, parameter.explanation)
    console.print(table)
    console.print(f"Set one with: --ros-args -p {next(iter(declared))}:=VALUE")
