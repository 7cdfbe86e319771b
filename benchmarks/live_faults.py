"""Faults of whole processes at random moments of a running rig: what was promised, what happened.

    .venv/bin/python benchmarks/live_faults.py --times 4 --seed 1     about 10 minutes
    .venv/bin/python benchmarks/live_faults.py --times 1 --only recorder --logs FOLDER

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
from dataclasses import dataclass
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
from session_recorder.loss import account_of_bag

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src" / "ankle_actuator_driver" / "test"))
from fault_table import HEAD, Case, Outcome, verdict  # noqa: E402

PAGE = ROOT / "docs" / "reliability.md"
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
REPORTED = 10.0  # s; for the recorder to state what is missing: it reports once a second
LOOK = 0.05  # s
LEAST_BAG = 100_000  # bytes; of a bag that has samples: two seconds
LONGEST_FRAME = 0.5  # s; between two pictures of a page that is connected
LARGEST_ANGLE, LARGEST_VELOCITY = 0.175 + 0.02, 1.1 * 5.0  # rad, rad/s: limit and overshoot
LAST_SECONDS = 2.5  # s of a bag that the recorder may have had in memory when it was killed
CUTS = 20  # places at which a bag is cut
REST = re.compile(r"\[(\d+\.\d+)\] \[rig_emulator\]: (\w+), fault")


class NotRunningError(Exception):
    """Says that the plate does not run, so that no further fault can be tried."""


@dataclass(frozen=True)
class Fault:
    """A fault of a process, and what is promised for it.

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
        self.refusal = ""
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
            if self.state in NEXT:
                self.call(NEXT[self.state])
            time.sleep(LOOK)
        return time.monotonic() - began

    def until_news(self, seen: int) -> None:
        """Wait until the driver has entered another state than the first `seen` ones."""
        deadline = time.monotonic() + LONGEST_START
        while len(self.states) == seen and time.monotonic() < deadline:
            time.sleep(LOOK)

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
                            await page.send_str(SEEN)
            await asyncio.sleep(0.2)


@dataclass
class Bench:
    """Holds the running laboratory."""

    processes: Processes
    operator: Operator
    page: OperatorPage
    folder: Path
    bags: int = 0

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
        size = sum(path.stat().st_size for path in bag_of(self).glob("*.mcap"))
        return self.page.alive and size > LEAST_BAG

    def rested(self, since: float) -> float:
        """Return the time [s] from a moment until the emulated rig's drive was off.

        It is NaN where the drive was not off since then.
        """
        found = REST.findall(self.processes.log(RIG).read_text(errors="replace"))
        off = [float(at) for at, state in found if state in ("off", "fault") and float(at) > since]
        return off[0] - since if off else np.nan


def children(parent: int) -> list[int]:
    """Return the process ids of a process' children."""
    found = []
    for entry in Path("/proc").glob("[0-9]*/stat"):
        with contextlib.suppress(OSError):
            if int(entry.read_text().rpartition(")")[2].split()[1]) == parent:
                found.append(int(entry.parent.name))
    return found


def kill(bench: Bench, node: str) -> None:
    """Kill a process (SIGKILL)."""
    os.kill(bench.pid(node), signal.SIGKILL)


def hold(bench: Bench, node: str) -> None:
    """Stop a process (SIGSTOP)."""
    os.kill(bench.pid(node), signal.SIGSTOP)


def let_go(bench: Bench, node: str) -> None:
    """Let a process go on (SIGCONT)."""
    os.kill(bench.pid(node), signal.SIGCONT)


def fill_disk(bench: Bench, node: str) -> None:
    """Let no file of the process grow any more, as on a full disk."""
    written = max(path.stat().st_size for path in bag_of(bench).glob("*.mcap"))
    resource.prlimit(bench.pid(node), resource.RLIMIT_FSIZE, (written, written))


def start_again(bench: Bench, node: str) -> None:
    """Start a new process of the node; a recorder records into a new bag."""
    if node == RECORDER:
        bench.bags += 1
        bench.processes.restart(node, out=str(bag_of(bench)))
    else:
        bench.processes.restart(node)


def nothing(bench: Bench, node: str) -> None:
    """Do nothing: the driver starts another process by itself."""


