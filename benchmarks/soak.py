"""A long session on the emulated rig, over UDP: what is lost, what grows, what stops without being
asked.

    make soak                 two hours
    make soak MINUTES=10      a short one
    .venv/bin/python benchmarks/soak.py --minutes 3 --busy 2     beside two processes that compute

Driver, generator and emulated rig run as in the graph `rig`; an operator arms and
starts, and starts again after every stop that nobody asked for. Every half minute: samples received
and missing, memory and open files of each process, and the delay from a sample's own time to its
arrival.
"""

from __future__ import annotations

import argparse
import multiprocessing
import os
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np
import rclpy
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from ankle_bringup.graph import Graph, load_graph
from ankle_bringup.live_graph import observer
from ankle_bringup.processes import Processes
from ankle_interfaces.block import unpack
from ankle_interfaces.continuity import Continuity
from ankle_interfaces.topics import ANKLE_SAMPLES, RIG_STATE
from ankle_node.domain import take_free_domain
from ankle_node.qos import reader_qos

KEPT = ("ankle_actuator_driver", "perturbation_generator", "rig_emulator")
LOOK = 30.0  # s
NEXT = {"fault": "reset_fault", "ready": "arm", "armed": "start"}
PAGE = os.sysconf("SC_PAGE_SIZE")
LARGEST_GROWTH = 1.0  # % of memory, from the middle to the end


class Operator:
    """Follows the rig and keeps it running."""

    def __init__(self, node: rclpy.node.Node) -> None:
        self.node, self.state, self.unasked, self.asked = node, "", [], True
        self.continuity, self.samples, self.delays = Continuity(), 0, []
        node.create_subscription(
            Float64MultiArray, ANKLE_SAMPLES.name, self._hear, reader_qos(ANKLE_SAMPLES), raw=True
        )
        node.create_subscription(String, RIG_STATE.name, self._follow, reader_qos(RIG_STATE))
        self._clients = {
            name: node.create_client(Trigger, f"ankle_actuator_driver/{name}")
            for name in (*NEXT.values(), "stop")
        }
        self._waiting = None
        self._executor = SingleThreadedExecutor()
        self._executor.add_node(node)

    def _hear(self, message: bytes) -> None:
        block = unpack(message)
        self.continuity.check(block.data)
        self.samples += len(block.data)
        self.delays.append(time.time() - float(block.time[-1]))

    def _follow(self, message: String) -> None:
        state, _, reason = message.data.partition(": ")
        if self.state == "running" and state != "running" and not self.asked:
            self.unasked.append(reason)
        self.state = state

    def spin(self, seconds: float) -> None:
        """Let time pass and bring the rig up again wherever it stopped."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.02)
            waiting = self._waiting is not None and not self._waiting.done()
            if self.state in NEXT and not waiting:
                self.asked = False
                self._waiting = self._clients[NEXT[self.state]].call_async(Trigger.Request())

    def stop(self) -> None:
        """Asked for."""
        self.asked = True
        future = self._clients["stop"].call_async(Trigger.Request())
        while not future.done():
            self._executor.spin_once(timeout_sec=0.02)


def memory(pid: int) -> float:
    """Resident memory of a process [MB]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE / 1e6


def open_files(pid: int) -> int:
    """File handles of a process."""
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))


def compute() -> None:
    """Use one core, in a session of its own, between which Linux shares the cores."""
    os.setsid()
    data = np.random.default_rng(1).normal(size=(200, 200))
    while True:
        np.linalg.svd(data)


def session_graph() -> Graph:
    """Driver, generator and emulator of the graph `rig`."""
    graph = load_graph("rig").with_options(["emulator"])
    alone = [f"{name}.wait_for_readers=1" for name in KEPT[:2]]
    graph = graph.with_settings(alone)
    return Graph(graph.description, tuple(node for node in graph.nodes if node.name in KEPT))


def look(operator: Operator, pids: dict[str, int], began: float) -> dict[str, tuple[float, int]]:
    """Print a line, give memory and open files of each process."""
    found = {name: (memory(pid), open_files(pid)) for name, pid in pids.items()}
    delay = 1e3 * np.array(operator.delays or [np.nan])
    operator.delays = []
    print(
        f"{(time.monotonic() - began) / 60:6.1f} min  {operator.samples} samples, "
        f"{operator.continuity.missing} missing, {len(operator.unasked)} unasked stops, delay "
        f"median {np.median(delay):.1f} ms, worst {delay.max():.0f} ms; "
        + ", ".join(f"{name} {size:.1f} MB {files} files" for name, (size, files) in found.items()),
        flush=True,
    )
    return found


def report(operator: Operator, looks: list[dict[str, tuple[float, int]]], minutes: float) -> int:
    """Print what the session came to; 0 where nothing was lost, grew or stopped unasked."""
    middle, last = looks[len(looks) // 2], looks[-1]
    growth = {name: 100.0 * (last[name][0] / middle[name][0] - 1.0) for name in last}
    opened = {name: last[name][1] - middle[name][1] for name in last}
    print(
        f"{minutes:g} minutes at a load of {os.getloadavg()[0]:.1f}: "
        f"{operator.continuity.missing} samples missing, {len(operator.unasked)} unasked stops"
    )
    for reason in operator.unasked:
        print(f"  unasked: {reason}")
    for name, percent in growth.items():
        print(f"  {name}: memory {percent:+.2f} % in the second half, {opened[name]:+d} open files")
    steady = max(growth.values()) < LARGEST_GROWTH and max(opened.values()) <= 0
    return int(not steady or operator.continuity.missing > 0 or bool(operator.unasked))


def run(minutes: float, pids: Callable[[], dict[str, int]], operator: Operator) -> int:
    """The session itself."""
    while operator.state != "running":
        operator.spin(0.5)
    operator.unasked.clear()
    began, looks = time.monotonic(), []
    while time.monotonic() - began < 60 * minutes:
        operator.spin(min(LOOK, 60 * minutes - (time.monotonic() - began)))
        looks.append(look(operator, pids(), began))
    operator.stop()
    return report(operator, looks, minutes)


def main() -> int:
    """Run and print."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--minutes", type=float, default=120.0)
    options.add_argument("--busy", type=int, default=0, help="processes that compute beside it")
    given = options.parse_args()
    take_free_domain()
    beside = [multiprocessing.Process(target=compute, daemon=True) for _ in range(given.busy)]
    for process in beside:
        process.start()
    try:
        with (
            tempfile.TemporaryDirectory() as folder,
            observer("soak") as node,
            Processes(session_graph(), Path(folder)) as processes,
        ):
            return run(given.minutes, lambda: processes.pids, Operator(node))
    finally:
        for process in beside:
            process.terminate()


if __name__ == "__main__":
    sys.exit(main())
