"""A ROS parameter file with every parameter of the laboratory's nodes, its unit and its range."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable
from importlib.metadata import entry_points

import yaml

from ankle_bringup.executables import declared_parameters, is_node
from ankle_interfaces.quantity import Quantity

LINE_LENGTH = 100


def of_every_node() -> str:
    """Return the file ``share/ankle_bringup/params/laboratory.yaml``: each node's defaults."""
    nodes = {}
    for entry in entry_points(group="console_scripts"):
        declared = declared_parameters(entry, {}) if is_node(entry) else None
        if declared is not None:
            nodes[entry.name] = declared.values()
    head = _comment(
        "Every parameter of every node at its default. Copy what you change; give the copy to "
        "ros2 launch as params_file:=FILE, or to 'ankle up' as --params-file FILE.",
        "",
    )
    return "\n".join([head, *(of_node(name, nodes[name]) for name in sorted(nodes))])


def of_node(name: str, parameters: Iterable[Quantity]) -> str:
    """Return the entry of one node.

    Parameters
    ----------
    name
        Name of the node, as in the graph.
    parameters
        Its quantities; the default is the value that is written.
    """
    lines = [f"{name}:", "  ros__parameters:"]
    for parameter in parameters:
        start = "; at start only" if parameter.start_only else ""
        lines.append(
            _comment(f"{parameter.explanation} Allowed: {parameter.allowed}{start}.", "    ")
        )
        value = yaml.safe_dump({parameter.name: parameter.default}, width=10**6).strip()
        lines.append(f"    {value}")
    return "\n".join(lines) + "\n"


def _comment(text: str, indent: str) -> str:
    return textwrap.fill(
        text, LINE_LENGTH, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# "
    )
