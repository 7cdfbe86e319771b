"""Keep a study: subjects, visits, recordings; process all of them, report, export."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Annotated, Any

import typer

from ankle_bringup.errors import RunError
from ankle_bringup.terminal import CORES, Scheduler, Workers, console, steps

verb = typer.Typer()

Folder = Annotated[Path, typer.Argument(help="The study's folder.")]
Subject = Annotated[str, typer.Option(help="Pseudonym, as S07.")]


@verb.command()
def init(
    folder: Folder, name: Annotated[str, typer.Option(help="What the study is called.")] = ""
) -> None:
    """Make a new study.

    Example: ankle study init my_study --name 'Reflex training 2026'
    """
    from session_analysis.study.layout import init_study

    made = init_study(folder, name)
    console.print(f"study '{made.name}' in {made.folder.resolve()}")
    console.print(f"next: ankle up rig --study {folder} --subject S01 --visit 1", soft_wrap=True)
    console.print(
        f"or, with a recording that is there already: ankle study add {folder} RECORDING "
        "--subject S01 --visit 1",
        soft_wrap=True,
    )


@verb.command("list")
def list_(folder: Folder) -> list[dict[str, Any]]:
    """List the recordings of a study.

    Example: ankle study list my_study
    """
    from session_analysis.study.layout import Study

    study = Study(folder)
    entries, failures = study.entries(), study.failures()
    states = {}
    for entry in entries:
        states[entry.name] = (
            "processed"
            if (study.derived(entry) / "results.json").exists()
            else "failed"
            if entry.name in failures
            else "new"
        )
        console.print(f"{entry.name}  {states[entry.name]}  {entry.source}", soft_wrap=True)
    for name in [name for name, state in states.items() if state == "failed"]:
        console.print(f"no result: {name}: {failures[name]}", soft_wrap=True)
    console.print(f"{len(entries)} recording(s) of {len({e.subject for e in entries})} subject(s)")
    return [
        {"name": entry.name, "source": entry.source, "state": states[entry.name]}
        for entry in entries
    ]


@verb.command()
def add(
    folder: Folder,
    recording: Annotated[Path, typer.Argument(help="A bag, or a file that 'ankle import' reads.")],
    subject: Subject,
    visit: Annotated[int, typer.Option(help="Counted from 1.")],
    sidecar: Annotated[
        Path | None, typer.Option(help="A JSON file with posture, side, body mass, ...")
    ] = None,
) -> None:
    """Copy a recording to its place in a study; one that the study holds already is refused.

    Example: ankle study add my_study trial.csv --subject S07 --visit 3
    """
    from dataclasses import replace

    from session_analysis.study.held_recordings import require_new
    from session_analysis.study.layout import Study, check_recording, read_stated

    check_recording(recording)
    stated = read_stated(sidecar) if sidecar else {}
    study = Study(folder)
    require_new(study, recording)
    entry = study.next_entry(subject, visit)
    if recording.is_file():
        source = entry.source.with_name(f"{entry.name}{recording.suffix.lower()}")
        entry = replace(entry, source=source)
    study.add(entry, stated)
    (shutil.copytree if recording.is_dir() else shutil.copyfile)(recording, entry.source)
    console.print(f"{recording} is copied to {entry.source}", soft_wrap=True)
    console.print(f"when all are there: ankle study run {folder}", soft_wrap=True)


@verb.command()
def run(
    folder: Folder,
    workers: Workers = CORES,
    scheduler: Scheduler = None,
    diagnose: Annotated[
        bool, typer.Option(help="Diagnose each recording as well; a minute and more for each.")
    ] = True,
) -> dict[str, Any]:
    """Import, estimate and diagnose every recording; what is done already is not done again.

    Writes derivatives/results.parquet: subject, visit, run, quantity, value, error, doubt.

    Example: ankle study run my_study --workers 4
    """
    from session_analysis.study.layout import Study
    from session_analysis.study.running import run_study

    study = Study(folder)
    with steps() as step:
        rows, failures = run_study(study, workers, scheduler, diagnose, step)
    for name, why in failures.items():
        console.print(f"no result: {name}: {why}", soft_wrap=True)
    console.print(f"{len(rows)} numbers in {study.results.resolve()}", soft_wrap=True)
    console.print(f"next: ankle study report {folder}", soft_wrap=True)
    if failures and not rows:
        raise RunError("no recording gave a result")
    return {"results": study.results.resolve(), "numbers": len(rows), "failures": failures}


@verb.command()
def report(
    folder: Folder,
    subject: Annotated[str, typer.Option(help="Only this subject.")] = "",
) -> None:
    """Write a report: each subject's visits, changes beyond the minimal detectable one, losses.

    Example: ankle study report my_study --subject S07
    """
    from session_analysis.study.conditions import read_about
    from session_analysis.study.layout import DERIVATIVES, Study
    from session_analysis.study.running import read_results
    from session_analysis.study.study_report import write_study_report

    study = Study(folder)
    rows = read_results(study.results)
    if subject and not any(row.subject == subject for row in rows):
        known = ", ".join(sorted({row.subject for row in rows})) or "none"
        raise RunError(f"no result of subject '{subject}'; there are results of {known}")
    failures = study.failures()
    name = f"report_{subject}.html" if subject else "report.html"
    title = f"{study.name}: subject {subject}" if subject else study.name
    path = study.folder / DERIVATIVES / name
    write_study_report(rows, failures, path, title, subject, read_about(study))
    console.print(f"look at {path.resolve()}", soft_wrap=True)


@verb.command()
def export(
    folder: Folder, out: Annotated[Path, typer.Option("--out", "-o", help="A new folder.")]
) -> None:
    """Write every recorded bag as BIDS: motion and EMG, for sharing.

    Example: ankle study export my_study --out my_study_bids
    """
    from session_analysis.study.bids_export import export_bids, left_out
    from session_analysis.study.layout import Study

    study = Study(folder)
    with steps() as step:
        written = export_bids(study, out, step)
    for name, why in left_out(study).items():
        console.print(f"not exported: {name}: {why}", soft_wrap=True)
    console.print(f"{len(written)} files of data in {out.resolve()}", soft_wrap=True)
