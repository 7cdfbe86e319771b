"""`ankle validate`: impedance against EMG."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import Algorithm, Out, Overwrite, clear_folder, console, steps


def verb(
    bags: Annotated[
        list[str], typer.Argument(help="Recorded sessions, each as BAG or as SUBJECT=BAG.")
    ],
    out: Out = Path("validation"),
    recompute: Annotated[
        bool,
        typer.Option(
            "--recompute", help="Estimates and EMG responses from the samples, not as recorded."
        ),
    ] = False,
    algorithm: Algorithm = "",
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Correlate K and G with EMG over the hold periods of recorded sessions: the paper's Table III
    and figures 4, 5, 8.

    Writes report.html, the pictures, table3.csv and holds.csv.

    Example: ankle validate anna=monday_1 anna=monday_2 ben=tuesday_1 --out validation
    """
    from impedance_estimator.algorithms import DEFAULT
    from session_analysis.console import report_validation

    clear_folder(out, overwrite, "holds.csv")
    with steps() as step:
        found = report_validation(bags, out, recompute, step, console, algorithm or DEFAULT)
    return {
        "out": out.resolve(),
        "report": (out / "report.html").resolve(),
        "holds": len(found.measures),
        "table3": found.cells,
        "left_out": found.excluded,
        "notes": found.notes,
    }
