"""`ankle import`: a recording of another system as a bag."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from ankle_bringup.errors import RunError
from ankle_bringup.terminal import Overwrite, console, progress

if TYPE_CHECKING:
    from session_recorder.importing import ImportReport, Proposal


def verb(
    source: Annotated[
        Path,
        typer.Argument(
            help="A text file (.csv, .txt, .tsv, .dat, .lvm), .xlsx, .parquet, .npz, .mat (all "
            "versions), .h5, .edf, .bdf, .c3d or .tdms."
        ),
    ],
    out: Annotated[
        Path | None,
        typer.Option(
            "--out", "-o", help="The new bag; else named after the SHA-256 of the file's content."
        ),
    ] = None,
    column: Annotated[
        list[str],
        typer.Option(
            "--column",
            "-c",
            help="What a column is: 'name[unit]=column'. Repeat for each. Without any, a mapping "
            "is proposed.",
        ),
    ] = [],  # noqa: B006
    section: Annotated[
        list[str],
        typer.Option(
            help="Title or number of the table to read, where the file holds several: a sheet, or "
            "tables below one another. Repeat it to join tables of different rates. Without it "
            "what holds an ankle's signals is read."
        ),
    ] = [],  # noqa: B006
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
    resample: Annotated[
        float | None,
        typer.Option(
            help="Interpolate irregular samples onto an even grid of this rate [Hz]; 0 takes their "
            "mean rate."
        ),
    ] = None,
    neutral: Annotated[
        float | None,
        typer.Option(
            help="The file's angle of the neutral ankle, in its own unit; it is taken off. 90 "
            "where the file counts the angle between shank and foot."
        ),
    ] = None,
    positive: Annotated[
        str | None,
        typer.Option(
            help="The direction in which the file's angle rises: 'dorsiflexion', which is assumed, "
            "or 'plantarflexion', with which angle, velocity and torque are turned round."
        ),
    ] = None,
    missing: Annotated[
        str,
        typer.Option(help="Samples that are not finite: 'nan' keeps them, 'gap' leaves them out."),
    ] = "nan",
    accept: Annotated[
        bool, typer.Option("--yes", "-y", help="Import as proposed, without asking.")
    ] = False,
    force: Annotated[
        bool, typer.Option("--force", help="Import in spite of contradictions; the bag says so.")
    ] = False,
    rig: Annotated[
        Path | None,
        typer.Option(help="The calibrated rig (rig.yaml) that was in force; the bag carries it."),
    ] = None,
    keep_source_name: Annotated[
        bool,
        typer.Option(
            "--keep-source-name",
            help="Keep the file's name in the bag. It may hold a person's name, so that otherwise "
            "the bag states SHA-256, format and size alone.",
        ),
    ] = False,
    overwrite: Overwrite = False,
) -> dict[str, Any]:
    """Import a recording into a bag; wrong units and signs are recognised from the data and
    refused.

    Without --column it says what the columns are likely to be, why, and which line imports them.

    Example: ankle import trial.npz -o trial -c 't[s]=time' -c 'position[rad]=position' -c
    'torque[N.m]=torque' --torque-sign subject
    """
    from ankle_physics.rig_file import RigFile
    from session_recorder.importing import import_recording, propose, read_table
    from session_recorder.importing.source_of_bag import default_bag

    stated = dict(_statement(text) for text in column)
    with progress(f"reading {source}") as share:
        table = read_table(source, section, tuple(stated.values()))
        table.rate = rate or table.rate
        share(1.0)
        proposal = None if stated else propose(table)
    target = out or default_bag(source, keep_source_name)
    if proposal is not None:
        stated = dict(proposal.columns)
        torque_sign = torque_sign or proposal.torque_sign
        rate = rate or proposal.rate
        resample = proposal.resample if resample is None else resample
        neutral = proposal.neutral = proposal.neutral if neutral is None else neutral
        positive = proposal.positive = positive or proposal.positive
        _show(proposal, source, target, keep_source_name)
        if not accept and not _agreed():
            raise RunError("nothing is imported yet: type the line above, or add --yes")
    if not overwrite and target.exists() and not (target.is_dir() and not any(target.iterdir())):
        raise RunError(f"{target} is there already; give another --out, or add --overwrite")
    with progress(f"importing {source}") as share:
        report = import_recording(
            table,
            target,
            stated,
            torque_sign=torque_sign,
            rate=rate,
            resample=resample,
            neutral=neutral,
            positive=positive,
            missing=missing,
            force=force,
            rig=RigFile.load(rig) if rig is not None else None,
            overwrite=overwrite,
            keep_source_name=keep_source_name,
            progress=share,
        )
    _summarise(report)
    return {
        "out": target.resolve(),
        "samples": report.samples,
        "duration[s]": report.duration,
        "rate[Hz]": report.rate,
        "columns": report.columns,
        "notes": report.warnings,
    }


def _statement(text: str) -> tuple[str, str]:
    name, equals, column = text.partition("=")
    if not equals:
        raise RunError(f"--column '{text}' is not 'name[unit]=column', as in 'position[deg]=angle'")
    return name, column


def _show(proposal: Proposal, source: Path, out: Path, keep_name: bool) -> None:
    console.print(f"{source} is likely to hold:")
    for name, held in proposal.columns.items():
        console.print(f"  {name} in column '{held}'")
    for sentence in proposal.reasons:
        console.print(f"because: {sentence}")
    for sentence in proposal.doubts:
        console.print(f"in doubt: {sentence}")
    console.print("The line to type:")
    kept = " --keep-source-name" if keep_name else ""
    console.print(f"  {proposal.command(source, out)}{kept}", soft_wrap=True)


def _agreed() -> bool:
    return sys.stdin.isatty() and typer.confirm("Import like this?")


def _summarise(report: ImportReport) -> None:
    for sentence in report.warnings:
        console.print(f"note: {sentence}")
    console.print(f"{report.samples} samples, {report.duration:.1f} s at {report.rate:.6g} Hz")
    for topic, columns in report.columns.items():
        console.print(f"  {topic} at {report.rates[topic]:.6g} Hz: {', '.join(columns)}")
    if report.ignored:
        console.print(f"not imported: {', '.join(report.ignored)}")
    if report.intrinsic is not None:
        console.print(
            f"units and sign fit: inertia {report.intrinsic.inertia:.3g} ± "
            f"{report.intrinsic.inertia_error:.1g} kg.m^2"
        )
        console.print(
            f"  (a rough check from 5 to 40 Hz, in which torque and angle rise together by "
            f"{report.intrinsic.stiffness:.3g} ± {report.intrinsic.stiffness_error:.1g} N.m/rad, "
            "reflex included; K without the reflex is what 'ankle estimate' states)",
            soft_wrap=True,
        )
    console.print(f"written to {report.bag.resolve()}")
    console.print(_next(report), soft_wrap=True)


def _next(report: ImportReport) -> str:
    """Return the next command, or why there is no estimate."""
    from ankle_interfaces.topics import ANKLE_SAMPLES
    from impedance_estimator.estimator import LEAST_RATE

    held = {column.split("[")[0] for column in report.columns.get(ANKLE_SAMPLES.absolute, ())}
    absent = [name for name in ("position", "torque") if name not in held]
    if absent:
        return f"no estimate: the bag holds no {' and no '.join(absent)}"
    if report.rate < LEAST_RATE:
        return (
            f"no estimate below {LEAST_RATE:g} Hz: import again with --resample 1024; what is "
            f"faster than {report.rate / 2:.4g} Hz stays absent"
        )
    return f"next: ankle estimate {report.bag} --out {report.bag}_estimates"
