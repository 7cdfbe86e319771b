"""Sheets: Excel workbooks and Parquet files."""

from __future__ import annotations

import datetime
from pathlib import Path
from typing import Any

import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.cell_grid import MAX_HEADER_ROWS, understand
from session_recorder.importing.cells import Cell, number
from session_recorder.importing.laboratory_units import known_unit, split_header
from session_recorder.importing.tables import Table, optional_library


def read(source: Path) -> Table:
    """Read a sheet; see `tables.read_table`.

    Raises
    ------
    ImportRefused
        It is not such a file, holds no numbers, or its library is not installed.
    """
    return _parquet(source) if source.suffix.lower() == ".parquet" else _xlsx(source)


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


def _xlsx(source: Path) -> Table:
    openpyxl: Any = optional_library("openpyxl", source, "Excel")
    book = openpyxl.load_workbook(source, read_only=True, data_only=True)
    sheets = {sheet.title: _filled_rows(sheet) for sheet in book.worksheets}
    book.close()
    chosen = max(sheets, key=lambda title: len(sheets[title]), default=None)
    if chosen is None:
        raise ImportRefused(f"{source} holds no sheet")
    rows = _without_empty_columns(sheets[chosen])
    layout = understand(rows[:MAX_HEADER_ROWS]) if rows else None
    if layout is None:
        raise ImportRefused(f"{source}: sheet '{chosen}' holds no rows of numbers")
    table = Table(source, rate=layout.rate)
    if len(sheets) > 1:
        others = ", ".join(f"'{title}'" for title in sheets if title != chosen)
        table.notes.append(f"sheet '{chosen}' is read, because it has most rows; not {others}")
    for index, name in enumerate(layout.names):
        cells = [row[index] for row in rows[layout.first :]]
        values = [number(cell) for cell in cells]
        bad = [k for k, value in enumerate(values) if value is None]
        if bad:
            table.refused[name] = (
                f"{source}, row {layout.first + bad[0] + 1}: '{cells[bad[0]]}' in column '{name}' "
                "is not a number"
            )
            continue
        unit = layout.units.get(name) or split_header(name)[1]
        table.add(name, np.array(values, dtype=float), unit)
    return table


def _filled_rows(sheet: Any) -> list[list[Cell]]:
    rows = ([_cell(value) for value in row] for row in sheet.iter_rows(values_only=True))
    return [row for row in rows if any(_filled(cell) for cell in row)]


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
