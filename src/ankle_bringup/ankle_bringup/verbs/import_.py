"""`ankle import`: a recording of another system as a bag."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.terminal import Overwrite, console, progress


def verb(
    source: Annotated[Path, typer.Argument(help="A .csv, .txt, .npz, .mat, .edf or .bdf file.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The new bag.")],
    column: Annotated[
        list[str],
        typer.Option(
            "--column", "-c", help="What a column is: 'name[unit]=column'. Repeat for each."
        ),
    ],
    torque_sign: Annotated[
        str | None,
        typer.Option(
            help="'rig': torque that moves the ankle, positive in dorsiflexion; 'subject': the "
            "opposite."
        ),
    ] = None,
    rate: Annotated[
        float | None, typer.Option(help="Sampling rate [Hz]; needed without a time column.")
    ] = None,
    missing: Annotated[
        str,
        typer.Option(help="Samples that are not finite: 'nan' keeps them, 'gap' leaves them out."),
    ] = "nan",
    force: Annotated[
        bool, typer.Option("--force", help="Import in spite of contradictions; the bag says so.")
    ] = False,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Import a recording into a bag; wrong units and signs are recognised from the data and
    refused.

    Example: ankle import trial.npz -o trial -c 't[s]=time' -c 'position[rad]=position' -c
    'torque[N.m]=torque' --torque-sign subject
    """
    from ankle_bringup.errors import GraphError
    from session_recorder.importing import import_recording

    stated = {}
    for text in column:
        name, equals, source_column = text.partition("=")
        if not equals:
            raise GraphError(
                f"--column '{text}' is not 'name[unit]=column', as in 'position[deg]=angle'"
            )
        stated[name] = source_column
    with progress(f"importing {source}") as share:
        report = import_recording(
            source,
            out,
            stated,
            torque_sign=torque_sign,
            rate=rate,
            missing=missing,
            force=force,
            overwrite=overwrite,
            progress=share,
        )
    for sentence in report.warnings:
        console.print(f"note: {sentence}")
    console.print(f"written to {out.resolve()}")
    return {"out": out.resolve(), "notes": report.warnings}
