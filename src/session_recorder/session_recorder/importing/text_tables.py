"""Text files: any delimiter, decimal points or commas, header lines, comments, a row of units."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.cell_grid import COMMENTS, MAX_HEADER_ROWS, Layout, understand
from session_recorder.importing.cells import Cell, is_time_of_day, number, past_midnight
from session_recorder.importing.laboratory_units import split_header
from session_recorder.importing.tables import Table

# Delimiter and decimal sign, in the order of preference where several fit alike. None is any blank.
DIALECTS: tuple[tuple[str | None, str], ...] = (
    ("\t", "."),
    (";", "."),
    (",", "."),
    ("\t", ","),
    (";", ","),
    (",", ","),
    (None, "."),
    (None, ","),
)
MIN_NUMERIC_SHARE = 0.5
"""Share of a column's cells that must be numbers; a column with fewer is text."""


@dataclass(frozen=True)
class _Lines:
    """Holds the lines of a text with their numbers in the file; comments apart."""

    numbers: list[int]
    texts: list[str]
    comments: list[str]


def read(source: Path) -> Table:
    """Read a text file; see `tables.read_table`.

    Raises
    ------
    ImportRefused
        It holds no numbers, or decimal commas between commas.
    """
    table = Table(source)
    lines = _lines(_text(source, table.notes))
    if not lines.texts:
        raise ImportRefused(f"{source} holds no numbers")
    found = [
        (layout, dialect)
        for dialect in DIALECTS
        if (layout := _layout(lines, *dialect)) is not None
    ]
    if not found:
        raise ImportRefused(
            f"{source} holds no rows of numbers; its first line is '{lines.texts[0][:80]}'"
        )
    layout, (delimiter, decimal) = max(found, key=lambda entry: entry[0].score)
    _refuse_ambiguous_commas(source, lines, layout, delimiter)
    if decimal == ",":
        table.notes.append("numbers have decimal commas")
    table.rate = layout.rate
    values = _numbers(lines, layout, delimiter, decimal)
    _add_columns(table, layout, values, lines, delimiter)
    return table


def _text(source: Path, notes: list[str]) -> str:
    raw = source.read_bytes()
    if raw.startswith((b"\xff\xfe", b"\xfe\xff")):
        try:
            return raw.decode("utf-16")
        except UnicodeDecodeError:
            raise ImportRefused(f"{source} is not readable as text in UTF-16") from None
    if b"\x00" in raw[:10_000]:
        raise ImportRefused(f"{source} is not text: it holds zero bytes")
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        notes.append("the text is read as Latin-1 (Windows-1252)")
        return raw.decode("cp1252", errors="replace")


def _lines(text: str) -> _Lines:
    lines = _Lines([], [], [])
    for number_, line in enumerate(text.splitlines(), 1):
        stripped = line.strip()
        if not stripped:
            continue
        if stripped.startswith(COMMENTS):
            if len(lines.comments) < MAX_HEADER_ROWS:
                lines.comments.append(stripped.lstrip("#%/").strip())
            continue
        lines.numbers.append(number_)
        lines.texts.append(line)
    return lines


def _split(line: str, delimiter: str | None) -> list[str]:
    if delimiter is None:
        return line.split()
    try:
        cells = next(csv.reader([line], delimiter=delimiter, skipinitialspace=True))
    except csv.Error:
        cells = line.split(delimiter)
    return [cell.strip() for cell in cells]


def _layout(lines: _Lines, delimiter: str | None, decimal: str) -> Layout | None:
    rows: list[list[Cell]] = [
        list(_split(line, delimiter)) for line in lines.texts[:MAX_HEADER_ROWS]
    ]
    comments: list[list[Cell]] = [list(_split(line, delimiter)) for line in lines.comments]
    return understand(rows, decimal, comments)


def _refuse_ambiguous_commas(
    source: Path, lines: _Lines, layout: Layout, delimiter: str | None
) -> None:
    if delimiter != "," or layout.first == 0:
        return
    names = _split(lines.texts[layout.first - 1], ",")
    width = len(layout.names)
    if len(names) > 1 and width == 2 * len(names) and not any(number(name) for name in names):
        raise ImportRefused(
            f"{source}: {len(names)} names stand above {width} numbers, as when commas are decimal "
            "sign and delimiter at once; save it with ';' or tabs between the columns"
        )


def _numbers(
    lines: _Lines, layout: Layout, delimiter: str | None, decimal: str
) -> list[list[float | None]] | np.ndarray:
    """Return the numbers row by row: an array where every cell is a plain number, else cell by
    cell.
    """
    body = lines.texts[layout.first :]
    text = "\n".join(body)
    if decimal == "," and delimiter != ",":
        text = text.replace(",", ".")
    try:
        data = np.loadtxt(io.StringIO(text), delimiter=delimiter, ndmin=2, comments=None)
        if data.shape == (len(body), len(layout.names)):
            return data
    except ValueError:
        pass
    width = len(layout.names)
    rows = []
    for line in body:
        cells = _split(line, delimiter)[:width]
        cells += [""] * (width - len(cells))
        rows.append([number(cell, decimal) for cell in cells])
    return rows


def _add_columns(
    table: Table,
    layout: Layout,
    values: list[list[float | None]] | np.ndarray,
    lines: _Lines,
    delimiter: str | None,
) -> None:
    for index, name in enumerate(layout.names):
        if isinstance(values, np.ndarray):
            data = np.ascontiguousarray(values[:, index])
        else:
            column = [row[index] for row in values]
            bad = [k for k, value in enumerate(column) if value is None]
            if len(bad) > (1 - MIN_NUMERIC_SHARE) * len(column):
                table.refused[name] = f"{table.source}: column '{name}' holds text, not numbers"
                continue
            if bad:
                at = layout.first + bad[0]
                cell = _split(lines.texts[at], delimiter)[index]
                table.refused[name] = (
                    f"{table.source}, line {lines.numbers[at]}: '{cell}' in column '{name}' is not "
                    "a number"
                )
                continue
            data = np.array(column, dtype=float)
            if is_time_of_day(_split(lines.texts[layout.first], delimiter)[index]):
                data = past_midnight(data)
        if name == str(index + 1) and not np.isfinite(data).any():
            continue  # what a delimiter at the end of each line makes
        table.add(name, data, layout.units.get(name) or split_header(name)[1])
