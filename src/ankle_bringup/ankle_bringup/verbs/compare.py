"""`ankle compare`: where two bags differ."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import Out, Overwrite, clear_folder, console, working


def verb(
    simulated: Annotated[Path, typer.Argument(help="A bag of the simulation.")],
    recorded: Annotated[Path, typer.Argument(help="A recorded bag.")],
    out: Out = Path("comparison"),
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Find where a recorded bag differs from a simulated one: joint, actuator or sensors.

    Writes report.html and compare.json.

    Example: ankle compare simulated_session session --out comparison
    """
    import json

    from model_discrepancy.report.comparison_report import compare_bags

    clear_folder(out, overwrite, "compare.json")
    with working("comparing") as step:
        result = compare_bags(simulated, recorded, out, progress=step)
    console.print(f"verdict: {result.verdict}", style="bold")
    console.print(result.headline)
    console.print(f"report: {(out / 'report.html').resolve()}")
    return {"out": out.resolve(), **json.loads((out / "compare.json").read_text())}
