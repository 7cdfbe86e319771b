"""`ankle resimulate`: a recording's movement through the simulation."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import Out, Overwrite, OwnTerms, clear_folder, console, working


def verb(
    bag: Annotated[Path, typer.Argument(help="The recorded bag.")],
    diagnosis: Annotated[Path, typer.Argument(help="Folder that `ankle diagnose` wrote for it.")],
    out: Out = Path("resimulation"),
    terms: OwnTerms = None,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Run the recording's own movement through the simulation, with and without the new physics.

    Writes base_bag and augmented_bag, which `ankle compare` takes, and resimulation.png.

    Example: ankle resimulate session session_diagnosis --out session_simulated
    """
    from ankle_physics.own_terms import load_terms
    from model_discrepancy.report.plain_words import vaf_text
    from model_discrepancy.tools.resimulation import resimulate_bag

    load_terms(terms or "")
    clear_folder(out, overwrite, "resimulation.png")
    with working("simulating"):
        result = resimulate_bag(bag, diagnosis, out)
    for name, share in result.vaf.items():
        console.print(
            f"{name} model: {vaf_text(share)} % of the recorded torque, 0.1 to 80 Hz, without any "
            "refit"
        )
    console.print(f"written to {out.resolve()}")
    return {"out": out.resolve(), "vaf[%]": result.vaf}
