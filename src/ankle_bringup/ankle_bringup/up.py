"""Run a graph from a terminal, which shows what it estimates and what is missing."""

from __future__ import annotations

import contextlib
import math
import signal
import time
from collections.abc import Iterator, Sequence
from datetime import datetime
from pathlib import Path
from types import FrameType
from typing import Any

import rclpy
from rclpy.client import Client
from rclpy.node import Node
from rich.console import Console
from rich.table import Table
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ankle_bringup.browser_pages import page_addresses, show_pages
from ankle_bringup.errors import GraphError
from ankle_bringup.graph import Graph, NodeDescription
from ankle_bringup.live_graph import observer
from ankle_bringup.live_monitor import (
    ESTIMATE,
    REFERENCE,
    SAMPLES,
    TRUTH,
    VALID,
    LiveMonitor,
    with_one_more_reader,
)
from ankle_bringup.live_watch import live_table
from ankle_bringup.processes import Processes
from ankle_bringup.recorded_estimator import REPLAY
from ankle_interfaces.block import TIME_COLUMN
from ankle_interfaces.topics import RIG_STATE
from ankle_node.node import LATEST_QOS

DRIVER = "ankle_actuator_driver"
ESTIMATOR = "impedance_estimator"

ENDINGS = {
    ("perturbation_generator", "perturbation_generator"): "the perturbation is over",
    REPLAY: "the recording was replayed to its end",
}
"""Package and executable of the nodes that end by themselves, and what their end means."""
ESTIMATED = (("K", "N.m/rad"), ("G", "N.m.s/rad"), ("B", "N.m.s/rad"), ("I", "kg.m^2"))
"""Quantities of the terminal's table, with their units."""
ENDING_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
"""Ctrl-C, `kill`, and the end of the terminal or of the connection to this computer."""
STOP_PATIENCE = 1.0
"""[s] for the driver to confirm its stop; it acts before it answers, within 0.1 s."""


def status_table(
    monitor: LiveMonitor,
    seconds_left: float | None,
    rig: Sequence[str] = (),
    has_estimator: bool = True,
) -> Table:
    """Show the last valid estimate and when it was, the true value where it is known, and the state
    of a rig; torque and angle where no estimator runs.
    """
    if has_estimator:
        table = Table("", "estimated", "true", "unit")
        for symbol, unit in ESTIMATED:
            column = f"{symbol}[{unit}]"
            truth = monitor.latest(TRUTH, column) if symbol in "KG" else math.nan
            estimate = _in_words(monitor.latest_valid(column), "not yet")
            table.add_row(symbol, estimate, _in_words(truth, ""), unit)
        table.add_row("valid", _validity(monitor), "", "")
    else:
        table = Table("", "measured", "", "unit")
        torque = monitor.latest(SAMPLES, "torque[N.m]")
        angle = math.degrees(monitor.latest(SAMPLES, "position[rad]"))
        table.add_row("torque", _in_words(torque, "not yet"), "", "N.m")
        table.add_row("angle", _in_words(angle, "not yet"), "", "deg")
        table.add_row("K, B, I, G", "none", "no estimator in this graph", "")
    if SAMPLES in monitor.streams:
        received = str(monitor.streams[SAMPLES].samples)
        table.add_row("samples received", received, "", f"{monitor.missing} missing")
    else:
        table.add_row("estimates received", str(monitor.streams[ESTIMATE].samples), "", "")
    if rig:
        table.add_row("rig", rig[-1], "", "")
    if seconds_left is not None:
        table.add_row("time left", f"{max(seconds_left, 0.0):.0f}", "", "s")
    return table


def _validity(monitor: LiveMonitor) -> str:
    if monitor.latest(ESTIMATE, VALID) == 1.0:
        return "yes"
    then = monitor.latest_valid(TIME_COLUMN)
    if math.isnan(then):
        return "not yet"
    clock = datetime.fromtimestamp(then).strftime("%H:%M:%S")
    return f"no; values of {clock}, {monitor.since_valid:.0f} s before"


def _in_words(value: float, absent: str) -> str:
    return absent if math.isnan(value) else f"{value:.4g}"


