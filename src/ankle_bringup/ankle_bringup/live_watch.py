"""A graph with a simulated ankle is watched until its perturbation is over."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

from rich.console import Console
from rich.live import Live
from rich.table import Table

from ankle_bringup.errors import RunError
from ankle_bringup.live_monitor import SAMPLES, LiveMonitor
from ankle_bringup.processes import Processes

FIRST_SAMPLES_WITHIN = 300.0
"""Wait [s] for the graph's first samples: the simulation compiles once, under load for minutes."""


@contextmanager
def live_table(first: Table, console: Console) -> Iterator[Live]:
    """Show a table that is replaced while it is looked at, and whatever is printed next below it.

    Parameters
    ----------
    first
        What is shown at first; `Live.update` replaces it.
    console
        A terminal, or a file that receives the last table.

    Yields
    ------
    Live
        The place of the table.
    """
    with Live(first, console=console, refresh_per_second=4) as live:
        yield live
    if not console.is_terminal:
        console.print()  # Rich leaves the last line open in a file.


def watch(
    monitor: LiveMonitor,
    processes: Processes,
    seconds: float,
    table: Callable[[float], Table],
    console: Console,
) -> None:
    """Show a table until the perturbation is over, then stop the graph.

    Parameters
    ----------
    monitor
        Reads along.
    processes
        The running graph.
    seconds
        Length of the perturbation [s].
    table
        Makes the table that is shown, of the time that is left [s].
    console
        Where it is shown.

    Raises
    ------
    RunError
        A node failed, or no samples came.
    """
    began = None
    asked_at = time.monotonic()
    with live_table(table(seconds), console) as live:
        while not processes.ended("perturbation_generator"):
            monitor.spin(0.25)
            if began is None and monitor.streams[SAMPLES].blocks:
                began = time.monotonic()
            if began is None and time.monotonic() - asked_at > FIRST_SAMPLES_WITHIN:
                raise RunError(
                    f"no samples within {FIRST_SAMPLES_WITHIN:.0f} s "
                    f"(log: {processes.log('ankle_sim')})"
                )
            live.update(table(seconds if began is None else began + seconds - time.monotonic()))
        monitor.spin(1.0)
        live.update(table(0.0))
    for name, code in processes.stop().items():
        if code != 0:
            raise RunError(f"{name} ended with exit code {code} (log: {processes.log(name)})")
