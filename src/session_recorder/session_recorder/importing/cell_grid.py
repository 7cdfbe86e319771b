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


@dataclass(frozen=True)
class Layout:
    """Describes what a grid of cells is.

    Attributes
    ----------
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

    first: int
    names: tuple[str, ...]
    units: dict[str, str]
    rate: float | None
    score: tuple[float, ...]


def _is_data(row: Sequence[Cell], decimal: str) -> bool:
    values = [number(cell, decimal) for cell in row]
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
    data = [bool(row) and _is_data(row, decimal) for row in looked]
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
    above = [*comments, *looked[:first]]
    names, units = names_and_units(above, width)
    body = looked[first:]
    cells = [number(cell, decimal) is not None for row in body for cell in row]
    score = (
        sum(good[first:]) / len(body),
        sum(cells) / max(1, len(cells)),
        float(any(fits(row, width) for row in above)),
        float(width),
    )
    return Layout(first, names, units, stated_rate(above), score)
