"""Run a graph in front of a person: what it estimates, what is missing, until they stop it."""

from __future__ import annotations

import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.live import Live
from rich.table import Table
from std_msgs.msg import String

from ankle_bringup.browser_pages import page_addresses, show_pages
from ankle_bringup.graph import Graph
from ankle_bringup.live_graph import observer
from ankle_bringup.live_monitor import ESTIMATE, SAMPLES, TRUTH, LiveMonitor
from ankle_bringup.processes import Processes
from ankle_node.node import WORKED_OFF_QOS

RIG_STATE = "/rig/state"


def status_table(
    monitor: LiveMonitor, seconds_left: float | None, rig: Sequence[str] = ()
) -> Table:
    """Latest estimate beside the true value where a simulation tells it, and the state of a rig."""
    table = Table("", "estimated", "true", "unit")
    for symbol, unit in (("K", "N.m/rad"), ("G", "N.m.s/rad"), ("B", "N.m.s/rad"), ("I", "kg.m^2")):
        column = f"{symbol}[{unit}]"
        truth = monitor.latest(TRUTH, column) if symbol in "KG" else float("nan")
        table.add_row(
            symbol,
            f"{monitor.latest(ESTIMATE, column):.4g}",
            "" if truth != truth else f"{truth:.4g}",
            unit,
        )
    valid = monitor.latest(ESTIMATE, "valid[1]")
    table.add_row("valid", "yes" if valid == 1.0 else "not yet" if valid != valid else "no", "", "")
    table.add_row(
        "samples received", str(monitor.streams[SAMPLES].samples), "", f"{monitor.missing} missing"
    )
    if rig:
        table.add_row("rig", rig[-1], "", "")
    if seconds_left is not None:
        table.add_row("time left", f"{max(seconds_left, 0.0):.0f}", "", "s")
    return table


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
    with observer() as node, Processes(graph, logs) as processes:
        show_pages(graph)
        monitor = LiveMonitor(node)
        rig: list[str] = []

        def hear(message: Any) -> None:
            rig.append(str(message.data))

        node.create_subscription(String, RIG_STATE, hear, WORKED_OFF_QOS)
        began = time.monotonic()
        with Live(status_table(monitor, None, rig), console=console, refresh_per_second=4) as live:
            try:
                while not (seconds and time.monotonic() - began > seconds):
                    if processes.ended("perturbation_generator"):
                        console.print("the perturbation is over")
                        break
                    monitor.spin(0.25)
                    live.update(
                        status_table(
                            monitor, began + seconds - time.monotonic() if seconds else None, rig
                        )
                    )
            except KeyboardInterrupt:
                console.print("stopping ...")
