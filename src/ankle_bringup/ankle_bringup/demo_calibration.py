"""The demo's imperfect rig: K and G live without and with calibration, beside the truth.

Rig and session are calibrated from recordings of the simulated rig that are made faster than real
time. Then one live run is estimated twice side by side.
"""

from __future__ import annotations

import math
from contextlib import closing
from dataclasses import dataclass
from datetime import datetime, timezone
from pathlib import Path

import numpy as np
from rich.console import Console
from rich.table import Table

from ankle_bringup import demo_pictures
from ankle_bringup.graph import load_graph
from ankle_bringup.imperfect_rig import ImperfectRig, draw_imperfect_rig
from ankle_bringup.live_graph import observer
from ankle_bringup.live_monitor import (
    ESTIMATE,
    SAMPLES,
    TRUTH,
    LiveMonitor,
    with_one_more_reader,
)
from ankle_bringup.live_watch import watch
from ankle_bringup.processes import Processes
from ankle_bringup.simulated_recording import record_simulated_rig
from ankle_bringup.terminal import SEED, progress, working
from ankle_interfaces.topics import ANKLE_TRUTH, IMPEDANCE_ESTIMATE
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from calibration.errors import CalibrationError
from calibration.rig_calibration import calibrate_rig
from calibration.rig_in_words import described
from calibration.session_calibration import calibrate_session, require_gain
from impedance_estimator.simultaneous.doubt import DOUBT_THRESHOLD
from model_discrepancy.recording.recording import Recording
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.rig_calibration import DURATION, RigCalibration
from perturbation_generator.settings import Settings
from session_recorder.bag_reader import BagReader

CALIBRATED = f"calibrated/{IMPEDANCE_ESTIMATE.name}"
"""Topic of the estimator that has both files."""
# Standard errors that hold the truth in 95 % of estimates.
NORMAL_BAND = 1.96
SESSION_SECONDS = 60.0
"""[s] The session is calibrated on so much, the least that is recommended."""
LIVE_SECONDS, RISES_AT = 45.0, 20.0
"""[s] Length of the live run, and when K and G rise: the first estimates come after 10 s, and the
last ones are made 25 s after the rise."""
GAINS = (("K", "N.m/rad"), ("G", "N.m.s/rad"))
TITLE = "calibrated in the demo"


@dataclass(frozen=True)
class LastEstimate:
    """Holds the last valid estimate of a run.

    Attributes
    ----------
    value, standard_error
        In the quantity's unit.
    doubt
        Of the estimate, 0 to 1.
    """

    value: float
    standard_error: float
    doubt: float

    def against(self, truth: float) -> str:
        """Return value, standard error, error relative to the truth and doubt, in words."""
        error = 100.0 * (self.value - truth) / truth
        return (
            f"{self.value:.3g} ± {self.standard_error:.2g} ({error:+.0f} %), doubt {self.doubt:.2f}"
        )


@dataclass(frozen=True)
class Comparison:
    """Holds K or G at the end of the live run.

    Attributes
    ----------
    symbol, unit
        Of the quantity.
    truth
        Of the joint itself, from ``ankle/truth``.
    without, calibrated
        The estimates without a file, and with the files of the calibration.
    """

    symbol: str
    unit: str
    truth: float
    without: LastEstimate
    calibrated: LastEstimate

    @property
    def holds(self) -> bool:
        """Tell whether the truth lies where the calibrated estimate states it, without a doubt.

        Without calibration an estimate may be right by accident, so that the calibrated one need
        not be nearer.
        """
        error = abs(self.calibrated.value - self.truth)
        stated = NORMAL_BAND * self.calibrated.standard_error
        return error < stated and self.calibrated.doubt < DOUBT_THRESHOLD


@dataclass(frozen=True)
class Calibration:
    """Holds what was calibrated; `subject` is None where no session could be."""

    rig: RigFile
    subject: Model | None


