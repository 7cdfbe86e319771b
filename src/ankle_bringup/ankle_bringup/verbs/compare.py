"""`ankle compare`: where two bags differ."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import Out, Overwrite, OwnTerms, clear_folder, console, working


def verb(
    simulated: Annotated[Path, typer.Argument(help="A bag of the simulation.")],
    recorded: Annotated[Path, typer.Argument(help="A recorded bag.")],
    out: Out = Path("comparison"),
    joint: Annotated[
        str, typer.Option(help="ankle, knee, elbow, wrist, or a joint's file (YAML).")
    ] = "ankle",
    terms: OwnTerms = None,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Find where a recorded bag differs from a simulated one: joint, actuator or sensors.

    Writes report.html and compare.json.

    Example: ankle compare simulated_session session --out comparison
    """
    import json

    from ankle_physics.joint_profile import JointProfile
    from ankle_physics.own_terms import load_terms
    from model_discrepancy.report.comparison_report import compare_bags

    load_terms(terms or "")
    profile = JointProfile.load(joint)
    clear_folder(out, overwrite, "compare.json")
    with working("comparing") as step, profile.in_force():
        result = compare_bags(simulated, recorded, out, progress=step)
        headline = result.headline
    console.print(f"verdict: {result.verdict}", style="bold")
    console.print(headline)
    console.print(f"report: {(out / 'report.html').resolve()}")
    return {"out": out.resolve(), **json.loads((out / "compare.json").read_text())}
