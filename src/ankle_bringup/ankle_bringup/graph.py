"""A graph of nodes as data: one YAML file feeds `ros2 launch` and `ankle up` alike.

```yaml
description: simulated ankle at real time
nodes:
  - package: ankle_sim
    executable: ankle_sim
    name: ankle_sim            # optional, the executable's name unless given
    parameters: {K: 100.0}
    remappings: {ankle/samples: left/ankle/samples}
    when: emulator             # optional: part of the graph only with the option of that name
```
"""

from __future__ import annotations

import contextlib
import fnmatch
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import yaml

from ankle_bringup.errors import GraphError
from ankle_bringup.executables import declared_parameters, find_executable
from ankle_bringup.namespace import absolute_namespace
from ankle_bringup.suggestion import require_known
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity
from ankle_interfaces.yaml_text import YamlError, load_named, names_in, parse_yaml, read_text

PARAMETERS_OF_RCLPY = ("use_sim_time",)  # rclpy declares it
_NODE_KEYS = {"package", "executable", "name", "parameters", "remappings", "when"}


@dataclass(frozen=True)
class NodeDescription:
    """Describes one process of a graph."""

    package: str
    executable: str
    name: str
    parameters: dict[str, Any] = field(default_factory=dict)
    remappings: dict[str, str] = field(default_factory=dict)
    when: str = ""
    namespace: str = ""

    @property
    def full_name(self) -> str:
        """Return the name with its namespace, as ``/left/ankle_sim``."""
        return "/" + "/".join(part for part in (self.namespace.strip("/"), self.name) if part)

    def ros_arguments(self) -> list[str]:
        """Return what follows the executable on its command line."""
        arguments = ["--ros-args", "-r", f"__node:={self.name}"]
        if self.namespace:
            arguments += ["-r", f"__ns:={self.namespace}"]
        for key, value in self.parameters.items():
            text = (
                yaml.safe_dump(value, default_flow_style=True).strip().removesuffix("...").strip()
            )
            arguments += ["-p", f"{key}:={text}"]
        for source, target in self.remappings.items():
            arguments += ["-r", f"{source}:={target}"]
        return arguments

    def require_declared(self) -> None:
        """Refuse parameters that the node does not declare, and values that it would refuse.

        Raises
        ------
        GraphError
            The node has no parameter of a name (has a suggestion and the known names), or a value
            is not allowed.
        """
        declared = declared_parameters(
            find_executable(self.package, self.executable), self.parameters
        )
        if declared is None:
            return
        for parameter, value in self.parameters.items():
            require_known(f"parameter of {self.name}", parameter, [*declared, *PARAMETERS_OF_RCLPY])
            if parameter in declared:
                try:
                    declared[parameter].check(_as_ros_reads(value, declared[parameter]))
                except QuantityError as error:
                    raise GraphError(f"{self.name}: {error}") from None


def _as_ros_reads(value: Any, quantity: Quantity) -> Any:
    """Return a value as a node gets it: 1e-3 is a number for ROS and a text for YAML 1.1."""
    if isinstance(value, str) and isinstance(quantity.default, float):
        with contextlib.suppress(ValueError):
            return float(value)
    return value


@dataclass(frozen=True)
class Graph:
    """Describes nodes that run together."""

    description: str
    nodes: tuple[NodeDescription, ...]

    @property
    def namespace(self) -> str:
        """Return the namespace of its nodes; empty for the root."""
        return self.nodes[0].namespace if self.nodes else ""

    def with_settings(self, settings: Iterable[str]) -> Graph:
        """Return the graph with parameters replaced.

        Each setting is ``node.parameter=value`` with the value in YAML.

        Raises
        ------
        GraphError
            Another form, or a node or a parameter that does not exist.
        """
        nodes = {node.name: node for node in self.nodes}
        changed = set()
        for setting in settings:
            target, equals, text = setting.partition("=")
            # A parameter's name may have dots of its own, as in "session.protocol".
            name, dot, parameter = target.partition(".")
            if not (equals and dot and parameter):
                raise GraphError(
                    f"'{setting}' is not 'node.parameter=value', as in 'ankle_sim.K=80.0'"
                )
            require_known(f"node of this graph (in '{setting}')", name, nodes)
            try:
                value = parse_yaml(text)
            except YamlError as error:
                raise GraphError(f"'{setting}': {error}") from None
            nodes[name] = replace(
                nodes[name], parameters={**nodes[name].parameters, parameter: value}
            )
            changed.add(name)
        for name in changed:
            nodes[name].require_declared()
        return replace(self, nodes=tuple(nodes.values()))

    def in_namespace(self, namespace: str) -> Graph:
        """Return the graph with all nodes in a namespace, a laboratory of its own beside others.

        Raises
        ------
        GraphError
            No name that ROS accepts.
        """
        absolute = absolute_namespace(namespace)
        if not absolute:
            return self
        return replace(self, nodes=tuple(replace(node, namespace=absolute) for node in self.nodes))

    def with_parameter_file(self, path: str | Path) -> Graph:
        """Return the graph with the parameters of a ROS parameter file laid over its own.

        Parameters
        ----------
        path
            A file with ``NODE: {ros__parameters: {NAME: VALUE}}``; ``/**`` stands for every node.

        Raises
        ------
        GraphError
            Not such a file, or a parameter that the node named for it does not declare.
        OSError
            The file cannot be read.
        """
        entries = read_parameter_file(path)
        nodes = []
        for node in self.nodes:
            parameters, named = dict(node.parameters), False
            for pattern, values in entries.items():
                if names_node(pattern, node.full_name):
                    parameters.update(values)
                    named |= "*" not in pattern
            nodes.append(replace(node, parameters=parameters))
            if named:
                nodes[-1].require_declared()
        return replace(self, nodes=tuple(nodes))

    def with_options(self, options: Iterable[str]) -> Graph:
        """Return the graph with the nodes of these options, and without those of others.

        Raises
        ------
        GraphError
            No node has the option.
        """
        chosen = {"", *options}
        known = {"", *(node.when for node in self.nodes)}
        if chosen - known:
            raise GraphError(
                f"the graph has no option '{sorted(chosen - known)[0]}'; it has "
                f"{', '.join(sorted(known - {''})) or 'none'}"
            )
        return replace(self, nodes=tuple(node for node in self.nodes if node.when in chosen))

    def without(self, name: str) -> Graph:
        """Return the graph without one node, unchanged where it has none of that name."""
        return replace(self, nodes=tuple(node for node in self.nodes if node.name != name))