def run_graph(graph: Graph, logs: Path, seconds: float, console: Console) -> None:
    """Start the graph and show its state until Ctrl-C, the end of `seconds` (0: no end), or the end
    of the perturbation or of the replayed recording.

    Raises
    ------
    GraphError
        An executable that does not exist, or a replay without a recording.
    RunError
        A node ended with an error.
    """
    require_recording(graph)
    topics = watched_topics(graph)
    graph = with_one_more_reader(graph, topics)
    ending, sentence = ending_node(graph)
    console.print(f"{graph.description}\nlogs: {logs.resolve()}   stop: Ctrl-C")
    addresses = page_addresses(graph)
    if addresses is not None:
        console.print(
            f"subject's screen: {addresses[0]}   operator's page: {addresses[1]}", soft_wrap=True
        )
    with (
        ending_by_signal(),
        observer(own_signals=True, namespace=graph.namespace) as node,
        contextlib.closing(LiveMonitor(node, topics)) as monitor,
        Processes(graph, logs) as processes,
    ):
        drivers = [
            node.create_client(Trigger, f"{one.full_name}/stop")
            for one in graph.nodes
            if one.package == DRIVER
        ]
        show_pages(graph)
        rig: list[str] = []
        has_estimator = any(one.package == ESTIMATOR for one in graph.nodes)

        def receive_state(message: Any) -> None:
            rig.append(str(message.data))

        node.create_subscription(String, RIG_STATE.name, receive_state, LATEST_QOS)
        began = time.monotonic()
        try:
            first = status_table(monitor, None, rig, has_estimator)
            with live_table(first, console) as live:
                while not (seconds and time.monotonic() - began > seconds):
                    if processes.ended(ending):
                        console.print(sentence)
                        break
                    monitor.spin(0.25)
                    left = began + seconds - time.monotonic() if seconds else None
                    live.update(status_table(monitor, left, rig, has_estimator))
        except KeyboardInterrupt:
            with contextlib.suppress(OSError):  # the terminal may be gone
                console.print("stopping ...")
        finally:
            ignore_ending_signals()
            stop_rig(node, drivers)


def ending_node(graph: Graph) -> tuple[str, str]:
    """Return the name of the node with which the graph ends, and a sentence that says so; two
    empty texts for a graph that goes on until it is stopped.
    """
    return next(
        (
            (node.name, ENDINGS[node.package, node.executable])
            for node in graph.nodes
            if (node.package, node.executable) in ENDINGS
        ),
        ("", ""),
    )


def _replays(graph: Graph) -> list[NodeDescription]:
    return [node for node in graph.nodes if (node.package, node.executable) == REPLAY]


def watched_topics(graph: Graph) -> tuple[str, ...]:
    """Return the topics that the table needs.

    A replay goes on as fast as the nodes follow, but does not wait for the table: of it only the
    estimates are read.
    """
    return (ESTIMATE,) if _replays(graph) else (ESTIMATE, SAMPLES, REFERENCE, TRUTH)


def require_recording(graph: Graph) -> None:
    """Refuse a graph that replays a recording that is not named.

    Raises
    ------
    GraphError
        No recording is named; says how to name it.
    """
    for node in _replays(graph):
        if not node.parameters.get("bag"):
            raise GraphError(
                f"parameter 'bag' of {node.name} is missing, the recording to replay: add "
                f"--set {node.name}.bag=BAG"
            )


@contextlib.contextmanager
def ending_by_signal() -> Iterator[None]:
    """Turn the first of `ENDING_SIGNALS` into KeyboardInterrupt; later ones change nothing.

    Whatever follows, bringing the plate to rest and ending the nodes in order, is not interrupted.
    """

    def end(number: int, frame: FrameType | None) -> None:
        ignore_ending_signals()
        raise KeyboardInterrupt

    before = {number: signal.signal(number, end) for number in ENDING_SIGNALS}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def ignore_ending_signals() -> None:
    """Ignore ending signals from here on, so that everything comes to its end."""
    for one in ENDING_SIGNALS:
        signal.signal(one, signal.SIG_IGN)


def stop_rig(node: Node, drivers: Sequence[Client]) -> None:
    """Stop the rig's drivers before any node is ended, and wait until they confirm it."""
    calls = [client.call_async(Trigger.Request()) for client in drivers]
    deadline = time.monotonic() + STOP_PATIENCE
    while not all(call.done() for call in calls) and time.monotonic() < deadline:
        rclpy.spin_once(node, timeout_sec=0.02)
