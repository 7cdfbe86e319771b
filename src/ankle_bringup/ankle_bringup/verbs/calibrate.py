"""Calibrate the rig once (rig.yaml), and the session before each one (subject.yaml)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ankle_bringup.at_most import DEFAULT_MINUTES, AtMost
from ankle_bringup.calibration_recording import (
    await_state,
    record_rig,
    record_session,
    recorded_into,
    require_running,
    rig_states,
)
from ankle_bringup.terminal import Namespace, Out, Overwrite, console, number_option, working
from ankle_interfaces.quantity import Quantity

if TYPE_CHECKING:
    from rclpy.node import Node

    from ankle_physics.rig_file import RigFile
    from calibration.known_load import KnownLoad
    from calibration.session_calibration import CalibratedSession
    from model_discrepancy.recording.recording import Recording

verb = typer.Typer()

Recorded = Annotated[
    Path | None,
    typer.Argument(help="A bag to calibrate from; without one the running graph is recorded."),
]
Into = Annotated[
    Path, typer.Option("--bag", help="The new bag, where the running graph is recorded.")
]


def _require_new(path: Path, option: str, overwrite: bool) -> None:
    """Refuse a place of a result, given with this option, where something is already."""
    from ankle_bringup.errors import RunError

    if path.exists() and not overwrite:
        raise RunError(f"{path} is there; give another {option}, or replace it with --overwrite")


def _require_new_bag(bag: Path, verb: str) -> None:
    from ankle_bringup.errors import RunError

    if bag.exists():
        raise RunError(
            f"{bag} is there; give another --bag, or calibrate from it: ankle calibrate {verb} "
            f"{bag}"
        )


SECONDS = Quantity("seconds", "s", 30.0, 600.0, 90.0)
"""The diagnosis refuses less than 20 s of good samples, so that some may be lost of the shortest;
the default is documented for the step of a session (``docs/biofeedback.md``)."""
TAKEOVER_SECONDS = 60.0
"""[s] Time for a running estimator to go on with a new model: 15 to 30 s with the perturbation."""


@verb.command()
def rig(
    bag: Recorded = None,
    out: Out = Path("rig.yaml"),
    into: Into = Path("rig_calibration"),
    title: Annotated[str, typer.Option(help="Name of the rig; the bag's unless given.")] = "",
    inertia: Annotated[
        float, typer.Option(help="Known inertia on the plate [kg.m^2]; 0: none.")
    ] = 0.0,
    spring: Annotated[float, typer.Option(help="Known spring on the plate [N.m/rad]; 0: none.")] = (
        0.0
    ),
    beside: Annotated[
        Path | None,
        typer.Option(
            help="The file of the same rig with its plate empty: it is kept, and how far the servo "
            "gives way is added, which the spring shows."
        ),
    ] = None,
    amplitude: Annotated[
        float, typer.Option(help="Largest distance from rest [rad], within the rig's limits.")
    ] = 0.04,
    simulated: Annotated[
        Path | None,
        typer.Option(help="Simulate the rig of this rig file instead of a running graph."),
    ] = None,
    namespace: Namespace = "",
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Calibrate the rig: plate empty or with a known load, two minutes of steps and sweeps.

    Finds delays between the channels, inertia, friction and weight of the plate, lag or resonance
    of the torque sensor, the servo and how far it gives way, zeros and noise, with standard errors.
    Remove the foot from the plate first. Without a bag the laboratory has to run ('ankle up
    rig_to_calibrate'), its rig armed and started: the plate rests until this command moves it. Its
    operator's page does the same. A plate that is light shows how far the servo gives way only with
    a spring on it (--spring), which a file of the empty plate may be completed with (--beside).

    Example: ankle calibrate rig --title 'laboratory 2' --out rig.yaml
    """
    from ankle_bringup.errors import RunError
    from ankle_physics.rig_file import RigFile
    from calibration.known_load import KnownLoad
    from calibration.rig_calibration import calibrate_rig
    from calibration.rig_in_words import described, found_in_words

    load = KnownLoad(inertia, spring)
    empty = RigFile.load(beside) if beside is not None else None
    if empty is not None and not spring:
        raise RunError("--beside needs a spring on the plate; name its stiffness with --spring")
    _require_new(out, "--out", overwrite)
    if bag is None:
        bag = into
        _require_new_bag(into, "rig")
        if simulated is None:
            require_running(namespace)
        with recorded_into(into, whole=True):
            if simulated is None:
                record_rig(into, amplitude, namespace)
            else:
                _simulate_rig(into, amplitude, simulated, load, namespace)
    with working("calibrating the rig") as step:
        found = calibrate_rig(bag, title, load, progress=step, beside=empty)
    found.rig.save(out)
    console.print(described(found))
    console.print(f"written to {out.resolve()}")
    return {"out": out.resolve(), "found": found_in_words(found), "remarks": found.remarks}