def bag_of(bench: Bench) -> Path:
    """Return the bag that is recorded now."""
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


def one_case(bench: Bench, fault: Fault, random: np.random.Generator) -> Case:
    """Let one fault happen at a random moment of a running plate."""
    operator = bench.operator
    settle(bench, random)
    operator.blocks = operator.blocks[-20:]
    since, first, before = time.time() - 0.2, len(operator.states), reported_by(operator)
    bag, at = bag_of(bench), time.time()
    fault.begin(bench, fault.node)
    time.sleep(fault.lasts)
    fault.end(bench, fault.node)
    time.sleep(NOTICED)
    if fault.promise != "goes on":
        operator.until_news(first)
    entered = [state for _, state, _ in operator.states[first:]]
    case = Case("fault" if "fault" in entered else operator.state, str(operator.states[first:]))
    if fault.promise != "goes on":
        case.rest = bench.rested(at)
        if fault.node != RIG and np.isnan(case.rest):
            case.problems.append("the drive was not off")
    case.again = operator.until_running()
    if bag == bag_of(bench):
        count_samples(bench, since, before, case)
    else:
        look_at_the_bag(bag, since, at, operator, case)
        case.problems += wrong_when_cut(bag, random)
    data = np.concatenate(operator.blocks)
    case.beyond = bool(
        np.abs(data[:, 1]).max() > LARGEST_ANGLE or np.abs(data[:, 2]).max() > LARGEST_VELOCITY
    )
    return case


def settle(bench: Bench, random: np.random.Generator) -> None:
    """Wait until the plate has run for a while of random length, watched and recorded.

    Raises
    ------
    NotRunningError
        The plate does not run; names its states and the last refusal.
    """
    operator = bench.operator
    while True:
        if np.isnan(operator.until_running()):
            raise NotRunningError(
                f"the plate does not run; last states: {operator.states[-4:]}; last refusal: "
                f"{operator.refusal}"
            )
        while not bench.complete:  # a node that was started again takes a few seconds
            time.sleep(LOOK)
        time.sleep(SETTLED + float(random.uniform(0.0, 0.6)))
        if operator.state == "running" and bench.complete:
            return


def count_samples(bench: Bench, since: float, before: int, case: Case) -> None:
    """Compare the samples that the bag lacks with what the recorder states, once it had the time.

    What another reader lacks is its own: a rig that was held up sends more blocks at once than a
    reader's queue has room for.
    """
    deadline = time.monotonic() + REPORTED
    while True:
        case.lost = missing(times_in(bag_of(bench)), since)
        case.reported = reported_by(bench.operator) - before
        if case.lost == case.reported or time.monotonic() > deadline:
            return
        time.sleep(1.0)


def missing(times: np.ndarray, since: float) -> int:
    """Return how many samples are missing between times [s] later than a ROS time."""
    gaps = np.round(np.diff(times[times > since]) * RATE).astype(int) - 1
    return int(gaps[gaps > 0].sum())


def reported_by(operator: Operator) -> int:
    """Return how many samples of the ankle the recorder states as missing."""
    return int(operator.figures.get(RECORDER, {}).get(f"{SAMPLES} missing samples", "0"))


def look_at_the_bag(bag: Path, since: float, at: float, operator: Operator, case: Case) -> None:
    """Compare the bag of a recorder that has ended with what another reader heard."""
    reader, times = BagReader(bag), times_in(bag)
    if at - times[-1] > LAST_SECONDS:
        case.problems.append(f"the bag ends {at - times[-1]:.1f} s before the recorder")
    if reader.complete:
        case.problems.append("a bag without its end calls itself complete")
    heard = operator.times()
    heard = heard[(heard > since) & (heard <= times[-1])]
    case.lost = missing(times, since) + len(np.setdiff1d(heard, times))
    gaps = account_of_bag(reader).topics[SAMPLES].lasting_gaps
    case.reported = sum(gap.missing for gap in gaps if gap.start > since)


def wrong_when_cut(bag: Path, random: np.random.Generator) -> list[str]:
    """Return what is wrong with copies of a bag that are cut at random places."""
    times = times_in(bag)
    shares = random.uniform(0.0, 1.0, CUTS)
    found = [(share, cut(bag, float(share), times)) for share in shares]
    return [f"cut at {share:.3f}: {problem}" for share, problem in found if problem]