def show_calibration(out: Path, seed: int, console: Console) -> list[Comparison]:
    """Calibrate a simulated rig with hidden imperfections, and estimate it live twice.

    Parameters
    ----------
    out
        New folder; gets ``hidden``, the bags, ``rig.yaml``, ``subject.yaml``, ``diagnosis`` and
        logs.
    seed
        Draws rig, subject, perturbations and noise.
    console
        Where it is shown.

    Returns
    -------
    list[Comparison]
        K and G.

    Raises
    ------
    RunError
        A node failed.
    """
    hidden = draw_imperfect_rig(seed)
    files = hidden.save(out / "hidden", RISES_AT)
    found = calibrate(out, hidden, seed, console)
    console.print(_found_beside_hidden(hidden, found))
    console.print(
        f"Live, {LIVE_SECONDS:.0f} s: one estimator without any file and one with both, on the "
        f"same samples. After {RISES_AT:.0f} s K rises by 20 % and G by 40 %."
    )
    _run_side_by_side(out, files, found, seed, console)
    compared = compare(out / "live")
    console.print(comparison_table(compared))
    demo_pictures.calibrated_run(*_series(out / "live"), out / "calibration.png")
    return compared


def calibrate(out: Path, hidden: ImperfectRig, seed: int, console: Console) -> Calibration:
    """Calibrate rig and session from recordings of the simulated rig; write both files."""
    plate, session = out / "plate_empty", out / "session"
    console.print(
        "Not live: the simulation records the rig with its plate empty and then a subject at rest, "
        "faster than real time. Both are calibrated from these bags as `ankle calibrate` does it."
    )
    movements = RigCalibration(Settings(seed=_seed(seed, 0), duration=DURATION))
    pulses = PulseStep(Settings(seed=_seed(seed, 1), duration=SESSION_SECONDS))
    for bag, subject, signal in (
        (plate, Model.of({}), movements),
        (session, hidden.subject, pulses),
    ):
        with progress(f"recording {bag.name}") as show:
            record_simulated_rig(bag, hidden.rig, subject, signal, datetime.now(timezone.utc), show)
    with working("calibrating the rig") as step:
        calibrated = calibrate_rig(plate, TITLE, progress=step)
    calibrated.rig.save(out / "rig.yaml")
    console.print(described(calibrated))
    try:
        with working("calibrating the session") as step:
            found = calibrate_session(session, out / "diagnosis", calibrated.rig, step)
            require_gain(found, Recording.from_bag(session), calibrated.rig)
    except CalibrationError as error:
        console.print(f"The session is not calibrated: {error}")
        return Calibration(calibrated.rig, None)
    found.model.save(out / "subject.yaml")
    for effect in found.verdict["effects"]:
        console.print(f"- {effect['sentence']}")
    return Calibration(calibrated.rig, found.model)


def _seed(seed: int, purpose: int) -> int:
    """Return the seed of one of the demo's recordings."""
    return (seed + purpose) % (int(SEED.upper) + 1)


def _found_beside_hidden(hidden: ImperfectRig, found: Calibration) -> Table:
    table = Table("hidden in the simulated rig", "true", "found", "unit")
    subject = found.subject or Model([])
    milliseconds = 1e3 * found.rig.torque_delay.value
    table.add_row(
        "torque behind position",
        f"{1e3 * hidden.rig.torque_delay.value:.3f}",
        f"{milliseconds:.3f}",
        "ms",
    )
    for words, true, own, term, symbol, unit in (
        ("inertia of the plate", hidden.rig.model, found.rig.model, *_PLATE),
        ("straps", hidden.subject, subject, *_STRAPS),
        ("servo against load", hidden.rig.model, found.rig.model, *_SERVO),
    ):
        value = f"{own.entry(term).values[symbol]:.4g}" if own.has(term) else "not found"
        table.add_row(words, f"{true.entry(term).values[symbol]:.4g}", value, unit)
    return table


_PLATE = ("footplate_inertia", "Ip", "kg.m^2")
_STRAPS = ("fixation_compliance", "k_s", "N.m/rad")
_SERVO = ("servo_compliance", "k_a", "N.m/rad")


