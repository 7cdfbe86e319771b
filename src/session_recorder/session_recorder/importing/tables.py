"""A file of any kind as a table: which module reads it, and where."""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from importlib import import_module
from pathlib import Path

from session_recorder.errors import ImportRefused
from session_recorder.importing.clocks import own_times
from session_recorder.importing.reading_process import read_apart
from session_recorder.importing.sections import choose_section
from session_recorder.importing.table import Table

READERS = {
    **dict.fromkeys((".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm"), "text_tables"),
    **dict.fromkeys((".mot", ".sto"), "text_tables"),
    ".npz": "array_tables",
    ".mat": "array_tables",
    **dict.fromkeys((".h5", ".hdf5"), "array_tables"),
    ".xlsx": "sheet_tables",
    ".parquet": "sheet_tables",
    **dict.fromkeys((".edf", ".bdf"), "edf_tables"),
    ".c3d": "motion_capture_tables",
    ".tdms": "tdms_tables",
}
"""Module of this package that reads a kind of file, by its ending."""
ENDINGS_READ_APART = (".mat", ".h5", ".hdf5", ".c3d")
"""Endings of files that are read in a process of their own: damaged ones make their libraries crash
or hang."""


def read_table(
    path: Path | str, section: str | Sequence[str] = (), wanted: Collection[str] = ()
) -> Table:
    """Read a file.

    Parameters
    ----------
    path
        Text (``.csv``, ``.txt``, ``.tsv``, ``.dat``, ``.asc``, ``.lvm``, ``.mot``, ``.sto``),
        ``.npz``, ``.mat`` (all versions), ``.h5``, ``.xlsx``, ``.parquet``, ``.edf``, ``.bdf``,
        ``.c3d`` or ``.tdms``.
    section
        Title or number of a table, where the file holds several: a sheet, or one below another.
        Several are joined, each with its own times. Without any, what holds an ankle's signals is
        read.
    wanted
        Columns that the table has to hold; empty where they are not known yet.

    Returns
    -------
    Table
        Text columns go by their header, or by number from ``1`` without one; arrays by name, fields
        of a structure by ``name.field``, columns of a matrix by ``name:1``, ``name:2``, ...;
        signals of other files by their label. Where tables are joined, a name that an earlier one
        has as well is ``title/name``.

    Raises
    ------
    ImportRefused
        No such file, not a format that is read, not readable as what its name says, several of its
        tables can be meant, or those asked for cannot be joined.
    """
    source = Path(path)
    module = READERS.get(source.suffix.lower())
    if module is None:
        raise ImportRefused(
            f"{source}: '{source.suffix}' is not read; expected one of {', '.join(READERS)}"
        )
    if not source.is_file():
        raise ImportRefused(f"{source}: no such file")
    try:
        apart = source.suffix.lower() in ENDINGS_READ_APART
        tables = read_apart(source, module) if apart else _reader(module)(source)
    except ImportRefused:
        raise
    except OSError as error:
        raise ImportRefused(f"{source}: {error.strerror or error}") from None
    except Exception as error:  # the libraries raise dozens of kinds on damaged files
        raise ImportRefused(
            f"{source} is not a readable '{source.suffix}' file: {error or type(error).__name__}"
        ) from None
    tables = [table for table in tables if table.columns or table.refused]
    if not tables:
        raise ImportRefused(f"{source} holds no column of numbers")
    asked = (section,) if isinstance(section, str) else section
    chosen = choose_section(tables, asked, wanted)
    if len(chosen.sections) < 2:
        chosen.times = own_times(chosen)
    return chosen


def _reader(module: str) -> Callable[[Path], list[Table]]:
    read: Callable[[Path], list[Table]] = import_module(f"session_recorder.importing.{module}").read
    return read
