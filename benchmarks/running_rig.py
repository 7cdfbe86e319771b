"""A rig that runs as processes, with an operator who never tires: what `live_faults` breaks."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import threading
import time
from dataclasses import dataclass
from pathlib import Path

import aiohttp
import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from ankle_bringup.graph import Graph, load_graph
from ankle_bringup.processes import Processes
from ankle_interfaces.block import unpack
from ankle_interfaces.topics import ANKLE_SAMPLES, DIAGNOSTICS, RIG_STATE
from ankle_node.qos import LATEST_QOS, reader_qos
from biofeedback.web.server import FRAME_ANSWER

DRIVER, GENERATOR, RIG = "ankle_actuator_driver", "perturbation_generator", "rig_emulator"
PAGES, RECORDER = "biofeedback", "record"
HEARTBEATS = "heartbeats"
KEPT_NODES = (RECORDER, PAGES, DRIVER, GENERATOR, RIG)
NEXT_COMMANDS = {"fault": "reset_fault", "ready": "arm", "armed": "start"}
PATIENCE = 90.0  # s; to be running again: DDS lists a killed node for up to 20 s
SETTLING_TIME = 1.5  # s of running before a fault: beyond the soft start
LONGEST_START = 20.0  # s; for a new process to say anything
LOOK_PERIOD = 0.05  # s
LEAST_BAG = 100_000  # bytes; of a bag that has samples: two seconds
LONGEST_FRAME = 0.5  # s; between two pictures of a page that is connected
STATE_LINE = re.compile(r"\[(\d+\.\d+)\] \[rig_emulator\]: (\w+), fault")


class NotRunningError(Exception):
    """Says that the plate does not run, so that no further fault can be tried."""


class Operator:
    """Hears the rig in a thread of its own, and calls the driver's services."""

    def __init__(self, node: rclpy.node.Node) -> None:
        self.state, self.states, self.figures = "", [], {}
        self.refusal = ""
        self.blocks: list[np.ndarray] = []
        node.create_subscription(
            Float64MultiArray, ANKLE_SAMPLES.name, self._hear, reader_qos(ANKLE_SAMPLES), raw=True
        )
        node.create_subscription(String, RIG_STATE.name, self._follow, LATEST_QOS)
        node.create_subscription(DiagnosticArray, DIAGNOSTICS.name, self._diagnose, 50)
        self._clients = {
            name: node.create_client(Trigger, f"{DRIVER}/{name}")
            for name in (*NEXT_COMMANDS.values(), "stop")
        }
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        threading.Thread(target=self._spin, args=(executor,), daemon=True).start()

    @staticmethod
    def _spin(executor: SingleThreadedExecutor) -> None:
        with contextlib.suppress(ExternalShutdownException):
            executor.spin()

    def _hear(self, message: bytes) -> None:
        self.blocks.append(unpack(message).data)

    def _follow(self, message: String) -> None:
        self.state, _, reason = message.data.partition(": ")
        self.states.append((time.time(), self.state, reason))

    def _diagnose(self, message: DiagnosticArray) -> None:
        for status in message.status:
            self.figures[status.name.strip("/")] = {
                entry.key: entry.value for entry in status.values
            }

    def call(self, name: str, patience: float = 3.0) -> bool:
        """Call a service; return whether it was carried out."""
        future = self._clients[name].call_async(Trigger.Request())
        end = time.monotonic() + patience
        while not future.done() and time.monotonic() < end:
            time.sleep(0.005)
        if not future.done():
            self.refusal = f"{name} was not answered within {patience:g} s"
            return False
        if not future.result().success:
            self.refusal = future.result().message
        return future.result().success

    def until_running(self) -> float:
        """Reset, arm and start; return the time until the rig runs [s], NaN where it does not."""
        began = time.monotonic()
        while self.state != "running":
            if time.monotonic() - began > PATIENCE:
                return np.nan
            if self.state in NEXT_COMMANDS:
                self.call(NEXT_COMMANDS[self.state])
            time.sleep(LOOK_PERIOD)
        return time.monotonic() - began

    def until_news(self, seen: int) -> None:
        """Wait until the driver has entered another state than the first `seen` ones."""
        deadline = time.monotonic() + LONGEST_START
        while len(self.states) == seen and time.monotonic() < deadline:
            time.sleep(LOOK_PERIOD)

    def times(self) -> np.ndarray:
        """Return the times of the samples that were heard [s]."""
        return np.concatenate([block[:, 0] for block in self.blocks])


