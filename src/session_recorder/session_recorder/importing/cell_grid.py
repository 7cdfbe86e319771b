"""Where the numbers begin in a grid of cells, and what the lines above say: names, units, sampling
rate.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from session_recorder.importing.cells import Cell, number
from session_recorder.importing.header_lines import fits, names_and_units, stated_rate

COMMENTS = ("#", "%", "//")
MAX_HEADER_ROWS = 400
"""Number of rows from the start in which the numbers must begin."""
CONFIRMING_ROWS = 4
"""Number of rows of the same kind after the first one, before it counts as the first row of
numbers."""
MAX_FOOTER_ROWS = 20
"""Rows behind the numbers that count as a footer, as means and signatures; more are damage."""


@dataclass(frozen=True)
class Layout:
    """Describes what a grid of cells is.

    Attributes
    ----------
    start
        Index of the row behind an earlier table of numbers; 0 without one.
    first
        Index of the first row of numbers.
    names
        Of each column; its number as text where there is none.
    units
        The project's unit of a column by name, where the grid states one in a row of units.
    rate
        Sampling rate [Hz] that the lines above state; None without.
    score
        Share of rows and cells that are numbers; more is better.
    """

    start: int
    first: int
    names: tuple[str, ...]
    units: dict[str, str]
    rate: float | None
    score: tuple[float, ...]


Numbers = list[list[float | None]]
"""Rows of cells as `number` reads them."""


def _is_data(values: Sequence[float | None]) -> bool:
    known = [value for value in values if value is not None]
    real = [value for value in known if value == value]
    return bool(real) and 2 * len(known) >= len(values)


def _is_sample_count(rows: Sequence[Sequence[Cell]], decimal: str) -> bool:
    """Return whether the first of two rows states how many samples each column has, as
    AcqKnowledge's: one whole number above the columns that are named, empty elsewhere.
    """
    if len(rows) < 2 or len(rows[0]) < 2:
        return False
    numbers, following = ([number(cell, decimal) for cell in row] for row in rows)
    filled = [value is not None and value == value for value in numbers]
    stated = {value for value, is_filled in zip(numbers, filled, strict=True) if is_filled}
    elsewhere = filled != [value is not None and value == value for value in following]
    return elsewhere and len(stated) == 1 and float(stated.pop() or 0.5).is_integer()


def numbers_of(rows: Sequence[Sequence[Cell]], decimal: str = ".") -> Numbers:
    """Return rows of cells as `number` reads them, with a decimal mark ``.`` or ``,``."""
    return [[number(cell, decimal) for cell in row] for row in rows]


def understand(
    rows: Sequence[Sequence[Cell]], decimal: str = ".", comments: Sequence[Sequence[Cell]] = ()
) -> Layout | None:
    """Find names, units and the first row of numbers.

    Parameters
    ----------
    rows
        The first rows of the grid (`MAX_HEADER_ROWS` are enough), comments left out.
    decimal
        Decimal mark: ``.`` or ``,``.
    comments
        Comment lines, split as rows; names may stand there where no other row has them.

    Returns
    -------
    Layout | None
        None where no numbers are found.
    """
    looked = rows[:MAX_HEADER_ROWS]
    values = numbers_of(looked, decimal)
    data = [_is_data(row) for row in values]
    widths = Counter(len(row) for row, good in zip(looked, data, strict=True) if good)
    if not widths:
        return None
    width = max(widths, key=lambda key: (widths[key], key))
    good = [is_data and len(row) == width for row, is_data in zip(looked, data, strict=True)]
    first = next(
        (
            k
            for k in range(len(good))
            if good[k] and all(good[k : min(k + 1 + CONFIRMING_ROWS, len(good))])
        ),
        None,
    )
    if first is None:
        return None
    first += _is_sample_count(looked[first : first + 2], decimal)
    start = _end_of_earlier_table(values[:first])
    above = [*comments, *looked[start:first]]
    names, units = names_and_units(above, width)
    body = values[first:]
    cells = [value is not None for row in body for value in row]
    score = (
        sum(good[first:]) / len(body),
        sum(cells) / max(1, len(cells)),
        float(any(fits(row, width) for row in above)),
        float(width),
    )
    return Layout(start, first, names, units, stated_rate(above), score)


def section_end(rows: Sequence[Sequence[Cell]], values: Numbers) -> int:
    """Find where a table ends: where another one begins below it, or where only a footer is left.

    Parameters
    ----------
    rows
        The rows from the table's first row of numbers on.
    values
        The same cells as numbers.

    Returns
    -------
    int
        Index of the first row that does not belong to the table; the number of rows without one.
        A row of text among the numbers, without names of columns, belongs to it.
    """
    width = len(rows[0])
    begins_with_text = values[0][0] is None
    is_data = [_is_data(row) for row in values]
    belongs = [
        good and abs(len(row) - width) <= 1 and (begins_with_text or row[0] is not None)
        for row, good in zip(values, is_data, strict=True)
    ]
    following = 0
    for begin in (k for k, good in enumerate(belongs) if not good):
        if begin < following:
            continue
        following = _next_table(rows, is_data, begin)
        if following == len(rows):
            return begin if len(rows) - begin <= MAX_FOOTER_ROWS else len(rows)
        below = len(rows[following])
        if abs(below - width) > 1 or any(
            _names_columns(rows[k], values[k], below) for k in range(begin, following)
        ):
            return begin
    return len(rows)


def _next_table(rows: Sequence[Sequence[Cell]], is_data: list[bool], begin: int) -> int:
    """Return from which row on enough rows of numbers of one width follow; else their number."""
    for k in range(begin, len(rows) - CONFIRMING_ROWS):
        following = range(k, k + 1 + CONFIRMING_ROWS)
        if all(is_data[j] and len(rows[j]) == len(rows[k]) for j in following):
            return k
    return len(rows)


def _names_columns(row: Sequence[Cell], values: Sequence[float | None], width: int) -> bool:
    """Return whether a row holds nothing but texts, and enough of them for as many columns."""
    texts = sum(value is None for value in values)
    empty = sum(cell is None or cell == "" for cell in row)
    return texts > 1 and texts + empty == len(row) and fits(row, width)


def _end_of_earlier_table(above: Numbers) -> int:
    """Return the index behind the last rows of nothing but numbers, 0 without.

    Rows with a text are no such rows, because lines above a table state single numbers
    (``Body mass;70``).
    """
    count = end = 0
    for k, row in enumerate(above):
        pure = len(row) > 1 and None not in row and _is_data(row)
        count = count + 1 if pure and (not count or len(row) == len(above[k - 1])) else int(pure)
        if count > CONFIRMING_ROWS:
            end = k + 1
    return end