def known_graphs() -> list[str]:
    """Return the names of the graphs that come with the package."""
    return names_in("ankle_bringup", "config")


def load_graph(name: str) -> Graph:
    """Load a graph by the name of one in the package, or by the path of a YAML file.

    Raises
    ------
    GraphError
        No such graph, not YAML, or a node without package or executable; names the file and the
        key.
    """
    try:
        content, _ = load_named(name, "ankle_bringup", "config", "graph")
    except YamlError as error:
        raise GraphError(str(error)) from None
    if not isinstance(content, dict) or not isinstance(content.get("nodes"), list):
        raise GraphError(f"{name}: a graph has 'description' and a list 'nodes'")
    nodes = []
    for item in content["nodes"]:
        if not isinstance(item, dict) or not {"package", "executable"} <= set(item):
            raise GraphError(f"{name}: each node has 'package' and 'executable'; found {item!r}")
        unknown = set(item) - _NODE_KEYS
        if unknown:
            raise GraphError(
                f"{name}: unknown key '{sorted(unknown)[0]}' of node '{item['executable']}'; "
                f"allowed: {', '.join(sorted(_NODE_KEYS))}"
            )
        nodes.append(
            NodeDescription(
                item["package"],
                item["executable"],
                str(item.get("name") or item["executable"]),
                item.get("parameters") or {},
                item.get("remappings") or {},
                str(item.get("when") or ""),
            )
        )
    names = [node.name for node in nodes]
    for node_name in names:
        if names.count(node_name) > 1:
            raise GraphError(
                f"{name}: node name '{node_name}' appears twice; give each its own 'name'"
            )
    return Graph(str(content.get("description", "")), tuple(nodes))


def read_parameter_file(path: str | Path) -> dict[str, dict[str, Any]]:
    """Return the parameters of a ROS parameter file by the node name or pattern they are for.

    Nested groups are joined by dots, as ROS does.

    Raises
    ------
    GraphError
        Not such a file; names the file and the entry.
    OSError
        The file cannot be read.
    """
    try:
        content = parse_yaml(read_text(path, "parameter file"))
    except YamlError as error:
        raise GraphError(f"{path}: {error}") from None
    if not isinstance(content, dict):
        raise GraphError(f"{path}: a parameter file has NODE: {{ros__parameters: ...}}")
    entries = {}
    for pattern, entry in content.items():
        if not isinstance(entry, dict) or not isinstance(entry.get("ros__parameters"), dict):
            raise GraphError(f"{path}: '{pattern}' has no 'ros__parameters'")
        entries[str(pattern)] = _joined(entry["ros__parameters"])
    return entries


def _joined(group: dict[str, Any], prefix: str = "") -> dict[str, Any]:
    found: dict[str, Any] = {}
    for key, value in group.items():
        if isinstance(value, dict):
            found.update(_joined(value, f"{prefix}{key}."))
        else:
            found[f"{prefix}{key}"] = value
    return found


def names_node(pattern: str, full_name: str) -> bool:
    """Return whether an entry of a parameter file is for a node.

    It is the node's name, its name with the namespace, or a pattern with ``*``.
    """
    wanted = pattern.strip("/")
    if "*" in wanted:
        return fnmatch.fnmatchcase(full_name.strip("/"), wanted.replace("**/", "*"))
    return wanted in (full_name.strip("/"), full_name.rpartition("/")[2])