class OperatorPage:
    """Acts as an operator's page without a browser, which opens again whenever it is closed."""

    def __init__(self, url: str) -> None:
        self._url, self._heard = url, -np.inf
        threading.Thread(target=lambda: asyncio.run(self._live()), daemon=True).start()

    @property
    def alive(self) -> bool:
        """Whether the page is connected and gets its pictures."""
        return time.monotonic() - self._heard < LONGEST_FRAME

    async def _live(self) -> None:
        while True:
            with contextlib.suppress(aiohttp.ClientError, OSError):
                async with (
                    aiohttp.ClientSession() as session,
                    session.ws_connect(f"{self._url}/ws?role=operator", max_msg_size=0) as page,
                ):
                    async for message in page:
                        if json.loads(message.data)["type"] == "frame":
                            self._heard = time.monotonic()
                            await page.send_str(FRAME_ANSWER)
            await asyncio.sleep(0.2)


@dataclass
class RunningRig:
    """Holds the processes of the rig, its operator and the bags that are recorded."""

    processes: Processes
    operator: Operator
    page: OperatorPage
    folder: Path
    bags: int = 0

    @property
    def bag(self) -> Path:
        """Return the bag that is recorded now."""
        return self.folder / f"bag{self.bags}"

    def pid(self, node: str) -> int:
        """Return the process id of a node, or of the driver's process of heartbeats."""
        if node != HEARTBEATS:
            return self.processes.pids[node]
        return next(
            child
            for child in children(self.processes.pids[DRIVER])
            if b"heartbeat_process" in Path(f"/proc/{child}/cmdline").read_bytes()
        )

    @property
    def complete(self) -> bool:
        """Whether an operator's page watches and the present bag has samples."""
        size = sum(path.stat().st_size for path in self.bag.glob("*.mcap"))
        return self.page.alive and size > LEAST_BAG

    def rested(self, since: float) -> float:
        """Return the time [s] from a moment until the emulated rig's drive was off.

        It is NaN where the drive was not off since then.
        """
        found = STATE_LINE.findall(self.processes.log(RIG).read_text(errors="replace"))
        off = [float(at) for at, state in found if state in ("off", "fault") and float(at) > since]
        return off[0] - since if off else np.nan

    def settle(self, random: np.random.Generator) -> None:
        """Wait until the plate has run for a while of random length, watched and recorded.

        Raises
        ------
        NotRunningError
            The plate does not run; names its states and the last refusal.
        """
        operator = self.operator
        while True:
            if np.isnan(operator.until_running()):
                raise NotRunningError(
                    f"the plate does not run; last states: {operator.states[-4:]}; last refusal: "
                    f"{operator.refusal}"
                )
            while not self.complete:  # a node that was started again takes a few seconds
                time.sleep(LOOK_PERIOD)
            time.sleep(SETTLING_TIME + float(random.uniform(0.0, 0.6)))
            if operator.state == "running" and self.complete:
                return


def children(parent: int) -> list[int]:
    """Return the process ids of a process' children."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            if int(entry.read_text().rpartition(")")[2].split()[1]) == parent:
                found.append(int(entry.parent.name))
    return found


def session_graph(folder: Path, port: int) -> Graph:
    """Return the graph `rig` without the estimator, and with its emulator."""
    graph = load_graph("rig").with_options(["emulator"])
    graph = graph.with_settings(
        [
            f"{DRIVER}.wait_for_readers=2",
            f"{GENERATOR}.wait_for_readers=2",
            f"{PAGES}.port={port}",
            f"{PAGES}.state_file={folder}/progress.json",
            f"{RECORDER}.out={folder}/bag0",
        ]
    )
    return Graph(graph.description, tuple(node for node in graph.nodes if node.name in KEPT_NODES))
