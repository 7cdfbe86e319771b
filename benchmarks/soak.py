"""A long session on the emulated rig: what is lost, what grows, what stops without being asked.

    make soak                 two hours
    make soak MINUTES=10      a short one
    .venv/bin/python benchmarks/soak.py --minutes 3 --busy 2     beside two processes that compute
    .venv/bin/python benchmarks/soak.py --minutes 3 --without-browser

The graph `rig` with its emulator over UDP, recorder and pages; EMG from a simulated amplifier over
Lab Streaming Layer, its bridge and its processor; both pages in Chromium; a page that commands the
session, and starts it again after every stop. Every half minute: samples received and missing,
memory and open files of each process, and the delay from a sample's own time to its arrival. At the
end the bag's own account of loss. A stop is unasked where its reason is not the operator. With
real-time priority a watch on each processor tells which of these stops followed a standstill of
this computer itself, as the host of a virtual machine makes them.
"""

from __future__ import annotations

import argparse
import contextlib
import multiprocessing
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import rclpy
from playwright.sync_api import Page, sync_playwright
from standstills import Standstills
from std_msgs.msg import Float64MultiArray, String
from stop_latency import Commander

from ankle_bringup.browser_pages import free_port, wait_until_served
from ankle_bringup.graph import Graph, load_graph
from ankle_bringup.live_graph import observer
from ankle_bringup.processes import Processes
from ankle_interfaces.block import unpack
from ankle_interfaces.continuity import Continuity
from ankle_interfaces.topics import ANKLE_SAMPLES, EMG_SAMPLES, RIG_STATE, Topic
from ankle_node.block_executor import BlockExecutor
from ankle_node.domain import take_free_domain
from ankle_node.qos import reader_qos
from ankle_node.real_time import RECORDER_PRIORITY, RIG_PRIORITY, take_priority
from biofeedback.web.system_browser import ARGUMENTS, NO_BROWSER, find_browser
from session_recorder.bag_reader import BagReader
from session_recorder.loss import account_of_bag

ROOT = Path(__file__).resolve().parents[1]
AMPLIFIER = ROOT / "src" / "emg_driver" / "test" / "amplifier.py"
STREAM = f"soak {os.getpid()}"
NODES_LEFT_OUT = ("impedance_estimator",)
EMG = ("emg_bridge", "emg_processor")
LOOK_PERIOD = 30.0  # s
COMMAND_PERIOD = 1.0  # s; between two commands of the page
LONGEST_START = 120.0  # s; for everything to run
NEXT_COMMANDS = {"idle": "arm", "paused": "arm", "armed": "start", "finished": "restart"}
STOP_REASON = "stopped by the operator"
PAGE = os.sysconf("SC_PAGE_SIZE")
STANDSTILL_BEFORE_STOP = 0.5  # s; a standstill this shortly before a stop is told with it
LARGEST_GROWTH = 1.0  # % of memory, from the middle to the end


