"""The rig graph with its emulator: how fast a stop is, how well the rig's clock is known, what is
lost.

    .venv/bin/python benchmarks/rig.py --stops 30

Each stop is asked for in motion (multisine, 0.04 rad), through the service over DDS, and its effect
is read from the rig's own
samples: driver, UDP line, servo cycle, stop movement and the 30 Hz servo are all in it. The rig's
clock drifts by 50 ppm.
"""

from __future__ import annotations

import argparse
import os
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from ankle_bringup.graph import load_graph
from ankle_bringup.live_graph import observer
from ankle_bringup.processes import Processes
from ankle_interfaces.block import unpack
from ankle_interfaces.continuity import Continuity
from ankle_node.domain import take_free_domain
from ankle_node.node import BLOCK_QOS, LATEST_QOS

REST_VELOCITY = 0.02  # rad/s
OBSERVATION_TIME = 0.6  # s; samples that are looked at behind a stop
NEXT_COMMANDS = {"fault": "reset_fault", "ready": "arm", "armed": "start"}


class Operator:
    """Hears the driver and calls its services."""

    def __init__(self, node: rclpy.node.Node) -> None:
        self.node, self.states, self.blocks, self.figures = node, [], [], {}
        self.continuity = Continuity()
        node.create_subscription(
            Float64MultiArray, "/ankle/samples", self._hear, BLOCK_QOS, raw=True
        )
        node.create_subscription(
            String,
            "/rig/state",
            lambda m: self.states.append((m.data.split(":")[0], time.time())),
            LATEST_QOS,
        )
        node.create_subscription(DiagnosticArray, "/diagnostics", self._diagnose, 10)
        names = ("arm", "start", "stop", "reset_fault")
        self.clients = {
            name: node.create_client(Trigger, f"/ankle_actuator_driver/{name}") for name in names
        }

    def _hear(self, message: bytes) -> None:
        block = unpack(message)
        self.continuity.check(block.data)
        self.blocks.append(block.data)

    def _diagnose(self, message: DiagnosticArray) -> None:
        for status in message.status:
            if status.name == "/ankle_actuator_driver":
                self.figures = {entry.key: entry.value for entry in status.values}

    def spin(self, seconds: float) -> None:
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            rclpy.spin_once(self.node, timeout_sec=0.005)

    def call(self, name: str) -> None:
        future = self.clients[name].call_async(Trigger.Request())
        end = time.monotonic() + 10.0
        while not future.done() and time.monotonic() < end:
            rclpy.spin_once(self.node, timeout_sec=0.001)

    def bring_up(self) -> None:
        """Until the rig runs and moves."""
        while not self.states or self.states[-1][0] != "running":
            if self.states and self.states[-1][0] in NEXT_COMMANDS:
                self.call(NEXT_COMMANDS[self.states[-1][0]])
            self.spin(0.1)
        self.spin(1.5)

    def stop(self) -> tuple[float, float, float] | None:
        """Seconds from the call to the answer, to the last motion of the plate, and to the
        confirmed end; None where it did not run.
        """
        if self.states[-1][0] != "running":
            return None
        first = len(self.states)
        asked = time.time()
        self.call("stop")
        answered = time.time()
        self.spin(OBSERVATION_TIME)
        data = np.concatenate(self.blocks[-200:])
        moving = data[(np.abs(data[:, 2]) > REST_VELOCITY) & (data[:, 0] > asked), 0]
        ready = [when for state, when in self.states[first:] if state == "ready"]
        return (
            answered - asked,
            float(moving.max()) - asked if len(moving) else 0.0,
            (ready[0] if ready else np.nan) - asked,
        )


def line(name: str, seconds: np.ndarray) -> str:
    """Median, 95th percentile and worst [ms]."""
    milliseconds = 1e3 * seconds[np.isfinite(seconds)]
    return (
        f"{name}: median {np.median(milliseconds):.1f} ms, p95 "
        f"{np.percentile(milliseconds, 95):.1f} ms, worst {milliseconds.max():.1f} ms"
    )


def main() -> int:
    """Run and print."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--stops", type=int, default=30)
    stops = options.parse_args().stops
    take_free_domain()
    graph = load_graph("rig").with_options(["emulator"])
    graph = graph.with_settings(
        ["perturbation_generator.signal=multisine", "rig_emulator.noise=false"]
    )
    with (
        tempfile.TemporaryDirectory() as folder,
        observer("benchmark") as node,
        Processes(graph, Path(folder)),
    ):
        operator = Operator(node)
        found = []
        while len(found) < stops:
            operator.bring_up()
            entry = operator.stop()
            found += [entry] if entry is not None else []
            print(f"{len(found)} of {stops} stops", file=sys.stderr)
        operator.bring_up()
        operator.spin(5.0)
    answered, rested, confirmed = np.array(found).T
    print(f"{line('stop called to answer', answered)}")
    print(line(f"stop called to plate below {REST_VELOCITY:g} rad/s", rested))
    print(line("stop called to 'ready' (drive off, confirmed by the rig)", confirmed))
    for name in (
        "drift of the rig's clock [ppm]",
        "half of the shortest round trip [ms]",
        "samples lost on the way",
    ):
        print(f"{name}: {operator.figures.get(name)}")
    print(
        f"samples missing at this reader: {operator.continuity.missing}; load of the machine: "
        f"{os.getloadavg()[0]:.1f}"
    )
    return 0


if __name__ == "__main__":
    sys.exit(main())
