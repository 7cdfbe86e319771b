"""`ankle virtual-study`: the paper's experiment with simulated subjects."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import SEED, StudyOut, console, number_option, steps


def verb(
    out: StudyOut = Path("virtual_study"),
    steady: Annotated[
        bool,
        typer.Option(
            "--cannot-modulate", help="Subjects whose stiffness and reflexes stay the same."
        ),
    ] = False,
    seed: Annotated[int, number_option(SEED, "Draws states, noise and perturbation.")] = 1,
) -> dict[str, Any]:
    """Lead three simulated subjects through the paper's experiment, record them as bags and
    validate these like real ones (about 15 minutes).

    Writes subject_1 to subject_3 (bags of 45 minutes, together 1.2 GB) and validation/; bags that
    are there are used again.

    Example: ankle virtual-study --out virtual_study
    """
    from session_analysis.console import report_validation
    from session_analysis.virtual_study import paper_study, record_study

    with steps() as step:
        bags = record_study(paper_study(not steady, seed), out, step)
        report_validation([str(bag) for bag in bags], out / "validation", False, step, console)
    return {"out": out.resolve(), "bags": bags, "report": (out / "validation").resolve()}
