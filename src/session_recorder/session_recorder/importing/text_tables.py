"""Text files: any delimiter, decimal points or commas, header lines, comments, a row of units."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.cell_grid import (
    COMMENTS,
    CONFIRMING_ROWS,
    MAX_HEADER_ROWS,
    Layout,
    Numbers,
    numbers_of,
    section_end,
    understand,
)
from session_recorder.importing.cells import Cell, is_time_of_day, number, past_midnight
from session_recorder.importing.laboratory_units import split_header
from session_recorder.importing.table import Table

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
MAX_TEXT_SHARE = 0.5
"""Share of a column's cells above which it is a column of texts, not one with a fault."""
MAX_TITLE = 60
"""Characters of the title of a table; a longer line is a remark."""
ONE_GROUP = re.compile(r"^[-+]?\d{1,3}[.,]\d{3}$")


@dataclass(frozen=True)
class _Lines:
    """Holds the lines of a text with their numbers in the file; comments apart, by their number."""

    numbers: list[int]
    texts: list[str]
    comments: dict[int, str]

    def part(self, begin: int, end: int | None = None) -> _Lines:
        """Return the lines of a part with the comments in and directly above it."""
        numbers = self.numbers[begin:end]
        above = self.numbers[begin - 1] if begin else 0
        last = numbers[-1] if numbers else 0
        comments = {k: text for k, text in self.comments.items() if above < k < last}
        return _Lines(numbers, self.texts[begin:end], comments)


def read(source: Path) -> list[Table]:
    """Read a text file, each of its tables; see `tables.read_table`.

    Raises
    ------
    ImportRefused
        It holds no numbers, or decimal commas between commas.
    """
    notes: list[str] = []
    lines = _lines(_text(source, notes))
    if not lines.texts:
        raise ImportRefused(f"{source} holds no numbers")
    tables = _tables(source, lines)
    if not tables:
        raise ImportRefused(
            f"{source} holds no rows of numbers; its first line is '{lines.texts[0][:80]}'"
        )
    for table in tables:
        table.notes[:0] = notes
    return tables


def _tables(source: Path, lines: _Lines) -> list[Table]:
    """Return the tables that stand below one another."""
    tables: list[Table] = []
    while lines.texts:
        found = [
            (layout, dialect)
            for dialect in DIALECTS
            if (layout := _layout(lines, *dialect)) is not None
        ]
        if not found or (tables and len(lines.texts) <= CONFIRMING_ROWS):
            break
        layout, (delimiter, decimal) = max(found, key=lambda entry: entry[0].score)
        if layout.start:
            tables += _tables(source, lines.part(0, layout.start))
            lines = lines.part(layout.start)
            continue
        _refuse_ambiguous_commas(source, lines, layout, delimiter)
        title = _title([_split(line, delimiter) for line in lines.texts[: layout.first]])
        table = Table(source, rate=layout.rate, section=title)
        if decimal == ",":
            table.notes.append("numbers have decimal commas")
        end, values = _numbers(lines, layout, delimiter, decimal)
        _add_columns(table, layout, values, lines.part(0, end), delimiter)
        tables.append(table)
        lines = lines.part(end)
    if lines.texts and tables:
        tables[-1].notes.append(
            f"{len(lines.texts)} lines below the numbers are left out, from line "
            f"{lines.numbers[0]} on: '{lines.texts[0][:MAX_TITLE]}'"
        )
    return tables


def _title(header: Sequence[Sequence[str]]) -> str:
    """Return the title of a table: the first line above it that holds one text."""
    for row in header:
        filled = [cell for cell in row if cell]
        if len(filled) == 1 and number(filled[0]) is None and len(filled[0]) <= MAX_TITLE:
            return filled[0]
    return ""


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
    lines = _Lines([], [], {})
    for number_, line in enumerate(text.splitlines(), 1):
        stripped = line.strip()
        if not stripped:
            continue
        if stripped.startswith(COMMENTS):
            if len(lines.comments) < MAX_HEADER_ROWS:
                lines.comments[number_] = stripped.lstrip("#%/").strip()
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
    comments: list[list[Cell]] = [list(_split(line, delimiter)) for line in lines.comments.values()]
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
) -> tuple[int, Numbers | np.ndarray]:
    """Return behind which line the table ends, and its numbers row by row: an array where every
    cell is a plain number, else cell by cell.
    """
    body = lines.texts[layout.first :]
    plain = _plain_numbers(body, layout, delimiter, decimal)
    if plain is not None:
        return len(lines.texts), plain
    cells: list[list[Cell]] = [list(_split(line, delimiter)) for line in body]
    values = numbers_of(cells, decimal)
    end = section_end(cells, values)
    if end < len(body):
        plain = _plain_numbers(body[:end], layout, delimiter, decimal)
        if plain is not None:
            return layout.first + end, plain
    width = len(layout.names)
    empty = [float("nan")] * width
    return layout.first + end, [[*row, *empty][:width] for row in values[:end]]


def _plain_numbers(
    body: list[str], layout: Layout, delimiter: str | None, decimal: str
) -> np.ndarray | None:
    """Return lines as an array, None where a cell is anything else than a plain number."""
    text = "\n".join(body)
    if decimal == "," and delimiter != ",":
        if "." in text:  # what groups the thousands, not what ends the whole number
            return None
        text = text.replace(",", ".")
    try:
        data = np.loadtxt(io.StringIO(text), delimiter=delimiter, ndmin=2, comments=None)
    except ValueError:
        return None
    return data if data.shape == (len(body), len(layout.names)) else None


def _add_columns(
    table: Table,
    layout: Layout,
    values: Numbers | np.ndarray,
    lines: _Lines,
    delimiter: str | None,
) -> None:
    for index, name in enumerate(layout.names):
        if isinstance(values, np.ndarray):
            data = np.ascontiguousarray(values[:, index])
        else:
            column = [row[index] for row in values]
            bad = [k for k, value in enumerate(column) if value is None]
            if bad:
                at = layout.first + bad[0]
                cell = _split(lines.texts[at], delimiter)[index]
                place = f"{table.source}, line {lines.numbers[at]}: '{cell}' in column '{name}'"
                if ONE_GROUP.match(cell):
                    place += ", a group of thousands or a decimal mark,"
                table.refused[name] = f"{place} is not a number" + (
                    ", as most of its cells" if len(bad) > MAX_TEXT_SHARE * len(column) else ""
                )
                continue
            data = np.array(column, dtype=float)
            if is_time_of_day(_split(lines.texts[layout.first], delimiter)[index]):
                data = past_midnight(data)
        if name == str(index + 1) and not np.isfinite(data).any():
            continue  # what a delimiter at the end of each line makes
        table.add(name, data, layout.units.get(name) or split_header(name)[1])
