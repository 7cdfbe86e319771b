"""Calibrate the rig once (rig.yaml), and the session before each one (subject.yaml)."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import Namespace, Out, Overwrite, console, number_option, working
from ankle_interfaces.quantity import Quantity

verb = typer.Typer()

Recorded = Annotated[
    Path | None,
    typer.Argument(help="A bag to calibrate from; without one the running graph is recorded."),
]
Into = Annotated[
    Path, typer.Option("--bag", help="The new bag, where the running graph is recorded.")
]


def _require_new(path: Path, overwrite: bool) -> None:
    from ankle_bringup.errors import RunError

    if path.exists() and not overwrite:
        raise RunError(f"{path} is there; give another --out, or replace it with --overwrite")


SECONDS = Quantity("seconds", "s", 30.0, 600.0, 90.0)
"""The diagnosis refuses less than 20 s of good samples, so that some may be lost of the shortest;
the default is documented for the step of a session (``docs/biofeedback.md``)."""
RECORDER_SECONDS = 60.0
"""[s] Time for a recorder to start: 2 s, and half a minute on a busy computer."""
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
    """Calibrate the rig: plate empty or with a known load, two minutes of steps and slow sweeps.

    Finds delays between the channels, inertia, friction and weight of the plate, lag or resonance
    of the torque sensor, the servo and how far it gives way, zeros and noise, with standard errors.
    Remove the foot from the plate first. Without a bag the rig has to run, armed and started, and
    no other perturbation may be running. Mount a spring to find how far the servo gives way.

    Example: ankle calibrate rig --spring 100 --title 'laboratory 2' --out rig.yaml
    """
    from calibration.rig_calibration import KnownLoad, calibrate_rig, described

    load = KnownLoad(inertia, spring)
    _require_new(out, overwrite)
    if bag is None:
        bag = into
        _require_new(into, overwrite=False)
        _record_rig(into, amplitude, simulated, load, namespace)
    with working("calibrating the rig") as step:
        found = calibrate_rig(bag, title, load, progress=step)
    found.rig.save(out)
    console.print(described(found))
    console.print(f"written to {out.resolve()}")
    return {"out": out.resolve(), "remarks": found.remarks}


def _record_rig(
    bag: Path, amplitude: float, simulated: Path | None, load: Any, namespace: str
) -> None:
    import tempfile

    from ankle_bringup.graph import load_graph
    from ankle_bringup.up import run_graph
    from ankle_physics.model import Model
    from ankle_physics.rig_file import RigFile

    with tempfile.TemporaryDirectory() as folder:
        settings = [f"record.out={bag}", f"perturbation_generator.amplitude={amplitude}"]
        if simulated is not None:
            RigFile.load(simulated)
            mounted = Path(folder) / "mounted.yaml"
            terms = {"stiffness": {"K": load.spring}} if load.spring else {}
            if load.inertia:
                terms["inertia"] = {"I": load.inertia}
            Model.of(terms, "plate without a foot").save(mounted)
            settings += [f"ankle_sim.rig={simulated.resolve()}", f"ankle_sim.model={mounted}"]
        name = "rig_calibration" if simulated is None else "simulated_rig_calibration"
        graph = load_graph(name).in_namespace(namespace).with_settings(settings)
        run_graph(graph, Path(folder) / "logs", 0.0, console)


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
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Calibrate the session: record the perturbed subject, diagnose, hand the model to the running
    estimator.

    Writes subject.yaml, and the diagnosis with its report. A model with which K and G would be
    known less well than without it is refused. A running impedance_estimator goes on
    with the new model without a restart; the last line says whether it does.

    Example: ankle calibrate session --seconds 90 --rig rig.yaml --out subject.yaml
    """
    from ankle_bringup.terminal import clear_folder
    from ankle_physics.rig_file import RigFile
    from calibration.session_calibration import calibrate_session, require_gain
    from model_discrepancy.recording.recording import Recording

    _require_new(out, overwrite)
    clear_folder(report, overwrite, "verdict.json")
    known = RigFile.load(rig) if rig is not None else None
    live = bag is None
    if bag is None:
        bag = into
        _require_new(into, overwrite=False)
        _record_session(into, seconds, namespace)
    with working("calibrating the session") as step:
        found = calibrate_session(bag, report, known, step)
        require_gain(found.model, Recording.from_bag(bag), known)
    found.model.save(out)
    console.print(f"verdict: {found.verdict['verdict']}", style="bold")
    for effect in found.verdict["effects"]:
        console.print(f"- {effect['sentence']}")
    console.print(f"written to {out.resolve()}; report: {(report / 'report.html').resolve()}")
    handed = _handed_over(out.resolve(), namespace) if live and hand_over else ""
    if handed:
        console.print(handed)
    return {"out": out.resolve(), **found.verdict, "estimator": handed}


def _record_session(bag: Path, seconds: float, namespace: str) -> None:
    """Record so many seconds, counted from when the recorder is ready."""
    import tempfile
    import time

    from ankle_bringup.errors import RunError
    from ankle_bringup.graph import Graph, NodeDescription
    from ankle_bringup.processes import Processes
    from ankle_bringup.terminal import progress

    recorder = NodeDescription(
        "session_recorder",
        "record",
        "calibration_recorder",
        {"out": str(bag)},
    )
    with (
        tempfile.TemporaryDirectory() as logs,
        Processes(
            Graph("a recorder", (recorder,)).in_namespace(namespace), Path(logs)
        ) as processes,
        progress(f"recording {seconds:g} s of the running session") as show,
    ):
        started = time.monotonic()
        while not bag.exists():
            processes.ended("")
            if time.monotonic() - started > RECORDER_SECONDS:
                raise RunError(f"no recording has begun within {RECORDER_SECONDS:g} s")
            time.sleep(0.1)
        began = time.monotonic()
        while (passed := time.monotonic() - began) < seconds:
            processes.ended("")
            show(passed / seconds)
            time.sleep(0.25)


def _handed_over(model: Path, namespace: str) -> str:
    """Set the model of a running estimator; what became of it, in a sentence."""
    from ankle_bringup.errors import RunError
    from ankle_bringup.live_graph import latched, observer, set_parameter
    from ankle_interfaces.topics import IMPEDANCE_PROVENANCE
    from ankle_physics.model import Model

    name, sha256 = "impedance_estimator", Model.load(model).sha256
    try:
        with observer(namespace=namespace) as node, working("handing the model over"):
            # The same path with new content would be no change to the estimator: it is emptied.
            for value in ("''", str(model)):
                set_parameter(node, name, "model", value)
            topic = IMPEDANCE_PROVENANCE.name
            taken = latched(node, topic, TAKEOVER_SECONDS, lambda stated: sha256 in stated)
    except RunError as error:
        return f"the running estimator goes on without it: {error}"
    if taken is None:
        return (
            f"the running estimator has the model but does not use it after {TAKEOVER_SECONDS:g} s"
            ": it goes on with it at its first valid estimate, which needs the perturbation"
        )
    return "the running estimator goes on with this model"
