"""Verbs of one recording's mismatch: locate it, name it, model it, and what to measure next."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer
from rich.console import Console
from rich.table import Table

from ankle_bringup.terminal import Out, console

verbs = typer.Typer()


@verbs.command()
def diagnose(
    bag: Annotated[Path, typer.Argument(help="A bag with /ankle/samples.")],
    out: Out = Path("diagnosis"),
    model: Annotated[
        Optional[Path],  # noqa: UP045
        typer.Option(help="A model file as the baseline, instead of the paper's model refitted."),
    ] = None,
) -> None:
    """Find where the joint model fails on a recording, and which physics was left out.

    Writes report.html, verdict.json and the augmented model.yaml, which ankle_sim loads.

    Example: ankle diagnose session --out session_diagnosis
    """
    from ankle_bringup.errors import RunError
    from model_discrepancy.diagnose import diagnose as diagnose_bag

    if out.exists() and any(out.iterdir()):
        raise RunError(f"{out} is not empty; nothing is overwritten unasked")
    with Console(stderr=True).status("diagnosing ...") as status:
        found = diagnose_bag(
            bag, out, model, progress=lambda step: status.update(f"diagnosing: {step}")
        )
    console.print(f"verdict: [bold]{found.verdict.verdict}[/bold]")
    for effect in found.verdict.effects:
        console.print(f"- {effect['sentence']}")
    for reason in found.verdict.reasons:
        console.print(f"  {reason}")
    console.print(f"report: {(out / 'report.html').resolve()}")


@verbs.command()
def compare(
    simulated: Annotated[Path, typer.Argument(help="A bag of the simulation.")],
    recorded: Annotated[Path, typer.Argument(help="A recorded bag.")],
    out: Out = Path("comparison"),
) -> None:
    """Find where a recorded bag differs from a simulated one: joint, actuator or sensors.

    Writes report.html and compare.json.

    Example: ankle compare simulated_session session --out comparison
    """
    from ankle_bringup.errors import RunError
    from model_discrepancy.report.comparison_report import compare_bags

    if out.exists() and any(out.iterdir()):
        raise RunError(f"{out} is not empty; nothing is overwritten unasked")
    with Console(stderr=True).status("comparing ...") as status:
        result = compare_bags(
            simulated, recorded, out, progress=lambda step: status.update(f"comparing: {step}")
        )
    console.print(f"verdict: [bold]{result.verdict}[/bold]")
    console.print(result.headline, markup=False)
    console.print(f"report: {(out / 'report.html').resolve()}")


@verbs.command("design-experiment")
def design_experiment(
    verdict: Annotated[Path, typer.Argument(help="verdict.json of a diagnosis, or its folder.")],
    out: Out = Path("design"),
) -> None:
    """Propose the perturbation that tells the rivals of a verdict apart.

    Writes design.yaml, a parameter file of the perturbation generator, and design.png.

    Example: ankle design-experiment session_diagnosis --out design
    """
    from ankle_bringup.errors import RunError
    from model_discrepancy.tools.experiment_design import LISTED
    from model_discrepancy.tools.experiment_design import design_experiment as design

    if out.exists() and any(out.iterdir()):
        raise RunError(f"{out} is not empty; nothing is overwritten unasked")
    with Console(stderr=True).status("designing ...") as status:
        found = design(verdict, progress=lambda step: status.update(f"designing: {step}"))
    found.save(out)
    table = Table("perturbation", "hardest pair", "excess error [%]", "minutes")
    for proposal in found.proposals[:LISTED]:
        pair = " / ".join(name.replace("_", " ") for name in proposal.pair)
        table.add_row(
            proposal.candidate.title,
            pair,
            f"{100 * proposal.excess:.1f}",
            f"{proposal.minutes:.2g}",
        )
    if found.proposals:
        console.print(table)
    for sentence in [found.sentence, *found.other]:
        console.print(sentence, markup=False)
    if found.proposals:
        console.print(f"written to {out.resolve()}")


@verbs.command()
def resimulate(
    bag: Annotated[Path, typer.Argument(help="The recorded bag.")],
    diagnosis: Annotated[Path, typer.Argument(help="Folder that `ankle diagnose` wrote for it.")],
    out: Out = Path("resimulation"),
) -> None:
    """Run the recording's own movement through the simulation, with and without the new physics.

    Writes base_bag and augmented_bag, which `ankle compare` takes, and resimulation.png.

    Example: ankle resimulate session session_diagnosis --out session_simulated
    """
    from ankle_bringup.errors import RunError
    from model_discrepancy.tools.resimulation import resimulate_bag

    if out.exists() and any(out.iterdir()):
        raise RunError(f"{out} is not empty; nothing is overwritten unasked")
    result = resimulate_bag(bag, diagnosis, out)
    for name, share in result.vaf.items():
        console.print(
            f"{name} model: {share:.1f} % of the recorded torque, 0.1 to 80 Hz, without any refit"
        )
    console.print(f"written to {out.resolve()}")
