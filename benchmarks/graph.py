"""The four-process graph under the clock: lost samples, latency of the estimate, load of each
process.

    .venv/bin/python benchmarks/graph.py --seconds 60      # a look
    .venv/bin/python benchmarks/graph.py --seconds 600     # the figures of docs/performance.md

Latency is from the time of the last sample in a block (its ROS time; the generator sends a block
when that time is reached) to the arrival of the estimate in this process. As a peer in the same
run, the same path without our computing: the generator's block straight to this process.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from ankle_bringup.graph import load_graph
from ankle_bringup.live_graph import observer
from ankle_bringup.live_monitor import (
    ESTIMATE,
    MONITORED,
    REFERENCE,
    SAMPLES,
    LiveMonitor,
    with_one_more_reader,
)
from ankle_bringup.processes import Processes
from ankle_node.domain import take_free_domain
from session_recorder.bag_reader import BagReader

STARTUP_BLOCKS = 64
"""Estimates of the first second, in which five processes start at once."""


def processor_seconds(pid: int) -> float:
    """User and system time of a process so far [s]."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def figures(milliseconds: np.ndarray) -> str:
    """Median, 99th percentile and worst of latencies [ms]."""
    return (
        f"median {np.median(milliseconds):.2f} ms, p99 {np.percentile(milliseconds, 99):.2f} "
        f"ms, worst {milliseconds.max():.2f} ms"
    )


def main() -> int:
    """Run, print a table, exit with 1 where a sample was lost."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--seconds", type=float, default=60.0)
    seconds = options.parse_args().seconds
    take_free_domain()
    with tempfile.TemporaryDirectory() as folder, observer("benchmark") as node:
        graph = load_graph("simulated_recorded").with_settings(
            [
                f"record.out={folder}/bag",
                f"perturbation_generator.duration={seconds}",
            ]
        )
        graph = with_one_more_reader(graph, MONITORED)
        monitor = LiveMonitor(node)
        with Processes(graph, Path(folder) / "logs") as processes:
            while monitor.streams[ESTIMATE].blocks == 0:
                processes.ended("perturbation_generator")
                monitor.spin(0.2)
            pids = processes.pids
            began, used = (
                time.monotonic(),
                {name: processor_seconds(pid) for name, pid in pids.items()},
            )
            reported = began
            while not processes.ended("perturbation_generator"):
                monitor.spin(0.5)
                if time.monotonic() - reported > 10.0:
                    reported = time.monotonic()
                    print(
                        f"{reported - began:5.0f} s of {seconds:.0f}: {monitor.missing} samples "
                        "missing",
                        file=sys.stderr,
                        flush=True,
                    )
                load = {
                    name: processor_seconds(pid) - used[name]
                    for name, pid in pids.items()
                    if name in processes.names
                }
                elapsed = time.monotonic() - began
            monitor.spin(1.0)
            processes.stop()
        bag = BagReader(f"{folder}/bag")
        recorded = {topic: len(bag.signal(f"/{topic}")[1]) for topic in (REFERENCE, SAMPLES)}
    estimate, reference = (
        np.array(monitor.latencies) * 1e3,
        np.array(monitor.reference_latencies) * 1e3,
    )
    rows = [
        ("samples sent by the generator", f"{monitor.streams[REFERENCE].samples}"),
        ("samples received here", f"{monitor.streams[SAMPLES].samples}"),
        (
            "samples in the bag (reference / measured)",
            f"{recorded[REFERENCE]} / {recorded[SAMPLES]}",
        ),
        ("samples missing here", f"{monitor.missing}"),
        ("estimates received", f"{len(estimate)}"),
        ("latency, block complete to estimate here", figures(estimate)),
        ("the same after a second", figures(estimate[STARTUP_BLOCKS:])),
        ("peer: generator's block to here", figures(reference)),
        ("ratio of medians", f"{np.median(estimate) / np.median(reference):.2f}"),
    ]
    rows += [
        (f"load of {name}", f"{100 * spent / elapsed:.1f} % of a core")
        for name, spent in load.items()
    ]
    for what, value in rows:
        print(f"{what:44s} {value}")
    lost = (
        monitor.missing
        or recorded[REFERENCE] != recorded[SAMPLES]
        or recorded[SAMPLES] != monitor.streams[SAMPLES].samples
    )
    return 1 if lost else 0


if __name__ == "__main__":
    sys.exit(main())
