"""The nodes of a graph as processes: started together, watched, stopped by their process ids."""

from __future__ import annotations

import contextlib
import os
import signal
import subprocess
import time
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from types import TracebackType

from ankle_actuator_driver.link.protocol.port_holder import holder_of
from ankle_bringup.errors import RunError
from ankle_bringup.executables import (
    become,
    declared_parameters,
    find_executable,
    node_command,
)
from ankle_bringup.graph import Graph, NodeDescription
from ankle_bringup.namespace import absolute_namespace
from ankle_node.domain import stay_on_this_host
from ankle_node.parent_process import end_with_parent

# A node closes its files on SIGINT. A recorder may have a second of chunks to write; after that
# rclpy is known to hang at times, so the process is asked again more strictly.
STOP_STEPS = ((signal.SIGINT, 10.0), (signal.SIGTERM, 3.0), (signal.SIGKILL, 2.0))


def become_node(package: str, executable: str, namespace: str = "", **parameters: object) -> None:
    """Replace this process by a node.

    Parameters
    ----------
    package, executable
        What is run.
    namespace
        Namespace of the node's laboratory.
    parameters
        Values of its parameters.

    Raises
    ------
    GraphError
        No name of a namespace that ROS accepts.
    """
    description = NodeDescription(
        package, executable, executable, parameters, namespace=absolute_namespace(namespace)
    )
    become(node_command(package, executable) + description.ros_arguments())


_PORT_PROTOCOLS = {"biofeedback": "tcp", "rig_emulator": "udp"}
"""Protocol of the executables that listen at their parameter `port`."""


def require_free_ports(graph: Graph) -> None:
    """Refuse a graph with a node whose port is in use.

    Raises
    ------
    RunError
        A port is in use; names the process that holds it.
    """
    for node in graph.nodes:
        if node.executable in _PORT_PROTOCOLS:
            declared = declared_parameters(
                find_executable(node.package, node.executable), node.parameters
            )
            usual = declared["port"].default if declared else 0
            port = int(node.parameters.get("port", usual))
            if holder := holder_of(_PORT_PROTOCOLS[node.executable], port) if port else "":
                raise RunError(f"{node.name} cannot listen{holder}")


class Processes:
    """Runs the nodes of a graph; a context manager that leaves no process behind.

    Parameters
    ----------
    graph
        The graph to run.
    logs
        Folder for one log file a node.

    Raises
    ------
    GraphError
        An executable that does not exist (before anything is started).
    """

    def __init__(self, graph: Graph, logs: Path) -> None:
        self._graph = graph
        self._commands = [
            (node, node_command(node.package, node.executable)) for node in graph.nodes
        ]
        self._logs = logs
        self._running: dict[str, subprocess.Popen[bytes]] = {}

    def __enter__(self) -> Processes:
        require_free_ports(self._graph)
        self._logs.mkdir(parents=True, exist_ok=True)
        for node, command in self._commands:
            self._start(node, command)
        return self

    def restart(self, name: str, **parameters: object) -> None:
        """Start a node again that has ended; its log goes on in the same file.

        Parameters
        ----------
        name
            Name of the node.
        parameters
            Values that it gets instead of those of the graph.
        """
        self._running.pop(name).wait()
        node, command = next(entry for entry in self._commands if entry[0].name == name)
        self._start(replace(node, parameters={**node.parameters, **parameters}), command, "ab")

    def _start(self, node: NodeDescription, command: list[str], mode: str = "wb") -> None:
        environment = {**os.environ, "PYTHONUNBUFFERED": "1"}
        stay_on_this_host(environment)
        with open(self._logs / f"{node.name}.log", mode) as log:
            # Its own session: Ctrl-C at the terminal reaches us alone, and we stop the nodes in
            # order.
            self._running[node.name] = subprocess.Popen(
                command + node.ros_arguments(),
                stdout=log,
                stderr=subprocess.STDOUT,
                stdin=subprocess.DEVNULL,
                env=environment,
                start_new_session=True,
                # With SIGTERM, on which the driver stops its rig.
                preexec_fn=partial(end_with_parent, signal.SIGTERM),
            )

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        self.stop()

    @property
    def names(self) -> list[str]:
        """Return the names of the nodes that still run."""
        return [name for name, process in self._running.items() if process.poll() is None]

    @property
    def pids(self) -> dict[str, int]:
        """Return the process ids of all nodes by name."""
        return {name: process.pid for name, process in self._running.items()}

    def log(self, name: str) -> Path:
        """Return the log file of a node."""
        return self._logs / f"{name}.log"

    def ended(self, name: str) -> bool:
        """Return whether a node that is meant to end has done so; every other one must still run.

        The result is False for a node that the graph does not have.

        Raises
        ------
        RunError
            A node ended with an error, or ended though it is not `name`; carries the last line it
            wrote.
        """
        self._check(may_end=name)
        return name in self._running and name not in self.names

    def _check(self, may_end: str | None = None) -> None:
        for name, process in self._running.items():
            code = process.poll()
            if code is not None and (code != 0 or name != may_end):
                lines = self.log(name).read_text(errors="replace").strip().splitlines()
                raise RunError(
                    f"{name} ended with exit code {code}: "
                    f"{lines[-1] if lines else 'it wrote nothing'} (log: {self.log(name)})"
                )

    def wait_for_end(self, name: str, seconds: float) -> None:
        """Wait until a node has ended by itself, watching all of them.

        Raises
        ------
        RunError
            The graph has no such node, it did not end in time, or as `ended`.
        """
        if name not in self._running:
            raise RunError(f"no node '{name}' runs; running: {', '.join(self._running) or 'none'}")
        deadline = time.monotonic() + seconds
        while not self.ended(name):
            if time.monotonic() > deadline:
                raise RunError(f"{name} did not end within {seconds:g} s (log: {self.log(name)})")
            time.sleep(0.05)

    def stop(self, names: Sequence[str] | None = None) -> dict[str, int]:
        """Stop the named nodes, or all, and give their exit codes.

        Graphs list readers before those they read, so the last one is stopped first: the others
        still take what it sent.
        """
        codes = {}
        for name in [name for name in reversed(self._running) if names is None or name in names]:
            process = self._running.pop(name)
            for number, patience in STOP_STEPS:
                if process.poll() is None:
                    process.send_signal(number)
                    with contextlib.suppress(subprocess.TimeoutExpired):
                        process.wait(timeout=patience)
            codes[name] = process.wait(timeout=5.0)
        return codes
