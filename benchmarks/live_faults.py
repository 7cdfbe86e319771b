"""Faults of whole processes at random moments of a running rig: what was promised, what happened.

    .venv/bin/python benchmarks/live_faults.py --times 4 --seed 1     about 10 minutes
    .venv/bin/python benchmarks/live_faults.py --times 1 --only recorder

The graph `rig` runs with its emulator, with an operator's page that is alive. Each node in turn is
killed (SIGKILL) and started again, or stopped (SIGSTOP) and let go on (SIGCONT); the recorder's
disk is full from one moment to the next; its bag is cut at random places, as a power cut leaves it.
The moment to rest is read from the emulated rig's own log: the drive is off. The command writes the
section "Live" of docs/reliability.md, and ends with 1 where a promise was broken.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import json
import os
import re
import resource
import shutil
import signal
import sys
import tempfile
import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import aiohttp
import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from ankle_bringup.browser_pages import free_port, wait_until_served
from ankle_bringup.graph import Graph, load_graph
from ankle_bringup.live_graph import observer
from ankle_bringup.processes import Processes
from ankle_interfaces.block import unpack
from ankle_interfaces.topics import ANKLE_SAMPLES, DIAGNOSTICS, RIG_STATE
from ankle_node.domain import take_free_domain
from ankle_node.qos import LATEST_QOS, reader_qos
from ankle_node.real_time import RECORDER_PRIORITY, take_priority
from biofeedback.web.server import SEEN
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError

PAGE = Path(__file__).resolve().parents[1] / "docs" / "reliability.md"
TITLE = "\n## Live"
RATE = 2048.0
SAMPLES = f"/{ANKLE_SAMPLES.name}"
DRIVER, GENERATOR, RIG = "ankle_actuator_driver", "perturbation_generator", "rig_emulator"
PAGES, RECORDER = "biofeedback", "record"
HEARTBEATS = "heartbeats"
KEPT = (RECORDER, PAGES, DRIVER, GENERATOR, RIG)
NEXT = {"fault": "reset_fault", "ready": "arm", "armed": "start"}
PATIENCE = 90.0  # s; to be running again: DDS lists a killed node for up to 20 s
SETTLED = 1.5  # s of running before a fault: beyond the soft start
LONGEST_START = 20.0  # s; for a new process to say anything
NOTICED = 1.5  # s after a fault has ended until the state is read
COUNTED = 2.5  # s: two reports of every node's health
LARGEST_ANGLE, LARGEST_VELOCITY = 0.175 + 0.02, 1.1 * 5.0  # rad, rad/s: limit and overshoot
LAST_SECONDS = 2.5  # s of a bag that the recorder may have had in memory when it was killed
CUTS = 20  # places at which a bag is cut
REST = re.compile(r"\[(\d+\.\d+)\] \[rig_emulator\]: (\w+), fault")


@dataclass(frozen=True)
class Fault:
    """One fault.

    Attributes
    ----------
    name
        For the table.
    promise
        ``goes on``, ``stops`` (ready) or ``faults`` (a reset is needed).
    node
        Whose process it is.
    begin, end
        What is done to it.
    lasts
        [s]
    """

    name: str
    promise: str
    node: str
    begin: Callable[[Bench, str], None]
    end: Callable[[Bench, str], None]
    lasts: float


class Operator:
    """Hears the rig in a thread of its own, and calls the driver's services."""

    def __init__(self, node: rclpy.node.Node) -> None:
        self.state, self.states, self.figures = "", [], {}
        self.blocks: list[np.ndarray] = []
        node.create_subscription(
            Float64MultiArray, ANKLE_SAMPLES.name, self._hear, reader_qos(ANKLE_SAMPLES), raw=True
        )
        node.create_subscription(String, RIG_STATE.name, self._follow, LATEST_QOS)
        node.create_subscription(DiagnosticArray, DIAGNOSTICS.name, self._diagnose, 50)
        self._clients = {
            name: node.create_client(Trigger, f"{DRIVER}/{name}")
            for name in (*NEXT.values(), "stop")
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
        """Call a service; whether it was carried out."""
        future = self._clients[name].call_async(Trigger.Request())
        end = time.monotonic() + patience
        while not future.done() and time.monotonic() < end:
            time.sleep(0.005)
        return future.done() and future.result().success

    def until_running(self) -> float:
        """Reset, arm and start; seconds until the rig runs, NaN where it does not."""
        began = time.monotonic()
        while self.state != "running":
            if time.monotonic() - began > PATIENCE:
                return np.nan
            if self.state in NEXT:
                self.call(NEXT[self.state])
            time.sleep(0.02)
        return time.monotonic() - began

    def times(self) -> np.ndarray:
        """Times of the samples heard [s]."""
        return np.concatenate([block[:, 0] for block in self.blocks])


class OperatorPage:
    """An operator's page without a browser: it opens again whenever the node closes it."""

    def __init__(self, url: str) -> None:
        self._url = url
        threading.Thread(target=lambda: asyncio.run(self._live()), daemon=True).start()

    async def _live(self) -> None:
        while True:
            with contextlib.suppress(aiohttp.ClientError, OSError):
                async with (
                    aiohttp.ClientSession() as session,
                    session.ws_connect(f"{self._url}/ws?role=operator", max_msg_size=0) as page,
                ):
                    async for message in page:
                        if json.loads(message.data)["type"] == "frame":
                            await page.send_str(SEEN)
            await asyncio.sleep(0.2)


@dataclass
class Bench:
    """The running laboratory."""

    processes: Processes
    operator: Operator
    folder: Path
    bags: int = 0

    def pid(self, node: str) -> int:
        """Process id of a node, or of the driver's process of heartbeats."""
        if node != HEARTBEATS:
            return self.processes.pids[node]
        return next(
            child
            for child in children(self.processes.pids[DRIVER])
            if b"heartbeat_process" in Path(f"/proc/{child}/cmdline").read_bytes()
        )

    def rested(self, since: float) -> float:
        """Seconds from a time until the emulated rig's drive was off; NaN where it was not."""
        found = REST.findall(self.processes.log(RIG).read_text(errors="replace"))
        off = [float(at) for at, state in found if state in ("off", "fault") and float(at) > since]
        return off[0] - since if off else np.nan


def children(parent: int) -> list[int]:
    """Process ids of a process' children."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            if int(entry.read_text().rpartition(")")[2].split()[1]) == parent:
                found.append(int(entry.parent.name))
    return found


def kill(bench: Bench, node: str) -> None:
    """SIGKILL."""
    os.kill(bench.pid(node), signal.SIGKILL)


def hold(bench: Bench, node: str) -> None:
    """SIGSTOP."""
    os.kill(bench.pid(node), signal.SIGSTOP)


def let_go(bench: Bench, node: str) -> None:
    """SIGCONT."""
    os.kill(bench.pid(node), signal.SIGCONT)


def fill_disk(bench: Bench, node: str) -> None:
    """From now on no file of the process may grow, as on a full disk."""
    written = max(path.stat().st_size for path in bag_of(bench).glob("*.mcap"))
    resource.prlimit(bench.pid(node), resource.RLIMIT_FSIZE, (written, written))


def start_again(bench: Bench, node: str) -> None:
    """A new process of the node; a recorder records into a new bag."""
    if node == RECORDER:
        bench.bags += 1
        bench.processes.restart(node, out=str(bag_of(bench)))
    else:
        bench.processes.restart(node)


def nothing(bench: Bench, node: str) -> None:
    """The driver starts another process by itself."""


def bag_of(bench: Bench) -> Path:
    """The present bag."""
    return bench.folder / f"bag{bench.bags}"


def _both(node: str, word: str, promise: str, lasts: float) -> tuple[Fault, Fault]:
    return (
        Fault(f"{word} stopped for {lasts:g} s", promise, node, hold, let_go, lasts),
        Fault(f"{word} killed and started again", promise, node, kill, start_again, 0.5),
    )


FAULTS = (
    *_both(DRIVER, "driver", "faults", 1.5),
    Fault("process of heartbeats stopped for 1.5 s", "faults", HEARTBEATS, hold, let_go, 1.5),
    Fault("process of heartbeats killed", "faults", HEARTBEATS, kill, nothing, 0.5),
    Fault("generator stopped for 2.5 s", "stops", GENERATOR, hold, let_go, 2.5),
    Fault("generator killed and started again", "stops", GENERATOR, kill, start_again, 1.5),
    *_both(RIG, "rig", "faults", 1.5),
    *_both(PAGES, "pages (operator's end)", "stops", 4.0),
    Fault("recorder stopped for 1.5 s", "goes on", RECORDER, hold, let_go, 1.5),
    Fault("recorder killed and started again", "goes on", RECORDER, kill, start_again, 0.5),
    Fault("recorder's disk full", "goes on", RECORDER, fill_disk, start_again, 3.0),
)


@dataclass
class Outcome:
    """Of all cases of one fault."""

    states: list[str] = field(default_factory=list)
    rest: list[float] = field(default_factory=list)
    again: list[float] = field(default_factory=list)
    lost: int = 0
    reported: int = 0
    beyond: int = 0
    cuts: int = 0
    broken: list[str] = field(default_factory=list)


def one_case(bench: Bench, fault: Fault, random: np.random.Generator, out: Outcome) -> None:
    """One fault at a random moment of a running plate."""
    operator = bench.operator
    while True:
        if np.isnan(operator.until_running()):
            raise SystemExit(f"the rig does not run; states: {operator.states[-4:]}")
        time.sleep(SETTLED + float(random.uniform(0.0, 0.6)))
        if operator.state == "running":
            break
    operator.blocks = operator.blocks[-20:]
    since, first = time.time() - 0.2, len(operator.states)
    before = reported_by(operator)
    bag, at = bag_of(bench), time.time()
    fault.begin(bench, fault.node)
    time.sleep(fault.lasts)
    fault.end(bench, fault.node)
    time.sleep(NOTICED)
    deadline = time.monotonic() + LONGEST_START
    while fault.promise != "goes on" and len(operator.states) == first:
        if time.monotonic() > deadline:
            break
        time.sleep(0.05)
    entered = [state for _, state, _ in operator.states[first:]]
    state = "fault" if "fault" in entered else operator.state
    out.states.append(state)
    out.rest.append(bench.rested(at) if fault.promise != "goes on" else np.nan)
    out.again.append(operator.until_running())
    time.sleep(COUNTED)
    data = np.concatenate(operator.blocks)
    out.beyond += bool(
        np.abs(data[:, 1]).max() > LARGEST_ANGLE or np.abs(data[:, 2]).max() > LARGEST_VELOCITY
    )
    keeps = {"goes on": ("running",), "stops": ("ready", "stopping", "fault"), "faults": ("fault",)}
    if state not in keeps[fault.promise]:
        out.broken.append(f"was {state}: {operator.states[first:]}")
    if np.isnan(out.again[-1]):
        out.broken.append("not running again")
    if fault.promise != "goes on" and fault.node != RIG and np.isnan(out.rest[-1]):
        out.broken.append("the drive was not off")
    if bag != bag_of(bench):
        look_at_the_bag(bag, since, at, operator, random, out)
        return
    reported = reported_by(operator) - before
    lost = missing(times_in(bag) if fault.node == RECORDER else operator.times(), since)
    out.lost, out.reported = out.lost + lost, out.reported + reported
    if lost != reported:
        out.broken.append(f"{lost} samples lost, {reported} reported")


def missing(times: np.ndarray, since: float) -> int:
    """Samples missing between times [s] later than a ROS time."""
    gaps = np.round(np.diff(times[times > since]) * RATE).astype(int) - 1
    return int(gaps[gaps > 0].sum())


def reported_by(operator: Operator) -> int:
    """Missing samples of the ankle that the recorder states."""
    return int(operator.figures.get(RECORDER, {}).get(f"{SAMPLES} missing samples", "0"))


def look_at_the_bag(
    bag: Path,
    since: float,
    at: float,
    operator: Operator,
    random: np.random.Generator,
    out: Outcome,
) -> None:
    """Compare the bag of a recorder that has ended with what another reader heard, and cut it."""
    times = times_in(bag)
    if at - times[-1] > LAST_SECONDS:
        out.broken.append(f"the bag ends {at - times[-1]:.1f} s before the recorder")
    if BagReader(bag).complete:
        out.broken.append("a bag without its end calls itself complete")
    heard = operator.times()
    heard = heard[(heard > since) & (heard <= times[-1])]
    if not np.array_equal(heard, times[times > since]):
        out.broken.append("the bag has not what was heard until its end")
    for share in random.uniform(0.0, 1.0, CUTS):
        out.cuts += 1
        if problem := cut(bag, float(share), times):
            out.broken.append(f"cut at {share:.3f}: {problem}")


def times_in(bag: Path) -> np.ndarray:
    """Times of the ankle's samples in a bag [s]."""
    return np.concatenate([block.time for block in BagReader(bag).blocks(SAMPLES)])


def cut(bag: Path, share: float, times: np.ndarray) -> str:
    """Cut a copy of a bag; what is wrong with what is left, empty where nothing is."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / bag.name
        shutil.copytree(bag, copy)
        for part in copy.glob("*.mcap"):
            os.truncate(part, int(share * part.stat().st_size))
        try:
            left = [block.time for block in BagReader(copy).blocks(SAMPLES)]
        except BagError:
            return ""  # it says so
        kept = np.concatenate(left) if left else np.zeros(0)
        same = np.array_equal(kept, times[: len(kept)])
        return "" if same else "the samples that are left are not those that were written"


def row(fault: Fault, out: Outcome) -> str:
    """Of the table."""
    states = ", ".join(f"{state} {out.states.count(state)}" for state in dict.fromkeys(out.states))
    rest = [value for value in out.rest if np.isfinite(value)]
    again = [value for value in out.again if np.isfinite(value) and value > 0.01]
    return (
        f"| {fault.name} | {fault.promise} | {states} | {out.beyond} | {out.lost} | "
        f"{out.reported} | {f'{1e3 * max(rest):.0f}' if rest else '—'} | "
        f"{f'{np.median(again):.1f}' if again else '0'} |"
    )


def session_graph(folder: Path, port: int) -> Graph:
    """The graph `rig` without the estimator, and with its emulator."""
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
    return Graph(graph.description, tuple(node for node in graph.nodes if node.name in KEPT))


def write_section(rows: list[str], closing: str, cases: int, seed: int) -> None:
    """Replace the section of the page."""
    old = PAGE.read_text()
    old = old[: old.index(TITLE)] if TITLE in old else old
    table = PAGE.read_text()
    head = next(line for line in table.splitlines() if line.startswith("| fault |"))
    text = f"""{TITLE}: whole processes

Written by `python benchmarks/live_faults.py --times {cases // len(FAULTS)} --seed {seed}`: the
graph `rig` with its emulator as processes, {cases} cases, at a load of {os.getloadavg()[0]:.1f}.
The time to rest ends when the drive is off, by the rig's own log. Samples lost are gaps seen by a
reader that is no part of the graph; reported is what the recorder states. A node that is killed is
listed by DDS for up to 20 s; until then a second one counts as two generators.

{head}
|{" --- |" * (head.count("|") - 1)}
"""
    PAGE.write_text(old.rstrip("\n") + "\n" + text + "\n".join(rows) + "\n" + closing)


def main() -> int:
    """Run, print and write."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--times", type=int, default=4)
    options.add_argument("--only", default="")
    options.add_argument("--seed", type=int, default=1)
    given = options.parse_args()
    chosen = [fault for fault in FAULTS if given.only in fault.name]
    random = np.random.default_rng(given.seed)
    take_priority(RECORDER_PRIORITY)  # a reader that is late would lose what the graph has
    take_free_domain()
    port = free_port()
    rows, broken, cases, cuts = [], [], 0, 0
    with (
        tempfile.TemporaryDirectory() as name,
        observer("faults") as node,
        Processes(session_graph(Path(name), port), Path(name) / "logs") as processes,
    ):
        wait_until_served(port, processes)
        bench = Bench(processes, Operator(node), Path(name))
        OperatorPage(f"http://127.0.0.1:{port}")
        for fault in chosen:
            out = Outcome()
            for _ in range(given.times):
                one_case(bench, fault, random, out)
                cases += 1
                print(f"{cases} of {len(chosen) * given.times}", file=sys.stderr, flush=True)
            if out.broken or out.beyond:
                broken.append(f"{fault.name}: {out.broken or 'motion beyond a limit'}")
            cuts += out.cuts
            rows.append(row(fault, out))
            print(rows[-1], flush=True)
    verdict = f"{cases - len(broken)} of {cases}" if broken else f"all of {cases}"
    closing = (
        f"\nSurvived without motion beyond a limit and without unreported loss: {verdict}.\n"
        f"Bags cut at {cuts} random places: each reads as the beginning of what was written, or\n"
        "says why not.\n"
    )
    if not given.only:
        write_section(rows, closing, cases, given.seed)
    print(closing + "\n".join(broken))
    return int(bool(broken))


if __name__ == "__main__":
    raise SystemExit(main())
