"""The parts that the verbs of the `ankle` command share: one console, one way to show progress,
common options.
"""

from __future__ import annotations

import dataclasses
import json
import math
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TaskProgressColumn, TextColumn, TimeRemainingColumn
from rich.status import Status
from rich.table import Column, Table

from ankle_bringup.errors import RunError
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity

# Square brackets are units here, as in "position[rad]", and never markup.
console = Console(markup=False, highlight=False)


def number_option(quantity: Quantity, what: str) -> Any:
    """Return an option that holds a number, checked before anything else is done.

    Parameters
    ----------
    quantity
        Name, unit and range of the number, which a refusal states.
    what
        What the number is, for the help.
    """

    def check(value: float | None) -> float | None:
        try:
            return None if value is None else quantity.check(value)  # type: ignore[return-value]
        except QuantityError as error:
            raise typer.BadParameter(str(error)) from None

    return typer.Option(callback=check, help=f"{what} Allowed: {quantity.allowed}.")


Out = Annotated[
    Path,
    typer.Option("--out", "-o", help="Where to write. Replaced only with --overwrite."),
]
StudyOut = Annotated[
    Path,
    typer.Option(
        "--out",
        "-o",
        file_okay=False,
        help="Folder of the study. An interrupted study goes on there.",
    ),
]
Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace what is at --out.")]
Algorithm = Annotated[
    str, typer.Option(help="Estimator: 'ankle run impedance_estimator impedance_estimator --help'.")
]
OwnTerms = Annotated[
    Path | None,
    typer.Option("--terms", help="Folder of terms of your own (Python files, which are run)."),
]
Namespace = Annotated[
    str, typer.Option(help="Namespace of the laboratory, as 'left'; empty: the root.")
]
SEED = Quantity("seed", "1", 0, 2**31 - 1, 1)
"""It ends where a signed integer of 32 bits does, which every generator of numbers takes."""
LOG_PERIOD = 10.0
"""[s] Shortest time between two lines of progress in a log: seldom enough to be read."""
CORES = os.cpu_count() or 1
Workers = Annotated[int, typer.Option(min=1, help="Processes on this machine.")]
Scheduler = Annotated[
    str | None, typer.Option(help="Address of a running Dask scheduler, instead of --workers.")
]


def clear_folder(out: Path, overwrite: bool, mark: str) -> None:
    """Make sure that a folder of results can be written anew.

    Parameters
    ----------
    out
        The folder; it need not exist.
    overwrite
        Whether an earlier result may be replaced.
    mark
        A file that each result of this kind has, such as ``verdict.json``. A folder without it is
        something else and is never removed.

    Raises
    ------
    RunError
        The folder is not empty, and it may not be or must not be replaced.
    """
    if not out.exists() or (out.is_dir() and not any(out.iterdir())):
        return
    if not overwrite:
        raise RunError(f"{out} is not empty; give another --out, or replace it with --overwrite")
    if not (out / mark).exists():
        raise RunError(
            f"{out} is not replaced: it has no '{mark}', so it is no earlier result of this verb"
        )
    shutil.rmtree(out)


class _NameTable(Table):
    """Shows a table whose first column is never cut where it holds names of one word."""

    def add_row(self, *cells: Any, **options: Any) -> None:
        """Add a row; a text of several words lets the first column be broken between them."""
        if cells and " " in str(cells[0]):
            self.columns[0].no_wrap = False
            self.columns[0].overflow = "fold"
        super().add_row(*cells, **options)


def new_table(columns: Iterable[str]) -> Table:
    """Return an empty table whose columns are broken where they are too long, except the first one
    where it holds names of one word: a name has to be typed as it stands there.

    Parameters
    ----------
    columns
        Titles of the columns.
    """
    first, *others = columns
    return _NameTable(Column(first, no_wrap=True, overflow="ignore"), *map(_folding, others))


def _folding(title: str) -> Column:
    return Column(title, overflow="fold")


class LogLines:
    """Writes progress as lines, at most one each `LOG_PERIOD`, where no terminal can redraw one.

    Parameters
    ----------
    out
        Where to; a terminal gets no lines.
    clock
        Gives the time [s].
    """

    def __init__(self, out: Console, clock: Callable[[], float] = time.monotonic) -> None:
        self._out, self._clock = out, clock
        self._last = clock()

    def __call__(self, line: str) -> None:
        """Write a line, or leave it out because it comes too early."""
        now = self._clock()
        if not self._out.is_terminal and now - self._last >= LOG_PERIOD:
            self._last = now
            self._out.print(line, soft_wrap=True)


def _errors() -> Console:
    return Console(stderr=True, markup=False, highlight=False, quiet=console.quiet)


def _bar(*columns: Any) -> Progress:
    # The text of a step is data, too: "K[N.m/rad]" must stay as it is.
    text = TextColumn("{task.description}", markup=False)
    shown = _errors()
    return Progress(
        text,
        BarColumn(),
        TaskProgressColumn(),
        *columns,
        console=shown,
        transient=True,
        disable=not shown.is_terminal,
    )


@contextmanager
def progress(what: str) -> Iterator[Callable[[float], None]]:
    """Show a progress bar; return a function that takes the done share, from 0 to 1."""
    with _bar(TimeRemainingColumn()) as bar:
        task, lines = bar.add_task(what, total=1.0), LogLines(bar.console)

        def show(share: float) -> None:
            bar.update(task, completed=share)
            lines(f"{what}: {100 * share:.0f} %")

        yield show


@contextmanager
def steps() -> Iterator[Callable[[str, float], None]]:
    """Show a progress bar for several steps.

    The returned function takes the name of the step and the done share of the whole, from 0 to 1.
    """
    with _bar() as bar:
        task, lines = bar.add_task("starting", total=1.0), LogLines(bar.console)

        def show(what: str, share: float) -> None:
            bar.update(task, description=what, completed=share)
            lines(f"{what}: {100 * share:.0f} %")

        yield show


class Work:
    """Shows the present step of work of unknown length; called with the step's name.

    Parameters
    ----------
    status
        The line that is shown while the work lasts.
    what
        The work, in front of each step.
    """

    def __init__(self, status: Status, what: str) -> None:
        self._status = status
        self._what = what
        self._lines = LogLines(status.console)

    def __call__(self, step: str) -> None:
        """Show the name of the present step."""
        self._status.update(f"{self._what}: {step}")
        self._lines(f"{self._what}: {step}")

    @contextmanager
    def paused(self) -> Iterator[None]:
        """Leave the terminal to something else, as a question, for as long."""
        self._status.stop()
        try:
            yield
        finally:
            self._status.start()


@contextmanager
def working(what: str) -> Iterator[Work]:
    """Show that work of unknown length goes on; what is returned takes the name of each step."""
    with _errors().status(f"{what} ...") as status:
        yield Work(status, what)


def as_json(result: Any) -> str:
    """Return the result of a verb as JSON text; numbers that are not finite become null.

    Parameters
    ----------
    result
        Mappings, sequences, dataclasses, NumPy numbers and arrays, paths, and what JSON has itself.
    """
    return json.dumps(_plain(result), ensure_ascii=False, indent=2)


def _plain(value: Any) -> Any:
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        return _plain({f.name: getattr(value, f.name) for f in dataclasses.fields(value)})
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if hasattr(value, "tolist"):  # an array or a number of NumPy
        return _plain(value.tolist())
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, (bool, int, str)) or value is None:
        return value
    if isinstance(value, Path):
        return str(value)
    return [_plain(item) for item in value]
