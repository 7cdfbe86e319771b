"""Verbs that make one file from another: bags in and out, and what is estimated from them."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Optional

import typer
from rich.table import Table

from ankle_bringup.terminal import Out, console, progress

verbs = typer.Typer()


@verbs.command()
def estimate(
    bag: Annotated[Path, typer.Argument(help="A bag with /ankle/samples.")],
    out: Out = Path("estimates"),
    algorithm: Annotated[
        str, typer.Option(help="As the estimator node's parameter of that name.")
    ] = "",
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace what is at --out.")
    ] = False,
) -> None:
    """Estimate K, B, I and G from a bag, with the numbers that the node gives.

    Example: ankle estimate session --out session_estimates
    """
    from impedance_estimator.algorithms import DEFAULT
    from impedance_estimator.offline.recorded_estimates import estimate_bag

    with progress(f"estimating {bag}") as share:
        result = estimate_bag(bag, out, algorithm or DEFAULT, overwrite=overwrite, progress=share)
    for note in result.notes:
        console.print(f"note: {note}")
    table = Table("", "median", "unit")
    for name, value in result.median().items():
        quantity, unit = name.rstrip("]").split("[")
        table.add_row(quantity, f"{value:.4g}", unit)
    console.print(table)
    console.print(
        f"{len(result.valid)} of {len(result.rows)} estimates are valid; written to {out.resolve()}"
    )


@verbs.command()
def emg(
    bag: Annotated[
        Path,
        typer.Argument(
            help="A bag with /emg/samples and /perturbation/reference or /ankle/samples."
        ),
    ],
    out: Out = Path("emg_responses"),
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace what is at --out.")
    ] = False,
) -> None:
    """Background and reflex activity of every onset in a bag, with the numbers that the node gives.

    Writes a bag with /emg/responses and /emg/ensemble.

    Example: ankle emg session --out session_responses
    """
    from emg_driver.offline import respond_bag, summary

    with progress(f"reading {bag}") as share:
        found = respond_bag(bag, out, overwrite=overwrite, progress=share)
    for note in found.notes[:10]:
        console.print(f"note: {note}")
    table = Table("muscle", "onsets", "background [uV]", "reflex [uV.s]")
    for row in summary(found):
        table.add_row(*row)
    console.print(table)
    console.print(f"{len(found.rows)} onsets; written to {out.resolve()}")


@verbs.command("import")
def import_(
    source: Annotated[Path, typer.Argument(help="A .csv, .txt, .npz, .mat, .edf or .bdf file.")],
    out: Annotated[Path, typer.Option("--out", "-o", help="The new bag.")],
    column: Annotated[
        list[str],
        typer.Option(
            "--column", "-c", help="What a column is: 'name[unit]=column'. Repeat for each."
        ),
    ],
    torque_sign: Annotated[
        Optional[str],  # noqa: UP045
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
    overwrite: Annotated[
        bool, typer.Option("--overwrite", help="Replace a bag that is there.")
    ] = False,
) -> None:
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


@verbs.command()
def export(
    bag: Path,
    out: Annotated[Path, typer.Option("--out", "-o", help="Folder for CSV, file for NPZ.")],
    form: Annotated[str, typer.Option("--format", help="'csv' or 'npz'.")] = "csv",
    overwrite: Annotated[bool, typer.Option("--overwrite", help="Replace what is there.")] = False,
) -> None:
    """Write the sampled topics of a bag as CSV or NPZ, columns named with their units.

    Example: ankle export session -o session_csv
    """
    from session_recorder.exporting import export_bag

    with progress(f"exporting {bag}") as share:
        written = export_bag(bag, out, form, overwrite=overwrite, progress=share)
    for path in written:
        console.print(str(path))


@verbs.command()
def recover(
    bag: Path,
    out: Annotated[
        Path | None,
        typer.Option("--out", "-o", help="The repaired bag; beside the damaged one unless given."),
    ] = None,
) -> None:
    """Make a complete bag from one whose recorder was killed.

    Example: ankle recover session -o session_repaired
    """
    from session_recorder.recovery import recover as recover_bag

    with progress(f"reading {bag}") as share:
        recovered = recover_bag(bag, out, progress=share)
    for sentence in recovered.problems:
        console.print(f"note: {sentence}")
    console.print(f"{recovered.messages} messages in {recovered.path}")