def times_in(bag: Path) -> np.ndarray:
    """Return the times of the ankle's samples in a bag [s]."""
    return np.concatenate([block.time for block in BagReader(bag).blocks(SAMPLES)])


def cut(bag: Path, share: float, times: np.ndarray) -> str:
    """Cut a copy of a bag; return what is wrong with what is left, empty where nothing is."""
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
    return Graph(graph.description, tuple(node for node in graph.nodes if node.name in KEPT))


def write_section(outcomes: list[Outcome], closing: str, given: argparse.Namespace) -> None:
    """Replace the section of the page."""
    old = PAGE.read_text()
    old = old[: old.index(TITLE)] if TITLE in old else old
    cases = sum(len(outcome.cases) for outcome in outcomes)
    text = f"""{TITLE}: whole processes

Written by `python benchmarks/live_faults.py --times {given.times} --seed {given.seed}`: the
graph `rig` with its emulator as processes, {cases} cases, at a load of {os.getloadavg()[0]:.1f}.
The time to rest ends when the drive is off, by the rig's own log. Samples lost are gaps between
the times in the bag, and for a recorder that has ended what another reader heard meanwhile and its
bag lacks; reported is what the recorder states while it runs, or the account of that bag. The last
{LAST_SECONDS:g} s before a recorder was killed may lack in its bag, which then says that it has no
end. A node that is killed is listed by DDS for up to 20 s; until then a second one counts as two
generators.

{HEAD}
"""
    rows = "\n".join(outcome.row() for outcome in outcomes)
    PAGE.write_text(f"{old.rstrip()}\n{text}{rows}\n{closing}")


def arguments() -> argparse.Namespace:
    """Return what the command line asks for."""
    options = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    options.add_argument("--times", type=int, default=4, help="cases of each fault")
    options.add_argument("--only", default="", help="faults with these words in their name")
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--logs", help="keep logs and bags in this new folder")
    return options.parse_args()


def run_all(bench: Bench, given: argparse.Namespace) -> list[Outcome]:
    """Run the chosen faults; a plate that does not run any more ends them."""
    chosen = [fault for fault in FAULTS if given.only in fault.name]
    random = np.random.default_rng(given.seed)
    outcomes: list[Outcome] = []
    for fault in chosen:
        outcomes.append(Outcome(fault.name, fault.promise))
        for _ in range(given.times):
            try:
                outcomes[-1].cases.append(one_case(bench, fault, random))
            except NotRunningError as error:
                lost_case = Case(bench.operator.state, again=np.nan, problems=[str(error)])
                outcomes[-1].cases.append(lost_case)
                return outcomes
            done = sum(len(outcome.cases) for outcome in outcomes)
            print(f"{done} of {len(chosen) * given.times}", file=sys.stderr, flush=True)
        print(outcomes[-1].row(), flush=True)
    return outcomes


def main() -> int:
    """Run the faults, print the table and write it into the page."""
    given = arguments()
    take_priority(RECORDER_PRIORITY)  # a reader that is late would lose what the graph has
    take_free_domain()
    port = free_port()
    with tempfile.TemporaryDirectory() as name, observer("faults") as node:
        folder = Path(given.logs or name)
        folder.mkdir(parents=True, exist_ok=True)
        with Processes(session_graph(folder, port), folder / "logs") as processes:
            wait_until_served(port, processes)
            page = OperatorPage(f"http://127.0.0.1:{port}")
            bench = Bench(processes, Operator(node), page, folder)
            outcomes = run_all(bench, given)
    closing = (
        f"\n{verdict(outcomes)}\n"
        f"Bags were cut at {CUTS * bench.bags} random places: a cut bag reads as the beginning of\n"
        "what was written, or says why not.\n"
    )
    if not given.only:
        write_section(outcomes, closing, given)
    broken = [sentence for outcome in outcomes for sentence in outcome.broken()]
    print(closing + "\n".join(broken))
    return int(bool(broken))


if __name__ == "__main__":
    raise SystemExit(main())
