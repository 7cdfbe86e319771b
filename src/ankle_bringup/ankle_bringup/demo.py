"""The main job from beginning to end: run the laboratory, regenerate its estimates, do the same
with real ankles.
"""

from __future__ import annotations

import os
import time
from contextlib import closing
from dataclasses import dataclass, field
from importlib import resources
from pathlib import Path

from rich.console import Console
from rich.table import Table

from ankle_bringup import demo_pictures
from ankle_bringup.demo_calibration import show_calibration
from ankle_bringup.demo_session import hold_shares, run_session
from ankle_bringup.errors import RunError
from ankle_bringup.graph import load_graph
from ankle_bringup.live_graph import observer
from ankle_bringup.live_monitor import MONITORED, LiveMonitor, with_one_more_reader
from ankle_bringup.live_watch import watch
from ankle_bringup.processes import Processes
from ankle_bringup.regenerate import Agreement, agreement, regenerate_by_replay
from ankle_bringup.up import status_table
from ankle_interfaces.topics import ANKLE_SAMPLES, ANKLE_TRUTH, IMPEDANCE_ESTIMATE
from ankle_node.domain import VARIABLE, take_free_domain
from impedance_estimator.algorithms.conceptual_experimental import ConceptualExperimental
from impedance_estimator.offline.recorded_estimates import estimate_bag
from impedance_estimator.stream import compile_estimator
from session_recorder.bag_reader import BagReader
from session_recorder.importing import import_recording

TOLERANCE = 1e-9
TRIALS_SHOWN = 2  # a third shows nothing new and takes half a minute more
MEANINGS = {
    "K[N.m/rad]": "stiffness",
    "B[N.m.s/rad]": "viscosity",
    "I[kg.m^2]": "inertia of foot and footplate",
    "G[N.m.s/rad]": "reflex gain",
    "vaf_intrinsic[%]": "share of the torque that the intrinsic part explains",
    "vaf_total[%]": "share that intrinsic part and reflex explain together",
}


@dataclass
class Result:
    """Holds what the demo found, for its last tables."""

    rows: list[tuple[str, str, str]] = field(default_factory=list)
    trials: dict[str, dict[str, float]] = field(default_factory=dict)
    passed: bool = True

    def add(self, what: str, value: str, meaning: str) -> None:
        """Add a line to the table."""
        self.rows.append((what, value, meaning))

    def require(self, passed: bool, what: str, value: str, meaning: str) -> None:
        """Add a line that must hold for the demo to succeed."""
        self.passed = self.passed and passed
        self.add(what, value if passed else f"{value} (NOT MET)", meaning)


def run_demo(out: Path, seconds: float, trials: Path, seed: int, console: Console) -> bool:
    """Run all steps and write everything below `out`.

    Parameters
    ----------
    out
        New folder for all results.
    seconds
        Length of the first live run [s].
    trials
        Folder of real trials.
    seed
        Draws the imperfect rig and the subject in it.
    console
        Where everything is shown.

    Returns
    -------
    bool
        Whether every line that must hold did.

    Raises
    ------
    RunError
        A node failed, or `out` exists already.
    """
    if out.exists() and any(out.iterdir()):
        raise RunError(f"{out} is not empty; give another folder with --out, or remove it")
    out.mkdir(parents=True, exist_ok=True)
    # A domain of its own, so that a running laboratory is not disturbed.
    if VARIABLE not in os.environ:
        take_free_domain()
    result = Result()
    bag = out / "simulated_session"
    console.rule("1  A simulated ankle, live")
    run_live(bag, seconds, out / "logs", result, console)
    console.rule("2  The same estimates, made again from the recorded bag")
    regenerate(bag, out, result, console)
    console.rule("3  Real human ankles")
    real_ankles(trials, out, result, console)
    console.rule("4  A simulated rig with faults, without and with calibration")
    imperfect_rig(out, seed, result, console)
    console.rule("5  A session: subject's screen, operator, recording, report")
    session(out, result, console)
    console.rule("6  What came out")
    summary(out, result, console)
    return result.passed


