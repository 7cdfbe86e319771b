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
import os
import resource
import signal
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from bag_losses import CUTS, SAMPLES, missing, times_in, wrong_when_cut
from running_rig import (
    DRIVER,
    GENERATOR,
    HEARTBEATS,
    PAGES,
    RECORDER,
    RIG,
    NotRunningError,
    Operator,
    OperatorPage,
    RunningRig,
    session_graph,
)

from ankle_bringup.browser_pages import free_port, wait_until_served
from ankle_bringup.live_graph import observer
from ankle_bringup.processes import Processes
from ankle_node.domain import take_free_domain
from ankle_node.real_time import RECORDER_PRIORITY, take_priority
from session_recorder.bag_reader import BagReader
from session_recorder.loss import account_of_bag

ROOT = Path(__file__).resolve().parents[1]
sys.path.insert(0, str(ROOT / "src" / "ankle_actuator_driver" / "test"))
from fault_table import HEAD, Case, Outcome, verdict  # noqa: E402

PAGE = ROOT / "docs" / "reliability.md"
TITLE = "\n## Live"
NOTICE_TIME = 1.5  # s after a fault has ended until the state is read
REPORT_TIME = 10.0  # s; for the recorder to state what is missing: it reports once a second
LARGEST_ANGLE, LARGEST_VELOCITY = 0.175 + 0.02, 1.1 * 5.0  # rad, rad/s: limit and overshoot
LAST_SECONDS = 2.5  # s of a bag that the recorder may have had in memory when it was killed


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
    begin: Callable[[RunningRig, str], None]
    end: Callable[[RunningRig, str], None]
    lasts: float


def kill(rig: RunningRig, node: str) -> None:
    """Kill a process (SIGKILL)."""
    os.kill(rig.pid(node), signal.SIGKILL)


def hold(rig: RunningRig, node: str) -> None:
    """Stop a process (SIGSTOP)."""
    os.kill(rig.pid(node), signal.SIGSTOP)


def let_go(rig: RunningRig, node: str) -> None:
    """Let a process go on (SIGCONT)."""
    os.kill(rig.pid(node), signal.SIGCONT)


def fill_disk(rig: RunningRig, node: str) -> None:
    """Let no file of the process grow any more, as on a full disk."""
    written = max(path.stat().st_size for path in rig.bag.glob("*.mcap"))
    resource.prlimit(rig.pid(node), resource.RLIMIT_FSIZE, (written, written))


def start_again(rig: RunningRig, node: str) -> None:
    """Start a new process of the node; a recorder records into a new bag."""
    if node == RECORDER:
        rig.bags += 1
        rig.processes.restart(node, out=str(rig.bag))
    else:
        rig.processes.restart(node)


def nothing(rig: RunningRig, node: str) -> None:
    """Do nothing: the driver starts another process by itself."""


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


def one_case(rig: RunningRig, fault: Fault, random: np.random.Generator) -> Case:
    """Let one fault happen at a random moment of a running plate."""
    operator = rig.operator
    rig.settle(random)
    operator.blocks = operator.blocks[-20:]
    since, first, before = time.time() - 0.2, len(operator.states), reported_by(operator)
    bag, at = rig.bag, time.time()
    fault.begin(rig, fault.node)
    time.sleep(fault.lasts)
    fault.end(rig, fault.node)
    time.sleep(NOTICE_TIME)
    if fault.promise != "goes on":
        operator.until_news(first)
    entered = [state for _, state, _ in operator.states[first:]]
    case = Case("fault" if "fault" in entered else operator.state, str(operator.states[first:]))
    if fault.promise != "goes on":
        case.rest = rig.rested(at)
        if fault.node != RIG and np.isnan(case.rest):
            case.problems.append("the drive was not off")
    case.again = operator.until_running()
    if bag == rig.bag:
        count_samples(rig, since, before, case)
    else:
        look_at_the_bag(bag, since, at, operator, case)
        case.problems += wrong_when_cut(bag, random)
    data = np.concatenate(operator.blocks)
    case.beyond = bool(
        np.abs(data[:, 1]).max() > LARGEST_ANGLE or np.abs(data[:, 2]).max() > LARGEST_VELOCITY
    )
    return case


def count_samples(rig: RunningRig, since: float, before: int, case: Case) -> None:
    """Compare the samples that the bag lacks with what the recorder states, once it had the time.

    What another reader lacks is its own: a rig that was held up sends more blocks at once than a
    reader's queue has room for.
    """
    deadline = time.monotonic() + REPORT_TIME
    while True:
        case.lost = missing(times_in(rig.bag), since)
        case.reported = reported_by(rig.operator) - before
        if case.lost == case.reported or time.monotonic() > deadline:
            return
        time.sleep(1.0)


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


def write_section(outcomes: list[Outcome], closing: str, given: argparse.Namespace) -> None:
    """Replace the section of the page."""
    old = PAGE.read_text()
    old = old[: old.index(TITLE)] if TITLE in old else old
    cases = sum(len(outcome.cases) for outcome in outcomes)
    text = f"""{TITLE}: whole processes

Written by `.venv/bin/python benchmarks/live_faults.py --times {given.times} --seed {given.seed}`:
the graph `rig` with its emulator as processes, {cases} cases, load {os.getloadavg()[0]:.1f}.
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


def run_all(rig: RunningRig, given: argparse.Namespace) -> list[Outcome]:
    """Run the chosen faults; a plate that does not run any more ends them."""
    chosen = [fault for fault in FAULTS if given.only in fault.name]
    random = np.random.default_rng(given.seed)
    outcomes: list[Outcome] = []
    for fault in chosen:
        outcomes.append(Outcome(fault.name, fault.promise))
        for _ in range(given.times):
            try:
                outcomes[-1].cases.append(one_case(rig, fault, random))
            except NotRunningError as error:
                lost_case = Case(rig.operator.state, again=np.nan, problems=[str(error)])
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
            rig = RunningRig(processes, Operator(node), page, folder)
            outcomes = run_all(rig, given)
    closing = (
        f"\n{verdict(outcomes)}\n"
        f"Bags were cut at {CUTS * rig.bags} random places: a cut bag reads as the beginning of\n"
        "what was written, or says why not.\n"
    )
    if not given.only:
        write_section(outcomes, closing, given)
    broken = [sentence for outcome in outcomes for sentence in outcome.broken()]
    print(closing + "\n".join(broken))
    return int(bool(broken))


if __name__ == "__main__":
    raise SystemExit(main())
