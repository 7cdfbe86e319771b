"""Where the numbers begin in a grid of cells, and what the lines above say: names, units, sampling
rate.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass

from session_recorder.importing.laboratory_units import known_unit

Cell = str | float | None
# What programs write for a value that is not there.
EMPTY_CELLS = frozenset(
    {"", "nan", "na", "n/a", "null", "none", "-", "--", "#n/a", "#num!", "#div/0!", "#value!"}
)
COMMENTS = ("#", "%", "//")
MAX_HEADER_ROWS = 400
"""Number of rows from the start in which the numbers must begin."""
CONFIRMING_ROWS = 4
"""Number of rows of the same kind after the first one, before it counts as the first row of
numbers."""
_CLOCK = re.compile(r"^(?:(\d{1,2}):)?(\d{1,2}):(\d{2}(?:[.,]\d+)?)$")
_RATE = re.compile(
    r"(?:sampl\w*[\s_-]*(?:rate|freq\w*|frequenz)?|abtastrate|frame\s*rate|frequency|fs|rate)"
    r"[\s_:=,;\t]*(?:\(?\[?hz\)?\]?)?[\s:=,;\t]*(\d+(?:[.,]\d+)?)\s*(k?)(?:hz|s/s|sps)?\b",
    re.IGNORECASE,
)


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


def number(cell: Cell, decimal: str = ".") -> float | None:
    """Return the number in a cell.

    Parameters
    ----------
    cell
        A text, a number, or None for an empty one.
    decimal
        Decimal mark: ``.`` or ``,``.

    Returns
    -------
    float | None
        NaN for what programs write for a missing value, seconds for a time of day
        (``00:01:02.5``), None where it is no number.
    """
    if cell is None:
        return float("nan")
    if isinstance(cell, (int, float)):
        return float(cell)
    text = cell.strip()
    if text.lower() in EMPTY_CELLS:
        return float("nan")
    if decimal == ",":
        text = text.replace(",", ".")
    try:
        return float(text.replace("\u2212", "-")) if "_" not in text else None
    except ValueError:
        pass
    match = _CLOCK.match(text)
    if match is None:
        return None
    hours, minutes, seconds = match.groups()
    return 3600.0 * float(hours or 0) + 60.0 * float(minutes) + float(seconds.replace(",", "."))


def _is_data(row: Sequence[Cell], decimal: str) -> bool:
    values = [number(cell, decimal) for cell in row]
    known = [value for value in values if value is not None]
    real = [value for value in known if value == value]
    return bool(real) and 2 * len(known) >= len(values)


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
    above = [*comments, *looked[:first]]
    names, units = _names(above, width)
    body = looked[first:]
    cells = [number(cell, decimal) is not None for row in body for cell in row]
    score = (
        sum(good[first:]) / len(body),
        sum(cells) / max(1, len(cells)),
        float(any(_fits(row, width) for row in above)),
        float(width),
    )
    return Layout(first, names, units, _stated_rate(above), score)


def _fits(row: Sequence[Cell], width: int) -> bool:
    """Return whether a row can hold the names: a cell for each column, one more behind (LabVIEW's
    comment), or one less (R's row names).
    """
    return abs(len(row) - width) <= (1 if width > 1 else 0) and bool(_texts(row))


def _texts(row: Sequence[Cell]) -> list[str]:
    return [cell.strip() for cell in row if isinstance(cell, str) and number(cell) is None]


def _names(above: Sequence[Sequence[Cell]], width: int) -> tuple[tuple[str, ...], dict[str, str]]:
    candidates = [row for row in above if _fits(row, width)]
    units_row: Sequence[Cell] | None = None
    if len(candidates) > 1 and _is_units(candidates[-1]):
        units_row = candidates.pop()
    texts = _stretched(candidates[-1], width) if candidates else [""] * width
    names = tuple(text or str(k + 1) for k, text in enumerate(texts))
    if units_row is None:
        return names, {}
    stated = [known_unit(text) for text in _stretched(units_row, width)]
    return names, {name: unit for name, unit in zip(names, stated, strict=True) if unit}


def _stretched(row: Sequence[Cell], width: int) -> list[str]:
    texts = ["" if cell is None else str(cell).strip() for cell in row]
    return ["", *texts] if len(texts) == width - 1 else texts[:width]


def _is_units(row: Sequence[Cell]) -> bool:
    texts = [text for text in _texts(row) if text]
    known = [known_unit(text) is not None for text in texts]
    odd = [text for text, is_known in zip(texts, known, strict=True) if not is_known]
    return any(known) and all(text[0] in "([{" or len(text) <= 3 for text in odd)


def _stated_rate(above: Sequence[Sequence[Cell]]) -> float | None:
    for row in above:
        match = _RATE.search("\t".join("" if cell is None else str(cell) for cell in row))
        if match:
            value = float(match[1].replace(",", ".")) * (1000.0 if match[2] else 1.0)
            return value if value > 0 else None
    return None
