"""`ankle estimate`: joint impedance from a bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.table import Table

from ankle_bringup.terminal import Algorithm, Out, Overwrite, console, progress


def verb(
    bag: Annotated[Path, typer.Argument(help="A bag with ankle/samples.")],
    out: Out = Path("estimates"),
    algorithm: Algorithm = "",
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Estimate K, B, I and G from a bag, with the numbers that the node gives.

    Writes a bag with /impedance/estimate and /impedance/reflex_irf.

    Example: ankle estimate session --out session_estimates
    """
    from impedance_estimator.algorithms import DEFAULT
    from impedance_estimator.offline.recorded_estimates import estimate_bag

    with progress(f"estimating {bag}") as share:
        result = estimate_bag(bag, out, algorithm or DEFAULT, overwrite=overwrite, progress=share)
    for note in result.notes:
        console.print(f"note: {note}")
    median = result.median()
    table = Table("", "median", "unit")
    for name, value in median.items():
        quantity, unit = name.rstrip("]").split("[")
        table.add_row(quantity, f"{value:.4g}", unit)
    console.print(table)
    console.print(
        f"{len(result.valid)} of {len(result.rows)} estimates are valid; written to {out.resolve()}"
    )
    return {
        "out": out.resolve(),
        "estimates": len(result.rows),
        "valid": len(result.valid),
        "median": median,
        "notes": result.notes,
    }
