"""The executables of the installed packages: what there is, how to start one, which parameters a
node declares.
"""

from __future__ import annotations

import importlib
import os
import sys
from collections.abc import Mapping
from importlib.metadata import EntryPoint, PackageNotFoundError, distribution, entry_points
from typing import Any

from ankle_bringup.errors import GraphError
from ankle_bringup.suggestion import require_known
from ankle_node.domain import stay_on_this_host

NODE_MODULE = "_node"  # the end of the name of each module that wires a node


def executables(package: str) -> dict[str, EntryPoint]:
    """Return the executables of an installed package by name.

    Raises
    ------
    GraphError
        There is no such package; suggests one that has nodes.
    """
    try:
        found = distribution(package).entry_points
    except PackageNotFoundError:
        require_known("package", package, packages_with_nodes())
        raise GraphError(f"package '{package}' is not installed") from None
    return {entry.name: entry for entry in found if entry.group == "console_scripts"}


def packages_with_nodes() -> list[str]:
    """Return the names of the installed packages that have a node."""
    return sorted(
        {
            entry.dist.name
            for entry in entry_points(group="console_scripts")
            if entry.module.endswith(NODE_MODULE) and entry.dist is not None
        }
    )


def find_executable(package: str, executable: str) -> EntryPoint:
    """Return the entry point of an executable.

    Raises
    ------
    GraphError
        There is no such package or executable; names those that exist.
    """
    found = executables(package)
    require_known(f"executable of package {package}", executable, found)
    return found[executable]


def node_command(package: str, executable: str) -> list[str]:
    """Return the command that runs an executable with this Python, without the `ros2` command.

    Raises
    ------
    GraphError
        There is no such package or executable; names those that exist.
    """
    entry = find_executable(package, executable)
    program = f"import sys; from {entry.module} import {entry.attr}; sys.exit({entry.attr}())"
    return [sys.executable, "-c", program]


def become(command: list[str]) -> None:
    """Replace this process by a node; discovery stays on this host unless the environment says
    otherwise.
    """
    stay_on_this_host()
    os.execv(command[0], command)


def is_node(entry: EntryPoint) -> bool:
    """Return whether an executable is a node, and not a command with options of its own."""
    return entry.module.endswith(NODE_MODULE)


def declared_parameters(entry: EntryPoint, values: Mapping[str, Any]) -> dict[str, Any] | None:
    """Return the parameters that a node declares, without starting it.

    Parameters
    ----------
    entry
        The node's executable. Its module has ``PARAMETERS``, or ``declared_parameters(values)``
        where they depend on the values.
    values
        Start values that are known.

    Returns
    -------
    dict[str, Any] | None
        Each `Parameter` by name; None where the module has neither.
    """
    module = importlib.import_module(entry.module)
    declare = getattr(module, "declared_parameters", None)
    declared = declare(values) if declare is not None else getattr(module, "PARAMETERS", None)
    return None if declared is None else {parameter.name: parameter for parameter in declared}