class Reader:
    """Hears the rig and the EMG as a reader that is no part of the graph."""

    def __init__(self, node: rclpy.node.Node, standstills: Standstills) -> None:
        self.state, self.unasked, self.delays = "", [], []
        self.standstills = standstills
        self.samples = dict.fromkeys((ANKLE_SAMPLES, EMG_SAMPLES), 0)
        self.continuity = {topic: Continuity() for topic in self.samples}
        for topic in self.samples:
            node.create_subscription(
                Float64MultiArray,
                topic.name,
                lambda message, topic=topic: self._hear(topic, message),
                reader_qos(topic),
                raw=True,
            )
        node.create_subscription(String, RIG_STATE.name, self._follow, reader_qos(RIG_STATE))
        self._executor = BlockExecutor()
        self._executor.add_node(node)

    @property
    def missing(self) -> int:
        """Samples that are missing in all signals."""
        return sum(continuity.missing for continuity in self.continuity.values())

    def _hear(self, topic: Topic, message: bytes) -> None:
        block = unpack(message)
        self.continuity[topic].check(block.data)
        self.samples[topic] += len(block.data)
        if topic is ANKLE_SAMPLES:
            self.delays.append(time.time() - float(block.time[-1]))

    def _follow(self, message: String) -> None:
        state, _, reason = message.data.partition(": ")
        if self.state == "running" and state != "running" and reason != STOP_REASON:
            now = time.monotonic()
            before = self.standstills.longest_between(now - STANDSTILL_BEFORE_STOP, now)
            self.unasked.append(f"{reason}; before it: {before or 'no standstill'}")
        self.state = state

    def spin(self, seconds: float, commander: Commander) -> None:
        """Let time pass, and start session and rig again wherever they stopped."""
        end, next_command = time.monotonic() + seconds, 0.0
        while time.monotonic() < end:
            self._executor.spin_once(timeout_sec=0.02)
            wanted = "reset_fault" if self.state == "fault" else NEXT_COMMANDS.get(commander.state)
            if wanted and time.monotonic() > next_command:
                next_command = time.monotonic() + COMMAND_PERIOD
                commander.command(wanted)


def memory(pid: int) -> float:
    """Return the resident memory of a process [MB]."""
    return int(Path(f"/proc/{pid}/statm").read_text().split()[1]) * PAGE / 1e6


def open_files(pid: int) -> int:
    """Return the number of file handles of a process."""
    return len(list(Path(f"/proc/{pid}/fd").iterdir()))


def compute() -> None:
    """Use one core, in a session of its own, between which Linux shares the cores."""
    os.setsid()
    data = np.random.default_rng(1).normal(size=(200, 200))
    while True:
        np.linalg.svd(data)


def session_graph(folder: Path, port: int) -> Graph:
    """Return the graph `rig` with its emulator and EMG, without the estimator."""
    rig = load_graph("rig").with_options(["emulator"])
    emg = [node for node in load_graph("simulated_emg").nodes if node.name in EMG]
    nodes = [node for node in rig.nodes if node.name not in NODES_LEFT_OUT]
    graph = Graph(rig.description, (*nodes, *emg))
    return graph.with_settings(
        [
            "ankle_actuator_driver.wait_for_readers=2",
            "perturbation_generator.wait_for_readers=2",
            f"emg_bridge.stream_name={STREAM} good",
            f"biofeedback.port={port}",
            f"biofeedback.state_file={folder}/progress.json",
            f"record.out={folder}/bag",
        ]
    )


def look(reader: Reader, pids: dict[str, int], began: float) -> dict[str, tuple[float, int]]:
    """Print a line and return memory and open files of each process."""
    found = {name: (memory(pid), open_files(pid)) for name, pid in pids.items()}
    delay = 1e3 * np.array(reader.delays or [np.nan])
    reader.delays = []
    received = ", ".join(f"{topic.name} {count}" for topic, count in reader.samples.items())
    print(
        f"{(time.monotonic() - began) / 60:6.1f} min  {received} samples, {reader.missing} "
        f"missing, {len(reader.unasked)} unasked stops, delay median {np.median(delay):.1f} ms, "
        f"worst {delay.max():.0f} ms; "
        + ", ".join(f"{name} {size:.1f} MB {files} files" for name, (size, files) in found.items()),
        flush=True,
    )
    return found


