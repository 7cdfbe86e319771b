"""`ankle validate`: impedance against EMG."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.known_rig import NO_RIG, KnownRig
from ankle_bringup.terminal import (
    Algorithm,
    Out,
    Overwrite,
    OwnTerms,
    clear_folder,
    console,
    steps,
)


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
    model: Annotated[
        list[Path] | None,
        typer.Option(
            help="With --recompute: the subject's model (YAML), once for each recording in their "
            "order; else the one that was in force, if its file is beside the recording."
        ),
    ] = None,
    rig: KnownRig = None,
    terms: OwnTerms = None,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Correlate K and G with EMG over the hold periods of recorded sessions: the paper's Table III
    and figures 4, 5, 8.

    Writes report.html, the pictures, table3.csv and holds.csv. Estimates that are made anew keep
    model and rig of the recording where they can be had; what cannot is said.

    Example: ankle validate anna=monday_1 anna=monday_2 ben=tuesday_1 --out validation
    """
    from ankle_physics.own_terms import load_terms
    from impedance_estimator.algorithms import DEFAULT
    from session_analysis.console import report_validation
    from session_analysis.report import doubt_sentence, session_rows

    load_terms(terms or "")
    clear_folder(out, overwrite, "holds.csv")
    with steps() as step:
        found = report_validation(
            bags,
            out,
            recompute,
            step,
            console,
            algorithm or DEFAULT,
            model or (),
            None if rig == NO_RIG else rig,
            without_rig=rig == NO_RIG,
        )
    head, *rows = session_rows(found.sessions)
    return {
        "out": out.resolve(),
        "report": (out / "report.html").resolve(),
        "holds": len(found.measures),
        "table3": found.cells,
        "left_out": found.excluded,
        "sessions": [dict(zip(head, row, strict=True)) for row in rows],
        "doubtful": doubt_sentence(found.measures),
        "notes": found.notes,
    }
