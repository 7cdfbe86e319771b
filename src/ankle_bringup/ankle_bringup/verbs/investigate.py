"""`ankle investigate`: from an ambiguous recording to one name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ankle_bringup.errors import RunError
from ankle_bringup.known_rig import KnownRig, known_rig
from ankle_bringup.terminal import (
    Out,
    Overwrite,
    OwnTerms,
    clear_folder,
    console,
    number_option,
    working,
)
from ankle_bringup.verbs.diagnose import base_values
from ankle_interfaces.quantity import Quantity

if TYPE_CHECKING:
    from model_discrepancy.recording.recording import Recording
    from model_discrepancy.tools.candidate_movements import Candidate

ROUNDS = Quantity("rounds", "1", 1, 10, 3)


def verb(
    bag: Annotated[Path, typer.Argument(help="The first recording.")],
    out: Out = Path("investigation"),
    rounds: Annotated[int, number_option(ROUNDS, "Further recordings at most, the budget.")] = 3,
    simulate: Annotated[
        Path | None,
        typer.Option(help="Simulate this model file (YAML) instead of the running graph."),
    ] = None,
    rig: KnownRig = None,
    joint: Annotated[
        str, typer.Option(help="ankle, knee, elbow, wrist, or a joint's file (YAML).")
    ] = "ankle",
    terms: OwnTerms = None,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Diagnose, design the movement that tells the rivals apart, record it, and judge all of them.

    Goes on until each effect has one name, no movement within the limits would tell more, or the
    budget is spent; then all recordings are searched together. The rig has to run, with the
    subject in it; you are shown each movement and nothing moves before you agree. Writes
    report.html with the story, investigation.json with K and G of the first recording, its
    diagnosis (first), each design, each bag (round_1 and so on) and, where there are several
    recordings, a model file of each (together).

    Example: ankle investigate session --out session_investigation --rounds 2
    """
    import json

    from ankle_physics.joint_profile import JointProfile
    from ankle_physics.own_terms import load_terms
    from model_discrepancy.report.investigation_report import write_investigation
    from model_discrepancy.tools.investigation import investigate
    from model_discrepancy.tools.known_terms import load_model
    from model_discrepancy.tools.simulated_conduct import SimulatedConduct

    load_terms(terms or "")
    profile = JointProfile.load(joint)
    with profile.in_force():
        model = load_model(simulate) if simulate is not None else None
    if model is not None and model.joint.linear != profile.linear:
        raise RunError(
            f"{simulate} is in {model.joint.position_unit} and {model.joint.torque_unit}, and the "
            f"joint '{profile.name}' in {profile.position_unit} and {profile.torque_unit}: give "
            "the joint of the model by --joint"
        )
    known, carried = known_rig(rig, [bag])
    clear_folder(out, overwrite, "investigation.json")
    if carried:
        console.print(carried, soft_wrap=True)
    with working("investigating") as step, profile.in_force():

        def live(candidate: Candidate, duration: float, number: int) -> Recording | None:
            with step.paused():
                return _recorded(candidate, duration, out / f"round_{number}")

        conduct = live if model is None else SimulatedConduct(model, out=out)
        story = investigate(bag, conduct, out, rounds, progress=step, rig=known)
        write_investigation(story, out / "report.html")
    for one in story.rounds:
        console.print(profile.in_units(f"{one.title}, {one.duration:.0f} s: {one.answer}"))
    if story.together:
        console.print(story.together)
    console.print(f"left: {', '.join(story.names) or 'nothing'}. {story.ended}")
    written = json.loads((out / "investigation.json").read_text())
    if stated := base_values(written["parameters"]):
        console.print("The first recording, by its own diagnosis:")
    for line in stated:
        console.print(line, soft_wrap=True)
    console.print(f"models: {', '.join(str(out / file) for file in story.models)}")
    console.print(f"report: {(out / 'report.html').resolve()}")
    return {"out": out.resolve(), **written}


def _recorded(candidate: Candidate, duration: float, bag: Path) -> Recording | None:
    """Record a movement of the running graph, once the operator agrees; None where not."""
    from ankle_bringup.graph import load_graph
    from ankle_bringup.up import run_graph
    from ankle_physics.joint_profile import joint_in_force
    from model_discrepancy.recording.recording import Recording
    from model_discrepancy.tools.candidate_movements import LEVEL_S, LEVELS

    title = joint_in_force().in_units(candidate.title)
    console.print(f"Next movement: {title}, {duration:.0f} s.", style="bold")
    console.print("Within the generator's limits; the rig's own limits and its stop hold as ever.")
    if candidate.levels:
        levels = ", ".join(f"{level:g}" for level in LEVELS)
        console.print(
            f"Ask the subject to hold {levels} N.m in turn, {LEVEL_S:g} s each, by the screen."
        )
    if not typer.confirm("Is the subject ready, and do you agree?", default=False):
        return None
    settings = [f"record.out={bag}", f"perturbation_generator.duration={duration}"]
    settings += [
        f"perturbation_generator.{name}={value}" for name, value in candidate.parameters.items()
    ]
    graph = load_graph("designed_movement").with_settings(settings)
    run_graph(graph, bag.parent / "logs", 0.0, console)
    return Recording.from_bag(bag)
