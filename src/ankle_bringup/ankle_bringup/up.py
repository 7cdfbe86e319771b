"""Run a graph from a terminal, which shows what it estimates and what is missing."""

from __future__ import annotations

import contextlib
import math
import signal
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from types import FrameType
from typing import Any

import rclpy
from rclpy.client import Client
from rclpy.node import Node
from rich.console import Console
from rich.live import Live
from rich.table import Table
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ankle_bringup.browser_pages import page_addresses, show_pages
from ankle_bringup.graph import Graph
from ankle_bringup.live_graph import observer
from ankle_bringup.live_monitor import ESTIMATE, SAMPLES, TRUTH, LiveMonitor
from ankle_bringup.processes import Processes
from ankle_interfaces.topics import RIG_STATE
from ankle_node.node import LATEST_QOS

DRIVER = "ankle_actuator_driver"
ESTIMATOR = "impedance_estimator"
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
    """Show the latest estimate, the true value where it is known, and the state of a rig; torque
    and angle where no estimator runs.
    """
    if has_estimator:
        table = Table("", "estimated", "true", "unit")
        for symbol, unit in ESTIMATED:
            column = f"{symbol}[{unit}]"
            truth = monitor.latest(TRUTH, column) if symbol in "KG" else math.nan
            estimate = _in_words(monitor.latest(ESTIMATE, column), "not yet")
            table.add_row(symbol, estimate, _in_words(truth, ""), unit)
        valid = monitor.latest(ESTIMATE, "valid[1]")
        table.add_row(
            "valid", "yes" if valid == 1.0 else "not yet" if math.isnan(valid) else "no", "", ""
        )
    else:
        table = Table("", "measured", "", "unit")
        torque = monitor.latest(SAMPLES, "torque[N.m]")
        angle = math.degrees(monitor.latest(SAMPLES, "position[rad]"))
        table.add_row("torque", _in_words(torque, "not yet"), "", "N.m")
        table.add_row("angle", _in_words(angle, "not yet"), "", "deg")
        table.add_row("K, B, I, G", "none", "no estimator in this graph", "")
    table.add_row(
        "samples received", str(monitor.streams[SAMPLES].samples), "", f"{monitor.missing} missing"
    )
    if rig:
        table.add_row("rig", rig[-1], "", "")
    if seconds_left is not None:
        table.add_row("time left", f"{max(seconds_left, 0.0):.0f}", "", "s")
    return table


def _in_words(value: float, absent: str) -> str:
    return absent if math.isnan(value) else f"{value:.4g}"


def run_graph(graph: Graph, logs: Path, seconds: float, console: Console) -> None:
    """Start the graph and show its state until Ctrl-C, the end of `seconds` (0: no end), or the end
    of the perturbation.

    Raises
    ------
    GraphError
        An executable that does not exist.
    RunError
        A node ended with an error.
    """
    console.print(f"{graph.description}\nlogs: {logs.resolve()}   stop: Ctrl-C")
    addresses = page_addresses(graph)
    if addresses is not None:
        console.print(
            f"subject's screen: {addresses[0]}   operator's page: {addresses[1]}", soft_wrap=True
        )
    with (
        ending_by_signal(),
        observer(own_signals=True, namespace=graph.namespace) as node,
        Processes(graph, logs) as processes,
    ):
        drivers = [
            node.create_client(Trigger, f"{one.full_name}/stop")
            for one in graph.nodes
            if one.package == DRIVER
        ]
        show_pages(graph)
        monitor = LiveMonitor(node)
        rig: list[str] = []
        has_estimator = any(one.package == ESTIMATOR for one in graph.nodes)

        def receive_state(message: Any) -> None:
            rig.append(str(message.data))

        node.create_subscription(String, RIG_STATE.name, receive_state, LATEST_QOS)
        began = time.monotonic()
        try:
            first = status_table(monitor, None, rig, has_estimator)
            with Live(first, console=console, refresh_per_second=4) as live:
                while not (seconds and time.monotonic() - began > seconds):
                    if processes.ended("perturbation_generator"):
                        console.print("the perturbation is over")
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
