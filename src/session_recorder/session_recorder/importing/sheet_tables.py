"""Sheets: Excel workbooks and Parquet files."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.cell_grid import (
    CONFIRMING_ROWS,
    MAX_HEADER_ROWS,
    Layout,
    Numbers,
    numbers_of,
    section_end,
    understand,
)
from session_recorder.importing.cells import Cell
from session_recorder.importing.laboratory_units import known_unit, split_header
from session_recorder.importing.table import Table, optional_library


def read(source: Path) -> list[Table]:
    """Read a Parquet file as one table, or each table of each sheet of a workbook.

    Raises
    ------
    ImportRefused
        It is not such a file, holds no numbers, or its library is not installed.
    """
    return [_parquet(source)] if source.suffix.lower() == ".parquet" else _xlsx(source)


def _parquet(source: Path) -> Table:
    parquet: Any = optional_library("pyarrow.parquet:pyarrow", source, "Parquet")
    content = parquet.read_table(source)
    table = Table(source)
    for name in dict.fromkeys(content.column_names):
        if content.column_names.count(name) > 1:
            table.refused[name] = f"{source} has more than one column '{name}'"
            continue
        try:
            data = content.column(name).to_numpy()
            if data.dtype.kind in "mM":
                data = (data - data[0]) / np.timedelta64(1, "s")
            values = np.asarray(data, dtype=float)
        except (TypeError, ValueError, IndexError):
            table.refused[name] = f"{source}: column '{name}' holds text, not numbers"
            continue
        declared = (content.schema.field(name).metadata or {}).get(b"unit", b"")
        unit = known_unit(declared.decode(errors="replace")) or split_header(name)[1]
        table.add(name, values, unit)
    return table


def _xlsx(source: Path) -> list[Table]:
    openpyxl: Any = optional_library("openpyxl", source, "Excel")
    book = openpyxl.load_workbook(source, read_only=True, data_only=True)
    tables = []
    for sheet in book.worksheets:
        tables += _sheet_tables(source, sheet.title, _filled_rows(sheet))
    book.close()
    if not tables:
        titles = ", ".join(f"'{sheet.title}'" for sheet in book.worksheets)
        raise ImportRefused(f"{source}: no sheet holds rows of numbers; it has {titles or 'none'}")
    return tables


def _sheet_tables(source: Path, title: str, numbered: list[tuple[int, list[Cell]]]) -> list[Table]:
    """Return the tables of a sheet, below one another; rows come with their numbers in it."""
    numbers = [row_number for row_number, _ in numbered]
    rows = _without_empty_columns([row for _, row in numbered])
    tables: list[Table] = []
    while rows and (found := _understood(rows)) is not None:
        layout, decimal = found
        if tables and len(rows) <= CONFIRMING_ROWS:
            break
        if layout.start:
            tables += _sheet_tables(
                source,
                title,
                list(zip(numbers[: layout.start], rows[: layout.start], strict=True)),
            )
            rows, numbers = rows[layout.start :], numbers[layout.start :]
            continue
        body = rows[layout.first :]
        values = numbers_of(body, decimal)
        end = section_end(body, values)
        table = Table(source, rate=layout.rate, section=title)
        if decimal == ",":
            table.notes.append("numbers stand as texts with decimal commas")
        numbers = numbers[layout.first :]
        _add_columns(table, layout, body[:end], values[:end], numbers)
        tables.append(table)
        rows, numbers = body[end:], numbers[end:]
    if rows and tables:
        tables[-1].notes.append(
            f"{len(rows)} rows below the numbers are left out, from row {numbers[0]} on"
        )
    return tables


def _understood(rows: list[list[Cell]]) -> tuple[Layout, str] | None:
    """Return the layout of rows and their decimal mark; a comma only in cells that are texts."""
    found = [
        (layout, decimal)
        for decimal in ".,"
        if (layout := understand(rows[:MAX_HEADER_ROWS], decimal)) is not None
    ]
    return max(found, key=lambda entry: entry[0].score, default=None)


def _add_columns(
    table: Table,
    layout: Layout,
    rows: list[list[Cell]],
    values: Numbers,
    row_numbers: list[int],
) -> None:
    for index, name in enumerate(layout.names):
        column = [row[index] for row in values]
        if None in column:
            bad = column.index(None)
            table.refused[name] = (
                f"{table.source}, row {row_numbers[bad]}: '{rows[bad][index]}' in column '{name}' "
                "is not a number"
            )
            continue
        unit = layout.units.get(name) or split_header(name)[1]
        table.add(name, np.array(column, dtype=float), unit)


def _filled_rows(sheet: Any) -> list[tuple[int, list[Cell]]]:
    """Return the rows that are not empty, with their numbers in the sheet."""
    rows = ([_cell(value) for value in row] for row in sheet.iter_rows(values_only=True))
    return [(k, row) for k, row in enumerate(rows, 1) if any(_filled(cell) for cell in row)]


def _filled(cell: Cell) -> bool:
    return cell is not None and cell != ""


def _without_empty_columns(rows: list[list[Cell]]) -> list[list[Cell]]:
    width = max((len(row) for row in rows), default=0)
    rows = [[*row, *[None] * (width - len(row))] for row in rows]
    kept = [k for k in range(width) if any(_filled(row[k]) for row in rows)]
    return [[row[k] for k in kept] for row in rows]


def _cell(value: Any) -> Cell:
    if isinstance(value, bool):
        return float(value)
    if value is None or isinstance(value, (int, float, str)):
        return value
    if isinstance(value, datetime.datetime):
        return value.timestamp()
    if isinstance(value, datetime.timedelta):
        return value.total_seconds()
    if isinstance(value, datetime.time):
        return 3600.0 * value.hour + 60.0 * value.minute + value.second + 1e-6 * value.microsecond
    return str(value)