def report(reader: Reader, looks: list[dict[str, tuple[float, int]]], minutes: float) -> int:
    """Print what the session came to; return 0 where nothing was lost, grew or stopped unasked."""
    middle, last = looks[len(looks) // 2], looks[-1]
    growth = {name: 100.0 * (last[name][0] / middle[name][0] - 1.0) for name in last}
    opened = {name: last[name][1] - middle[name][1] for name in last}
    print(
        f"{minutes:g} minutes at a load of {os.getloadavg()[0]:.1f}: {reader.missing} samples "
        f"missing, {len(reader.unasked)} unasked stops"
    )
    print(f"  {reader.standstills}")
    for reason in reader.unasked:
        print(f"  unasked: {reason}")
    for name, percent in growth.items():
        print(f"  {name}: memory {percent:+.2f} % in the second half, {opened[name]:+d} open files")
    steady = max(growth.values()) < LARGEST_GROWTH and max(opened.values()) <= 0
    return int(not steady or reader.missing > 0 or bool(reader.unasked))


def report_bag(folder: Path) -> int:
    """Print the bag's own account of loss; return 0 where there is none."""
    account = account_of_bag(BagReader(folder / "bag"))
    print(f"the bag: {account.missing} samples missing, {account.missing_messages} messages lost")
    for sentence in account.sentences():
        print(f"  {sentence}")
    return int(account.missing > 0)


def run(
    minutes: float, pids: Callable[[], dict[str, int]], reader: Reader, commander: Commander
) -> int:
    """Run the session itself."""
    end = time.monotonic() + LONGEST_START
    while reader.state != "running" or not reader.samples[EMG_SAMPLES]:
        if time.monotonic() > end:
            raise SystemExit(
                f"nothing runs: rig {reader.state}, session {commander.state}, samples "
                f"{reader.samples}; last refusal: {commander.refusal}"
            )
        reader.spin(0.5, commander)
    reader.unasked.clear()
    began, looks = time.monotonic(), []
    while time.monotonic() - began < 60 * minutes:
        left = 60 * minutes - (time.monotonic() - began)
        reader.spin(min(LOOK_PERIOD, left), commander)
        looks.append(look(reader, pids(), began))
    return report(reader, looks, minutes)


@contextlib.contextmanager
def burden(count: int, minutes: float) -> Iterator[None]:
    """Run the amplifier, and so many processes that compute."""
    beside = [multiprocessing.Process(target=compute, daemon=True) for _ in range(count)]
    for process in beside:
        process.start()
    amplifier = subprocess.Popen(
        [sys.executable, AMPLIFIER, STREAM, str(60 * minutes + 2 * LONGEST_START), "good"],
        stdin=subprocess.PIPE,
        stdout=subprocess.DEVNULL,
    )
    with contextlib.suppress(PermissionError):
        # An amplifier is a device that does nothing else, as the emulated rig is.
        os.sched_setscheduler(amplifier.pid, os.SCHED_RR, os.sched_param(RIG_PRIORITY))
    try:
        yield
    finally:
        amplifier.kill()
        amplifier.wait()
        for process in beside:
            process.terminate()


@contextlib.contextmanager
def both_pages(url: str, wanted: bool) -> Iterator[list[Page]]:
    """Open the operator's and the subject's page in a browser, where that is wanted."""
    if not wanted:
        yield []
        return
    path = find_browser()
    if path is None:
        raise SystemExit(NO_BROWSER)
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        pages = [browser.new_page() for _ in range(2)]
        for page, where in zip(pages, ("/operator", "/"), strict=True):
            page.goto(url + where, timeout=1e3 * LONGEST_START)
        yield pages
        browser.close()


def main() -> int:
    """Run and print."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--minutes", type=float, default=120.0)
    options.add_argument("--busy", type=int, default=0, help="processes that compute beside it")
    options.add_argument("--without-browser", action="store_true", help="no pages in Chromium")
    given = options.parse_args()
    take_free_domain()
    port = free_port()
    standstills = Standstills()
    standstills.start()
    with tempfile.TemporaryDirectory() as name, burden(given.busy, given.minutes):
        folder = Path(name)
        with (
            observer("soak") as node,
            Processes(session_graph(folder, port), folder / "logs") as processes,
        ):
            wait_until_served(port, processes)
            url = f"http://127.0.0.1:{port}"
            with both_pages(url, not given.without_browser):
                take_priority(RECORDER_PRIORITY)  # a reader that is late would lose what is there
                reader, commander = Reader(node, standstills), Commander(url)
                failed = run(given.minutes, lambda: processes.pids, reader, commander)
        return max(failed, report_bag(folder))


if __name__ == "__main__":
    sys.exit(main())