def run_live(bag: Path, seconds: float, logs: Path, result: Result, console: Console) -> None:
    """Run generator, simulated ankle, estimator and recorder at real time.

    They are four processes; K and G jump on the way.
    """
    scenario = resources.files("ankle_bringup") / "scenarios" / "jump.yaml"
    graph = load_graph("simulated_recorded").with_settings(
        [
            f"record.out={bag}",
            f"perturbation_generator.duration={seconds}",
            f"ankle_sim.scenario={scenario}",
        ]
    )
    graph = with_one_more_reader(graph, MONITORED)
    console.print(
        f"Four processes stream at 2048 Hz for {seconds:.0f} s: small pushes at the ankle, its "
        "torque, and the estimates.\n"
        "After 45 s the simulated stiffness K jumps from 50 to 150 and the reflex gain G from 5 "
        "to 15; watch the estimates follow.\n"
        "They are valid after 10 s and follow a jump within about a second. (The paper's own "
        "algorithm: 30 s, then 16 s in K and 8 s in G.)"
    )
    with console.status("compiling the estimator (once after installing; one to two minutes)"):
        compile_estimator("simultaneous")
    with (
        observer("demo") as node,
        closing(LiveMonitor(node)) as monitor,
        Processes(graph, logs) as processes,
    ):
        watch(monitor, processes, seconds, lambda left: status_table(monitor, left), console)
    sent = round(seconds * 2048)
    recorded = len(BagReader(bag).signal(ANKLE_SAMPLES.absolute)[1])
    result.require(
        recorded == sent,
        "samples lost on the way to the bag",
        f"{sent - recorded} of {sent}",
        "none may be lost",
    )


def regenerate(bag: Path, out: Path, result: Result, console: Console) -> None:
    """Estimate again by replay and straight from the file; compare with the live run."""
    replayed_bag, file_bag = out / "replayed_estimates", out / "estimates_from_file"
    began = time.monotonic()
    with console.status(
        "Replaying the bag through a fresh estimator process, as fast as it follows ..."
    ):
        regenerate_by_replay(bag, replayed_bag, out / "logs" / "replay")
    console.print(
        f"Replayed through a fresh estimator process: {time.monotonic() - began:.1f} s, start of "
        "the processes included."
    )
    began = time.monotonic()
    with console.status("Estimating straight from the file ..."):
        estimate_bag(bag, file_bag)
    console.print(f"Estimated straight from the file: {time.monotonic() - began:.1f} s.")
    columns, live = BagReader(bag).signal(IMPEDANCE_ESTIMATE.absolute)
    _, replayed = BagReader(replayed_bag).signal(IMPEDANCE_ESTIMATE.absolute)
    _, from_file = BagReader(file_bag).signal(IMPEDANCE_ESTIMATE.absolute)
    for name, other in (
        ("replay through the node", replayed),
        ("straight from the file", from_file),
    ):
        found = agreement(columns, live, other)
        result.require(
            _agrees(found),
            f"live against {name}",
            f"{found.largest:.1e} in {found.rows} estimates",
            f"at most {TOLERANCE:g}",
        )
    truth_columns, truth = BagReader(bag).signal(ANKLE_TRUTH.absolute)
    paper = estimate_bag(bag, algorithm=ConceptualExperimental.name).rows
    demo_pictures.live_run(columns, live, paper, truth_columns, truth, out / "1_live_estimates.png")
    valid = live[live[:, columns.index("valid[1]")] == 1.0]
    if len(valid):
        last = valid[-1]
        for symbol, unit in (("K", "N.m/rad"), ("G", "N.m.s/rad")):
            name = f"{symbol}[{unit}]"
            true = truth[-1, truth_columns.index(name)]
            result.add(
                f"{symbol} at the end, simulated ankle",
                f"{last[columns.index(name)]:.3g} {unit}",
                f"true: {true:.3g} {unit}",
            )


