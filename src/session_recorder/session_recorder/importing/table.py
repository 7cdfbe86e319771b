"""A table of a file: named columns of numbers, and what the file says about them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path

import numpy as np

from session_recorder.errors import ImportRefused

TIME = "t"
"""Name of the column with the time since the start [s], where the file states a sampling rate."""


@dataclass(eq=False)
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
    times
        Time column of a column, where the file has several that differ; see `clocks.own_times`.
    refused
        Columns that are there and cannot be used, by name with the reason.
    notes
        What a reader should know about how the file was read, one sentence each.
    section
        Title or number of the table, where the file holds several; empty where it holds one.
    sections
        Titles or numbers of all tables of the file that are in this one, where it holds several.
    """

    source: Path
    columns: dict[str, np.ndarray] = field(default_factory=dict)
    units: dict[str, str] = field(default_factory=dict)
    rates: dict[str, float] = field(default_factory=dict)
    rate: float | None = None
    times: dict[str, str] = field(default_factory=dict)
    refused: dict[str, str] = field(default_factory=dict)
    notes: list[str] = field(default_factory=list)
    section: str = ""
    sections: tuple[str, ...] = ()

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
        # In its place, because the order says which time column a signal follows.
        self.columns = {new if n == old else n: values for n, values in self.columns.items()}
        if old in self.units:
            self.units[new] = self.units.pop(old)
        if old in self.rates:
            self.rates[new] = self.rates.pop(old)


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
