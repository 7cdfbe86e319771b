"""`ankle investigate`: from an ambiguous recording to one name."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ankle_bringup.terminal import (
    Out,
    Overwrite,
    OwnTerms,
    clear_folder,
    console,
    number_option,
    working,
)
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
    terms: OwnTerms = None,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Diagnose, design the movement that tells the rivals apart, record it, and judge all of them.

    Goes on until each effect has one name, no movement within the limits would tell more, or the
    budget is spent; then all recordings are searched together. The rig has to run, with the
    subject in it; you are shown each movement and nothing moves before you agree. Writes
    report.html with the story, the first diagnosis, each design and each bag.

    Example: ankle investigate session --out session_investigation --rounds 2
    """
    from ankle_physics.model import Model
    from ankle_physics.own_terms import load_terms
    from model_discrepancy.report.investigation_report import write_investigation
    from model_discrepancy.tools.investigation import investigate
    from model_discrepancy.tools.simulated_conduct import SimulatedConduct

    load_terms(terms or "")
    model = Model.load(simulate) if simulate is not None else None
    clear_folder(out, overwrite, "investigation.json")
    with working("investigating") as step:

        def live(candidate: Candidate, duration: float, number: int) -> Recording | None:
            with step.paused():
                return _recorded(candidate, duration, out / f"round_{number}")

        conduct = live if model is None else SimulatedConduct(model)
        story = investigate(bag, conduct, out, rounds, progress=step)
    write_investigation(story, out / "report.html")
    for one in story.rounds:
        console.print(f"{one.title}, {one.duration:.0f} s: {one.answer}")
    if story.together:
        console.print(story.together)
    console.print(f"left: {', '.join(story.names) or 'nothing'}. {story.ended}")
    console.print(f"report: {(out / 'report.html').resolve()}")
    return {"out": out.resolve(), **story.content()}


def _recorded(candidate: Candidate, duration: float, bag: Path) -> Recording | None:
    """Record a movement of the running graph, once the operator agrees; None where not."""
    from ankle_bringup.graph import load_graph
    from ankle_bringup.up import run_graph
    from model_discrepancy.recording.recording import Recording
    from model_discrepancy.tools.candidate_movements import LEVEL_S, LEVELS

    console.print(f"Next movement: {candidate.title}, {duration:.0f} s.", style="bold")
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