def _run_side_by_side(
    out: Path, files: dict[str, Path], found: Calibration, seed: int, console: Console
) -> None:
    """Run the hidden rig at real time before both estimators, and record it."""
    rig = (out / "rig.yaml").resolve()
    settings = [
        f"record.out={out / 'live'}",
        f"record.rig={rig}",
        f"calibrated_estimator.rig={rig}",
        *(f"ankle_sim.{name}={path.resolve()}" for name, path in files.items()),
        f"ankle_sim.seed={_seed(seed, 2)}",
        f"perturbation_generator.seed={_seed(seed, 2)}",
        f"perturbation_generator.duration={LIVE_SECONDS}",
    ]
    if found.subject is not None:
        settings.append(f"calibrated_estimator.model={(out / 'subject.yaml').resolve()}")
    topics = ESTIMATE, CALIBRATED, SAMPLES, TRUTH
    graph = load_graph("simulated_calibrated").with_settings(settings)
    graph = with_one_more_reader(graph, topics)
    with (
        observer("demo") as node,
        closing(LiveMonitor(node, topics)) as monitor,
        Processes(graph, out / "logs") as processes,
    ):
        watch(monitor, processes, LIVE_SECONDS, lambda left: _live_table(monitor, left), console)


def _live_table(monitor: LiveMonitor, seconds_left: float) -> Table:
    table = Table("live", "without calibration", "calibrated", "true", "unit")
    for symbol, unit in GAINS:
        name = f"{symbol}[{unit}]"
        table.add_row(
            symbol, *(_number(monitor.latest(t, name)) for t in (ESTIMATE, CALIBRATED, TRUTH)), unit
        )
    doubts = (_number(monitor.latest(t, "doubt[1]")) for t in (ESTIMATE, CALIBRATED))
    table.add_row("doubt", *doubts, "", "0 to 1")
    table.add_row("time left", f"{max(seconds_left, 0.0):.0f}", "", "", "s")
    return table


def _number(value: float) -> str:
    return "not yet" if math.isnan(value) else f"{value:.3g}"


def _series(bag: Path) -> tuple[tuple[str, ...], np.ndarray, np.ndarray, np.ndarray]:
    """Return columns and rows of both estimates, and time, K and G of the truth, of a bag."""
    reader = BagReader(bag)
    columns, without = reader.signal(IMPEDANCE_ESTIMATE.absolute)
    _, calibrated = reader.signal(f"/{CALIBRATED}")
    names, rows = reader.signal(ANKLE_TRUTH.absolute)
    own = [names.index(name) for name in ("t[s]", *(f"{s}[{unit}]" for s, unit in GAINS))]
    return columns, without, calibrated, rows[:, own]


def compare(bag: Path) -> list[Comparison]:
    """Return K and G at the end of the live run that a bag holds.

    Raises
    ------
    session_recorder.errors.BagError
        No such bag or topic.
    """
    columns, without, calibrated, truth = _series(bag)
    return [
        Comparison(
            symbol,
            unit,
            float(truth[-1, 1 + k]),
            last_estimate(columns, without, f"{symbol}[{unit}]"),
            last_estimate(columns, calibrated, f"{symbol}[{unit}]"),
        )
        for k, (symbol, unit) in enumerate(GAINS)
    ]


def last_estimate(columns: tuple[str, ...], rows: np.ndarray, name: str) -> LastEstimate:
    """Return the last valid estimate; all of it is NaN where none is valid.

    Parameters
    ----------
    columns
        Names of the columns of `rows`.
    rows
        Estimates, shape (n, m).
    name
        Of the quantity, as ``K[N.m/rad]``.
    """
    valid = rows[rows[:, columns.index("valid[1]")] == 1.0]
    if not len(valid):
        return LastEstimate(math.nan, math.nan, math.nan)
    return LastEstimate(
        *(float(valid[-1, columns.index(own)]) for own in (name, f"se_{name}", "doubt[1]"))
    )


def comparison_table(compared: list[Comparison]) -> Table:
    """Return the table of K and G without and with calibration beside the truth."""
    table = Table("at the end", "true", "without calibration", "rig and session calibrated", "unit")
    for one in compared:
        table.add_row(
            one.symbol,
            f"{one.truth:.3g}",
            one.without.against(one.truth),
            one.calibrated.against(one.truth),
            one.unit,
        )
    return table