def _simulate_rig(bag: Path, amplitude: float, rig: Path, load: KnownLoad, namespace: str) -> None:
    import tempfile

    from ankle_bringup.graph import load_graph
    from ankle_bringup.up import run_graph
    from ankle_physics.model import Model
    from ankle_physics.rig_file import RigFile

    RigFile.load(rig)
    with tempfile.TemporaryDirectory() as folder:
        mounted = Path(folder) / "mounted.yaml"
        terms = {"stiffness": {"K": load.spring}} if load.spring else {}
        if load.inertia:
            terms["inertia"] = {"I": load.inertia}
        Model.of(terms, "plate without a foot").save(mounted)
        settings = [
            f"record.out={bag}",
            f"perturbation_generator.amplitude={amplitude}",
            f"ankle_sim.rig={rig.resolve()}",
            f"ankle_sim.model={mounted}",
        ]
        graph = load_graph("simulated_rig_calibration").in_namespace(namespace)
        run_graph(graph.with_settings(settings), Path(folder) / "logs", 0.0, console)


@verb.command()
def session(
    bag: Recorded = None,
    out: Out = Path("subject.yaml"),
    into: Into = Path("session_calibration"),
    seconds: Annotated[
        float, number_option(SECONDS, "How much of the running perturbation is recorded.")
    ] = 90.0,
    report: Annotated[Path, typer.Option(help="Folder of the diagnosis with its report.")] = Path(
        "session_diagnosis"
    ),
    rig: Annotated[
        Path | None,
        typer.Option(help="The calibrated rig (rig.yaml), undone before the diagnosis."),
    ] = None,
    namespace: Namespace = "",
    hand_over: Annotated[
        bool, typer.Option(help="Hand the model to the running estimator.")
    ] = True,
    force: Annotated[
        bool,
        typer.Option(
            "--force", help="Calibrate in spite of a rig file that contradicts what is recorded."
        ),
    ] = False,
    at_most: AtMost = DEFAULT_MINUTES,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Calibrate the session: record the perturbed subject, diagnose, hand the model to the running
    estimator.

    Writes subject.yaml, and the diagnosis with its report. Refused are the file of another rig, a
    recording without a subject, and a model with which K and G would be known less well than
    without it. A running impedance_estimator goes on with the new model without a restart; the last
    line says whether it does.

    Example: ankle calibrate session --seconds 90 --rig rig.yaml --out subject.yaml
    """
    from ankle_bringup.terminal import clear_folder
    from ankle_physics.rig_file import RigFile
    from calibration.session_calibration import calibrate_session, read_session, require_gain

    _require_new(out, "--out", overwrite)
    if any(report.glob("*")):
        _require_new(report, "--report", overwrite)
    known = RigFile.load(rig) if rig is not None else None
    live = bag is None
    if bag is None:
        bag = into
        _require_new_bag(into, "session")
        require_running(namespace, moving=True)
    clear_folder(report, overwrite, "verdict.json")
    if live:
        with recorded_into(into):
            record_session(into, seconds, namespace)
    recording = read_session(bag)
    contradictions = _require_its_rig(recording, bag, known, rig, force)
    with working("calibrating the session") as step:
        found = calibrate_session(recording, report, known, step, at_most)
        require_gain(found, recording, known)
    found.model.save(out)
    warnings = _shown(found)
    console.print(f"written to {out.resolve()}; report: {(report / 'report.html').resolve()}")
    handed = _handed_over(out.resolve(), namespace) if live and hand_over else ""
    if handed:
        console.print(handed)
    return {
        "out": out.resolve(),
        **found.verdict,
        "warnings": [*contradictions, *warnings],
        "estimator": handed,
    }


def _shown(found: CalibratedSession) -> list[str]:
    """Show what was found; return what is to be said before the model is handed over."""
    from calibration.session_statements import described_session, session_warnings

    console.print(f"verdict: {found.verdict['verdict']}", style="bold")
    for effect in found.verdict["effects"]:
        console.print(f"- {effect['sentence']}")
    for line in described_session(found):
        console.print(line)
    warnings = session_warnings(found)
    for sentence in warnings:
        console.print(f"warning: {sentence}", style="bold", soft_wrap=True)
    return warnings


def _require_its_rig(
    recording: Recording, bag: Path, known: RigFile | None, rig: Path | None, force: bool
) -> list[str]:
    """Refuse the file of another rig, unless forced; return in which ways it contradicts."""
    from ankle_bringup.errors import RunError
    from calibration.session_calibration import rig_contradictions

    contradictions = rig_contradictions(recording, known) if known is not None else []
    if contradictions and not force:
        raise RunError(
            f"{rig} is not the file of the rig that {bag} was recorded with: "
            f"{'; '.join(contradictions)}. Give the right one (ankle calibrate session {bag} --rig "
            "FILE), or calibrate the rig again; --force goes on in spite of it"
        )
    for sentence in contradictions:
        console.print(
            f"warning: {rig} contradicts the recording: {sentence}", style="bold", soft_wrap=True
        )
    return contradictions


def _handed_over(model: Path, namespace: str) -> str:
    """Set the model of a running estimator; what became of it, in a sentence."""
    from ankle_bringup.errors import RunError
    from ankle_bringup.live_graph import latched, observer, set_parameter
    from ankle_bringup.up import ending_by_signal
    from ankle_interfaces.topics import IMPEDANCE_PROVENANCE
    from ankle_physics.model import Model

    name, sha256 = "impedance_estimator", Model.load(model).sha256
    with (
        ending_by_signal(),
        observer(own_signals=True, namespace=namespace) as node,
        working("handing the model over"),
    ):
        states = rig_states(node)
        try:
            # The same path with new content would be no change to the estimator: it is emptied.
            for value in ("''", str(model)):
                set_parameter(node, name, "model", value)
            topic = IMPEDANCE_PROVENANCE.name
            taken = latched(node, topic, TAKEOVER_SECONDS, lambda stated: sha256 in stated)
        except RunError as error:
            return f"the running estimator goes on without it: {error}{_fault(node, states)}"
        except KeyboardInterrupt:
            return (
                "ended by a signal before the running estimator said that it uses the model"
                f"{_fault(node, states)}"
            )
        if taken is None:
            return (
                "the running estimator has the model but does not use it after "
                f"{TAKEOVER_SECONDS:g} s: it goes on with it at its first valid estimate, which "
                f"needs the perturbation{_fault(node, states)}"
            )
    return "the running estimator goes on with this model"


def _fault(node: Node, states: list[str]) -> str:
    """Return the fault of the rig as the end of a sentence; empty where it has none."""
    await_state(states, node)
    return f"; the rig is in {states[-1]}" if states and states[-1].startswith("fault") else ""
