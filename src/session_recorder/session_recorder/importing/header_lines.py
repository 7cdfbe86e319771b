"""What the lines above the numbers say: names, units and the sampling rate, as programs write
them.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from session_recorder.importing.cells import Cell, number
from session_recorder.importing.laboratory_units import is_surely_a_unit, known_unit

_RATE = re.compile(
    r"(?:sampl\w*[\s_-]*(?:rate|freq\w*|frequenz)?|abtastrate|frame\s*rate|frequency|fs|rate)"
    r"[\s_:=,;\t]*(?:\(?\[?hz\)?\]?)?[\s:=,;\t]*(\d+(?:[.,]\d+)?)\s*(k?)(?:hz|s/s|sps)?\b",
    re.IGNORECASE,
)
_INTERVAL = re.compile(
    r"(?:interval|period|\bdt)[\s:=,;\t]*(\d+(?:[.,]\d+)?)\s*(s|ms|us|µs|sec|msec|usec)\b"
    r"|(\d+(?:[.,]\d+)?)\s*(s|ms|us|µs|sec|msec|usec)\s*/\s*sample",
    re.IGNORECASE,
)
"""LabChart's ``Interval= 0.001 s`` and AcqKnowledge's ``0.5 msec/sample``."""
_NEXUS = frozenset({"devices", "model outputs", "joints", "trajectories", "segments"})
"""What Vicon Nexus writes above its tables; the line below holds the sampling rate alone."""
_LABEL = re.compile(r"^\w[\w ]*[=:]$")
_LABELS_NAMES = re.compile(r"channel|title|name|label", re.IGNORECASE)
"""The first cell of a row of names or units may say so, as LabChart's ``ChannelTitle=``."""

Row = Sequence[Cell]


def fits(row: Row, width: int) -> bool:
    """Return whether a row can hold the names: a cell for each column, one more behind (LabVIEW's
    comment), or one less (R's row names).
    """
    return abs(len(row) - width) <= (1 if width > 1 else 0) and bool(_texts(row))


def names_and_units(above: Sequence[Row], width: int) -> tuple[tuple[str, ...], dict[str, str]]:
    """Find the names of the columns, and their units where a row of units states them.

    Parameters
    ----------
    above
        The rows above the numbers.
    width
        Number of columns.

    Returns
    -------
    tuple[tuple[str, ...], dict[str, str]]
        A name for each column, its number as text where there is none; the project's unit by
        name. Where a name stands above several columns, the row above it is put before it, as
        in ``Right Angle`` and ``Left Angle``.
    """
    lines = _names_of_lines(above, width)
    if lines is not None:
        return lines
    candidates = [row for row in above if fits(row, width) and stated_rate([row]) is None]
    if not candidates:
        return tuple(str(k + 1) for k in range(width)), {}
    labelled = {_label(row).lower(): row for row in candidates if _label(row) and len(row) == width}
    named = next((row for label, row in labelled.items() if _LABELS_NAMES.search(label)), None)
    if named is not None:
        units_row = next((row for label, row in labelled.items() if "unit" in label), None)
        texts = _stretched(["", *named[1:]], width)
        groups: Row | None = None
    else:
        units_row = None
        if len(candidates) > 1 and _is_units(candidates[-1]):
            units_row = candidates.pop()
        texts = _stretched(candidates[-1], width)
        groups = candidates[-2] if len(candidates) > 1 else None
    names = tuple(text or str(k + 1) for k, text in enumerate(_told_apart(texts, groups, width)))
    if units_row is None:
        return names, {}
    stated = [known_unit(text) for text in _stretched(units_row, width)]
    return names, {name: unit for name, unit in zip(names, stated, strict=True) if unit}


def _told_apart(texts: list[str], groups: Row | None, width: int) -> list[str]:
    """Put the groups of the row above before names that stand more than once."""
    repeated = {text for text, count in Counter(texts).items() if text and count > 1}
    if groups is None or not repeated:
        return texts
    above = _stretched(groups, width)
    for k in range(1, width):  # a merged cell stands above the columns to its right, too
        above[k] = above[k] or above[k - 1]
    return [
        f"{group} {text}".strip() if text in repeated else text
        for group, text in zip(above, texts, strict=True)
    ]


def _names_of_lines(
    above: Sequence[Row], width: int
) -> tuple[tuple[str, ...], dict[str, str]] | None:
    """Return names that stand below one another, each with its unit in the line below, as
    AcqKnowledge writes them; None where they are not as many as columns, or one less (its lines
    end with a delimiter).
    """
    single = [texts[0] if len(texts := _texts(row)) == 1 else "" for row in above]
    names: list[str] = []
    units: dict[str, str] = {}
    k = 0
    while k + 1 < len(single):
        unit = known_unit(single[k + 1])
        if single[k] and unit is not None and known_unit(single[k]) is None:
            names.append(single[k])
            units[single[k]] = unit
            k += 2
        else:
            k += 1
    if len(set(names)) < len(names) or not 0 <= width - len(names) <= 1 or len(names) < 2:
        return None
    numbers = [str(column + 1) for column in range(len(names), width)]
    return tuple([*names, *numbers]), units


def stated_rate(above: Sequence[Row]) -> float | None:
    """Return the sampling rate [Hz] that the rows above the numbers state, None without one."""
    before = ""
    for row in above:
        text = "\t".join("" if cell is None else str(cell) for cell in row)
        if match := _RATE.search(text):
            value = _value(match[1]) * (1000.0 if match[2] else 1.0)
            return value if value > 0 else None
        if match := _INTERVAL.search(text):
            step = _value(match[1] or match[3])
            unit = (match[2] or match[4]).lower()
            step *= 1e-3 if unit.startswith("m") else 1.0 if unit.startswith("s") else 1e-6
            return 1.0 / step if step > 0 else None
        if before in _NEXUS and (value := number(text.strip()) or 0.0) > 0:
            return value
        before = text.strip().lower()
    return None


def _value(text: str) -> float:
    return float(text.replace(",", "."))


def _texts(row: Row) -> list[str]:
    return [cell.strip() for cell in row if isinstance(cell, str) and number(cell) is None]


def _label(row: Row) -> str:
    first = row[0] if row and isinstance(row[0], str) else ""
    return first.strip() if _LABEL.match(first.strip()) else ""


def _stretched(row: Row, width: int) -> list[str]:
    texts = ["" if cell is None else str(cell).strip() for cell in row]
    return ["", *texts] if len(texts) == width - 1 else texts[:width]


def _is_units(row: Row) -> bool:
    texts = [text for text in _texts(row) if text]
    known = [is_surely_a_unit(text) for text in texts]
    odd = [text for text, is_known in zip(texts, known, strict=True) if not is_known]
    return any(known) and all(text[0] in "([{" or len(text) <= 3 for text in odd)
