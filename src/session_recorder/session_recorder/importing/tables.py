"""A file of any kind as a table: named columns of numbers, and what the file says about them."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.sections import choose_section

TIME = "t"
"""Name of the column with the time since the start [s], where the file states a sampling rate."""
READERS = {
    **dict.fromkeys((".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm"), "text_tables"),
    **dict.fromkeys((".mot", ".sto"), "text_tables"),
    ".npz": "array_tables",
    ".mat": "array_tables",
    **dict.fromkeys((".h5", ".hdf5"), "array_tables"),
    ".xlsx": "sheet_tables",
    ".parquet": "sheet_tables",
    **dict.fromkeys((".edf", ".bdf"), "edf_tables"),
    ".c3d": "device_tables",
    ".tdms": "device_tables",
}
"""Module of this package that reads a kind of file, by its ending."""


@dataclass
class Table:
    """Holds the columns of one file, or of one of the tables that it holds.

    Attributes
    ----------
    source
        The file.
    columns
        Numbers by name, each of shape (n,); a missing cell is NaN.
    units
        The project's unit of a column, where the file declares one.
    rates
        Sampling rate [Hz] of a column, where the file states it by column.
    rate
        Sampling rate [Hz] that the file states for all of it; None without.
    refused
        Columns that are there and cannot be used, by name with the reason.
    notes
        What a reader should know about how the file was read, one sentence each.
    section
        Title or number of the table, where the file holds several; empty where it holds one.
    """

    source: Path
    columns: dict[str, np.ndarray] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    rates: dict[str, float] = field(default_factory=dict)
    rate: float | None = None
    refused: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    section: str = ""

    @property
    def names(self) -> list[str]:
        """Return the names of every column, also of those that are refused."""
        return [*self.columns, *(name for name in self.refused if name not in self.columns)]

    def choose(self, wanted: Collection[str]) -> dict[str, np.ndarray]:
        """Return columns of equal length and rate.

        Parameters
        ----------
        wanted
            Names. `TIME` is made from the sampling rate where the file states one.

        Returns
        -------
        dict[str, np.ndarray]
            The columns by name, each of shape (n,).

        Raises
        ------
        ImportRefused
            A column is not there or refused, or lengths or rates differ.
        """
        chosen = {}
        for name in wanted:
            if name in self.columns:
                chosen[name] = self.columns[name]
            elif name in self.refused:
                raise ImportRefused(self.refused[name])
            elif name != TIME or not (self.rates or self.rate):
                held = [TIME, *self.names] if self.rates else self.names
                raise ImportRefused(
                    f"{self.source} has no column '{name}'; it holds {', '.join(held) or 'none'}"
                )
        rates = {name: self.rates[name] for name in chosen if name in self.rates}
        if len(set(rates.values())) > 1:
            raise ImportRefused(
                f"{self.source}: the signals have different sampling rates: "
                f"{', '.join(f'{n} {r:g} Hz' for n, r in rates.items())}"
            )
        lengths = {name: len(column) for name, column in chosen.items()}
        if len(set(lengths.values())) > 1:
            raise ImportRefused(
                f"{self.source}: columns of different length: "
                f"{', '.join(f'{name} {n}' for name, n in lengths.items())}"
            )
        if TIME in wanted and TIME not in chosen:
            rate = next(iter(rates.values()), self.rate)
            if rate is None or not lengths:
                raise ImportRefused(f"{self.source} states no sampling rate for '{TIME}'")
            chosen[TIME] = np.arange(next(iter(lengths.values()))) / rate
        return {name: chosen[name] for name in wanted}

    def add(
        self,
        name: str,
        values: np.ndarray,
        unit: str | None = None,
        rate: float | None = None,
    ) -> None:
        """Add a column; where the name is there already, both get a number behind it.

        Parameters
        ----------
        name
            Name of the column in the file.
        values
            Values of the column, shape (n,).
        unit
            The project's unit, where the file declares one.
        rate
            Sampling rate [Hz], where the file states it for this column.
        """
        if name in self.columns or name in self.refused:
            self.refused[name] = (
                f"{self.source} has more than one column '{name}'; they are '{name}:1', "
                f"'{name}:2', ..., in the file's order"
            )
            if name in self.columns:
                self._rename(name, f"{name}:1")
            name = f"{name}:{1 + sum(other.startswith(f'{name}:') for other in self.columns)}"
        self.columns[name] = values
        if unit:
            self.units[name] = unit
        if rate:
            self.rates[name] = rate

    def _rename(self, old: str, new: str) -> None:
        self.columns[new] = self.columns.pop(old)
        if old in self.units:
            self.units[new] = self.units.pop(old)
        if old in self.rates:
            self.rates[new] = self.rates.pop(old)


def read_table(path: Path | str, section: str | None = None, wanted: Collection[str] = ()) -> Table:
    """Read a file.

    Parameters
    ----------
    path
        Text (``.csv``, ``.txt``, ``.tsv``, ``.dat``, ``.asc``, ``.lvm``, ``.mot``, ``.sto``),
        ``.npz``, ``.mat`` (all versions), ``.h5``, ``.xlsx``, ``.parquet``, ``.edf``, ``.bdf``,
        ``.c3d`` or ``.tdms``.
    section
        Title or number of a table, where the file holds several: a sheet, or one below another.
        None takes the one that holds an ankle's signals.
    wanted
        Columns that the table has to hold; empty where they are not known yet.

    Returns
    -------
    Table
        Text columns go by their header, or by number from ``1`` without one; arrays by name, fields
        of a structure by ``name.field``, columns of a matrix by ``name:1``, ``name:2``, ...;
        signals of other files by their label.

    Raises
    ------
    ImportRefused
        No such file, not a format that is read, not readable as what its name says, or several
        of its tables can be meant.
    """
    source = Path(path)
    room = READERS.get(source.suffix.lower())
    if room is None:
        raise ImportRefused(
            f"{source}: '{source.suffix}' is not read; expected one of {', '.join(READERS)}"
        )
    if not source.is_file():
        raise ImportRefused(f"{source}: no such file")
    read: Callable[[Path], list[Table]] = import_module(f"session_recorder.importing.{room}").read
    try:
        tables = read(source)
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
    return choose_section(tables, section, wanted)


def optional_library(name: str, source: Path, kind: str) -> object:
    """Import a library that only one kind of file needs.

    Raises
    ------
    ImportRefused
        It is not installed; the message says how to install it.
    """
    try:
        return import_module(name.partition(":")[0])
    except ImportError:
        package = name.partition(":")[2] or name
        raise ImportRefused(
            f"{source}: {kind} files need the package '{package}', which is not installed; "
            f"install it with: pip install {package}"
        ) from None
