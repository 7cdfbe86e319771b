"""`ankle diagnose`: which physics a model leaves out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import Out, Overwrite, OwnTerms, clear_folder, console, working


def verb(
    bag: Annotated[Path, typer.Argument(help="A bag with ankle/samples.")],
    out: Out = Path("diagnosis"),
    model: Annotated[
        Path | None,
        typer.Option(help="A model file as the baseline, instead of the paper's model refitted."),
    ] = None,
    rig: Annotated[
        Path | None, typer.Option(help="The calibrated rig (rig.yaml), which is taken as known.")
    ] = None,
    joint: Annotated[
        str, typer.Option(help="ankle, knee, elbow, wrist, or a joint's file (YAML).")
    ] = "ankle",
    terms: OwnTerms = None,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Find where the joint model fails on a recording, and which physics was left out.

    Writes report.html, verdict.json and the augmented model.yaml, which ankle_sim loads.

    Example: ankle diagnose session --out session_diagnosis
    """
    import json

    from ankle_physics.joint_profile import JointProfile
    from ankle_physics.model import Model
    from ankle_physics.own_terms import load_terms
    from model_discrepancy.diagnose import diagnose

    load_terms(terms or "")
    profile = JointProfile.load(joint)
    clear_folder(out, overwrite, "verdict.json")
    with working("diagnosing") as step:
        with profile.in_force():
            baseline = Model.load(model) if model is not None else None
        found = diagnose(bag, out, baseline, progress=step, joint=profile, rig=rig)
    console.print(f"verdict: {found.verdict.verdict}", style="bold")
    for effect in found.verdict.effects:
        console.print(profile.in_units(f"- {effect['sentence']}"))
    for reason in found.verdict.reasons:
        console.print(profile.in_units(f"  {reason}"))
    console.print(f"report: {(out / 'report.html').resolve()}")
    return {"out": out.resolve(), **json.loads((out / "verdict.json").read_text())}
