"""`ankle design-experiment`: what to measure next."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.errors import RunError
from ankle_bringup.terminal import (
    Out,
    Overwrite,
    OwnTerms,
    clear_folder,
    console,
    new_table,
    working,
)

VERDICT_FILE = "verdict.json"
ADVICE = "give the folder that 'ankle diagnose' has written"


def verb(
    verdict: Annotated[Path, typer.Argument(help="verdict.json of a diagnosis, or its folder.")],
    out: Out = Path("design"),
    terms: OwnTerms = None,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Propose the perturbation that tells the rivals of a verdict apart.

    Rivals are effects that a diagnosis could not choose between. Takes up to a minute. Writes
    design.yaml, a parameter file of the perturbation generator, and design.png.

    Example: ankle design-experiment session_diagnosis --out design
    """
    from ankle_physics.own_terms import load_terms
    from model_discrepancy.tools.experiment_design import LISTED_DESIGNS, design_experiment
    from model_discrepancy.tools.movement_ranking import percent

    load_terms(terms or "")
    if not verdict.exists():
        raise RunError(f"there is no {verdict}; {ADVICE}")
    if verdict.is_dir() and not (verdict / VERDICT_FILE).exists():
        raise RunError(f"{verdict} holds no {VERDICT_FILE}; {ADVICE}")
    clear_folder(out, overwrite, "design.yaml")
    with working("designing") as step:
        found = design_experiment(verdict, progress=step)
    found.save(out)
    proposals = [
        {
            "perturbation": found.joint.in_units(proposal.candidate.title),
            "hardest pair": " / ".join(name.replace("_", " ") for name in proposal.pair),
            "error of the wrong one [+%]": percent(proposal.excess),
            "minutes": "under 1" if proposal.minutes < 1.0 else f"{proposal.minutes:.2g}",
        }
        for proposal in found.proposals[:LISTED_DESIGNS]
    ]
    if proposals:
        table = new_table(proposals[0])
        for proposal in proposals:
            table.add_row(*proposal.values())
        console.print(table)
    for sentence in found.sentences:
        console.print(sentence)
    if proposals:
        console.print(f"written to {out.resolve()}")
    return {
        "out": out.resolve(),
        "proposals": proposals,
        "sentences": found.sentences,
    }
