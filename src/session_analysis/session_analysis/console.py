"""The result of `ankle validate`, in the terminal and as a report."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from rich.console import Console
from rich.table import Column, Table
from rich.text import Text

from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from impedance_estimator.algorithms import DEFAULT
from session_analysis.correlation import LEAST_PAIRS
from session_analysis.errors import AnalysisError
from session_analysis.known_of_session import GivenPhysics
from session_analysis.report import correlation_rows, doubt_sentence, write_report
from session_analysis.validation import Validation, validate


def report_validation(
    bags: Sequence[str],
    out: Path,
    recompute: bool,
    progress: Callable[[str, float], None] | None,
    console: Console,
    algorithm: str = DEFAULT,
    models: Sequence[Path] = (),
    rig: Path | None = None,
    without_rig: bool = False,
) -> Validation:
    """Validate sessions, write the report and print Table III.

    Parameters
    ----------
    bags
        Each as ``BAG`` or ``SUBJECT=BAG``.
    out
        Folder of the report; it must be new or empty.
    recompute
        Whether estimates and responses are made again from the samples.
    progress
        Called with the present step and the fraction done.
    console
        Where the table is shown.
    algorithm
        Of estimates that come from the samples.
    models
        Files of the subjects' models for estimates that come from the samples, one for each bag;
        empty takes the models that were in force, where their files are beside the bags.
    rig
        Rig file for estimates that come from the samples; None takes those that the bags carry.
    without_rig
        Leaves out the rig files that the bags carry.

    Returns
    -------
    Validation
        What was found.

    Raises
    ------
    AnalysisError
        `out` holds something, some bags have a subject and others not, there is not one model for
        each bag, or no hold can be used.
    BagError
        A bag that cannot be read.
    ModelError
        A file that is no model or no rig file.
    OSError
        Such a file cannot be read.
    """
    if out.exists() and (not out.is_dir() or any(out.iterdir())):
        raise AnalysisError(f"{out} is not an empty folder; nothing is overwritten unasked")
    named = [text.rpartition("=") for text in bags]
    subjects = [subject for subject, equals, _ in named if equals]
    if subjects and len(subjects) != len(bags):
        raise AnalysisError("either every bag is given as SUBJECT=BAG or none")
    if models and len(models) != len(bags):
        raise AnalysisError(
            f"--model is given {len(models)} time(s) for {len(bags)} recording(s); allowed: none, "
            "or one for each recording, in their order"
        )
    taken = RigFile.load(rig) if rig is not None else None
    given = [
        GivenPhysics(Model.load(models[number]) if models else None, taken, without_rig)
        for number in range(len(bags))
    ]
    found = validate(
        [Path(bag) for _, _, bag in named],
        subjects,
        recompute=recompute,
        progress=progress,
        algorithm=algorithm,
        given=given,
    )
    out.mkdir(parents=True, exist_ok=True)
    report = write_report(found, out, "Impedance estimates against EMG")
    if all(cell.correlation.n < LEAST_PAIRS for cell in found.cells):
        console.print(
            f"{len(found.measures)} holds used: too few for a correlation, which needs "
            f"{LEAST_PAIRS} of one torque target"
        )
    else:
        console.print(correlation_table(correlation_rows(found)))
    for note in found.origin_notes:
        console.print(f"note: {note}", markup=False, soft_wrap=True)
    console.print(doubt_sentence(found.measures), markup=False, soft_wrap=True)
    for one in found.excluded:
        console.print(f"left out: {one.what}: {one.reason}", markup=False)
    console.print(f"report: {report.resolve()}", markup=False)
    return found


def correlation_table(rows: Sequence[Sequence[str]]) -> Table:
    """Return Table III for a terminal.

    Parameters
    ----------
    rows
        Of `report.correlation_rows`, the heading first; the brackets of their intervals are text.
    """
    head, *rest = rows
    table = Table(*(Column(Text(cell)) for cell in head))
    for row in rest:
        table.add_row(*map(Text, row))
    return table
