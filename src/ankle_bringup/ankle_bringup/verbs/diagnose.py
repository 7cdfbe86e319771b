"""`ankle diagnose`: which physics a model leaves out."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.at_most import DEFAULT_MINUTES, AtMost
from ankle_bringup.errors import RunError
from ankle_bringup.known_rig import KnownRig, known_rig
from ankle_bringup.terminal import Out, Overwrite, OwnTerms, clear_folder, console, working


def verb(
    bags: Annotated[
        list[Path], typer.Argument(help="A bag with ankle/samples; several of one rig: together.")
    ],
    out: Out = Path("diagnosis"),
    model: Annotated[
        Path | None,
        typer.Option(help="A model file as the baseline, instead of the paper's model refitted."),
    ] = None,
    rig: KnownRig = None,
    joint: Annotated[
        str, typer.Option(help="ankle, knee, elbow, wrist, or a joint's file (YAML).")
    ] = "ankle",
    terms: OwnTerms = None,
    at_most: AtMost = None,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Find where the joint model fails on a recording, and which physics was left out.

    Takes a minute or two for a minute of a simulation, and ten for one of a person. Writes
    report.html, verdict.json and the augmented model.yaml, which ankle_sim loads. A recording that
    cannot be used gets a report, too, and fails. Several recordings are searched together: what
    belongs to the rig is the same in all of them, what belongs to the subject is each recording's
    own, and each gets a model file of its own.

    A search that ends by --at-most says so; it may find less on a slower computer. Without that it
    finds the same on each.

    Example: ankle diagnose session --out session_diagnosis
    """
    from ankle_physics.joint_profile import JointProfile
    from ankle_physics.model import Model
    from ankle_physics.own_terms import load_terms
    from model_discrepancy.diagnose import diagnose
    from model_discrepancy.errors import DiagnosisError
    from model_discrepancy.report.several_report import write_several
    from model_discrepancy.tools.several_recordings import diagnose_together

    load_terms(terms or "")
    profile = JointProfile.load(joint)
    if at_most is not None and len(bags) > 1:
        raise RunError("--at-most is the time for one recording; several are searched to the end")
    if model is not None and len(bags) > 1:
        raise RunError("--model is the baseline of one recording; several begin from the joint's")
    with profile.in_force():
        baseline = Model.load(model) if model is not None else None
    known, carried = known_rig(rig, bags)
    clear_folder(out, overwrite, "verdict.json")
    if carried:
        console.print(carried, soft_wrap=True)
    with working("diagnosing") as step:
        if len(bags) > 1:
            together = diagnose_together(bags, progress=step, joint=profile, rig=known)
            with profile.in_force():
                together.save(out)
                write_several(together, out / "report.html")
            return _findings(out, [e.sentence for e in together.named], together.verdict)
        minutes = DEFAULT_MINUTES if at_most is None else at_most
        found = diagnose(
            bags[0], out, baseline, progress=step, joint=profile, rig=known, at_most=minutes
        )
    lines = [f"- {effect['sentence']}" for effect in found.verdict.effects]
    lines += [f"  {reason}" for reason in found.verdict.reasons]
    answer = _findings(out, [profile.in_units(line) for line in lines], found.verdict.verdict)
    if found.verdict.verdict == "bad_recording":
        raise DiagnosisError(f"{bags[0]} cannot be used: {found.verdict.reasons[0]}")
    return answer


def _findings(out: Path, lines: list[str], verdict: str) -> dict[str, Any]:
    """Print what was found; the answer of the verb."""
    import json

    console.print(f"verdict: {verdict}", style="bold")
    for line in lines:
        console.print(line)
    written = json.loads((out / "verdict.json").read_text())
    for line in base_values(written.get("parameters") or {}):
        console.print(line, soft_wrap=True)
    console.print(f"report: {(out / 'report.html').resolve()}")
    return {"out": out.resolve(), **written}


def base_values(parameters: dict[str, dict[str, float | None]]) -> list[str]:
    """Return K and G with and without the physics that was found, and what compares with them.

    Parameters
    ----------
    parameters
        Of a verdict: values ``base`` and ``augmented`` with ``standard_error``, by quantity.
    """
    from ankle_interfaces.value_text import three_digits, with_error, with_unit

    lines, differs = [], False
    for quantity in ("K[N.m/rad]", "G[N.m.s/rad]"):
        found = parameters.get(quantity) or {}
        base, augmented = found.get("base"), found.get("augmented")
        if base is None or augmented is None:
            continue
        error = found.get("standard_error")
        stated = with_error((augmented, float("nan") if error is None else error))
        line = f"{with_unit(quantity)}: {stated}"
        if augmented != base:
            line += f" with all that was found; {three_digits(base)} where that is left out"
            differs = True
        lines.append(line)
    if differs:
        lines.append(
            "  (at the recording's mean position and torque. 'ankle estimate' knows no more than "
            "inertia, viscosity, stiffness and one reflex: it compares with the values where the "
            "rest is left out; with --model it takes what was found in)"
        )
    return lines