def _agrees(found: Agreement) -> bool:
    return found.largest <= TOLERANCE and found.only_first == 0 and found.only_second == 0


def real_ankles(trials: Path, out: Path, result: Result, console: Console) -> None:
    """Estimate the real trials, and draw measured against predicted torque."""
    found = trial_bags(trials, out, console)
    if not found:
        console.print(
            f"No real trials in {trials}. `ankle fetch-trials` brings public ones (2 MB), then run "
            "the demo again. Going on without."
        )
        result.add("real trials", "none here", "ankle fetch-trials")
        return
    for number, (name, bag) in enumerate(found[:TRIALS_SHOWN], start=1):
        console.print(f"{name}: estimating ...")
        estimated = estimate_bag(bag, out / f"{name}_estimates")
        if not len(estimated.valid):
            result.require(
                False,
                name,
                "no valid estimate",
                "; ".join(estimated.notes) or "expected valid estimates",
            )
            continue
        _, samples = BagReader(bag).signal(ANKLE_SAMPLES.absolute)
        demo_pictures.real_trial(
            name,
            estimated.rows,
            estimated.torques,
            samples,
            out / f"{number + 1}_{name}.png",
        )
        result.trials[name] = estimated.median()


def trial_bags(trials: Path, out: Path, console: Console) -> list[tuple[str, Path]]:
    """Return name and bag of each real trial in a folder; an NPZ file there is imported first."""
    files = sorted(trials.glob("*.npz")) if trials.is_dir() else []
    if not files:
        return [(bag.name, bag) for bag in sorted(trials.glob("trial_*"))]
    found = []
    for file in files[:TRIALS_SHOWN]:
        console.print(f"{file.name}: importing (its torque has the subject's sign, ours the rig's)")
        bag = out / f"{file.stem}_bag"
        columns = {"t[s]": "time", "position[rad]": "position", "torque[N.m]": "torque"}
        import_recording(file, bag, columns=columns, torque_sign="subject")
        found.append((file.stem, bag))
    return found


def imperfect_rig(out: Path, seed: int, result: Result, console: Console) -> None:
    """Estimate a simulated rig with faults live, without and with calibration."""
    for found in show_calibration(out / "imperfect_rig", seed, console):
        result.require(
            found.holds,
            f"{found.symbol} on a rig with faults, calibrated",
            found.calibrated.against(found.truth),
            f"true: {found.truth:.3g} {found.unit}; without calibration: "
            f"{found.without.against(found.truth)}",
        )


def session(out: Path, result: Result, console: Console) -> None:
    """Run a scripted session on the pages, from arm to report."""
    state, pictures, missing = run_session(out / "session", out / "logs" / "session", console)
    console.print(f"screenshots {pictures}")
    shares = hold_shares(state["log"])
    result.require(
        state["session"]["state"] == "finished",
        "session, share of each hold in the target",
        shares,
        "0 to 100 %",
    )
    result.require(
        not missing,
        "report of the session",
        "session/report" if not missing else "none",
        missing or "K and G against EMG over the holds",
    )
    result.add("screenshots of the pages", pictures, "what subject and operator saw")


def summary(out: Path, result: Result, console: Console) -> None:
    """Show the closing table, and where everything lies."""
    table = Table("what", "result", "meaning")
    for row in result.rows:
        table.add_row(*row)
    console.print(table)
    if result.trials:
        columns = Table(
            "real ankles: median of the valid estimates",
            *result.trials,
            "what it is",
            title_justify="left",
        )
        for name, meaning in MEANINGS.items():
            quantity, unit = name.rstrip("]").split("[")
            columns.add_row(
                f"{quantity} [{unit}]",
                *(f"{median[name]:.3g}" for median in result.trials.values()),
                meaning,
            )
        console.print(columns)
    console.print(f"Everything is in {out.resolve()}:")
    for path in sorted(out.iterdir()):
        console.print(f"  {path.name}{'/' if path.is_dir() else ''}")
