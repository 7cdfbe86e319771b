"""A cell of a text file or a sheet as a number: decimal marks, missing values, times and dates."""

from __future__ import annotations

import re
from datetime import date, datetime, timezone

import numpy as np

Cell = str | float | None
# What programs write for a value that is not there.
EMPTY_CELLS = frozenset(
    {"", "nan", "na", "n/a", "null", "none", "-", "--", "#n/a", "#num!", "#div/0!", "#value!"}
)
_GROUP_SIGNS = "'’ \u00a0\u202f"
"""What groups the thousands and is never a decimal mark: an apostrophe or a blank."""


def _grouped(decimal: str) -> re.Pattern[str]:
    mark, other = re.escape(decimal), "," if decimal == "." else r"\."
    return re.compile(
        rf"^[-+]?[1-9]\d{{0,2}}(?:(?:{other}\d{{3}})+{mark}\d*|(?:{other}\d{{3}}){{2,}}"
        rf"|(?:[{_GROUP_SIGNS}]\d{{3}})+(?:{mark}\d*)?)$"
    )


_GROUPED = {decimal: _grouped(decimal) for decimal in ".,"}
"""Numbers with groups of thousands, by decimal mark. One group behind a point or comma, as in
``1,000``, is no such number: it may be a decimal mark."""
_ONE_POINT = re.compile(r"^[-+]?\d*\.\d*(?:[eE][-+]?\d+)?$")
_DAY = 86_400.0
"""[s]"""
_CLOCK = re.compile(r"^(?:(\d{1,2}):)?(\d{1,2}):(\d{2}(?:[.,]\d+)?)$")
_DATED = re.compile(r"^(\d{1,4})([-./])(\d{1,2})\2(\d{1,4})[T ](\S+?)Z?$")
"""A date and a time of day; what stands between them may be a blank or a T."""


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
        (``00:01:02.5``) and for a date with one (``2024-03-02 10:59:55.002``; since 1970), None
        where it is no number.
    """
    if cell is None:
        return float("nan")
    if isinstance(cell, (int, float)):
        return float(cell)
    text = cell.strip()
    if text.lower() in EMPTY_CELLS:
        return float("nan")
    if _GROUPED[decimal].match(text):
        text = re.sub(rf"[^-+\d{re.escape(decimal)}]", "", text)
    if decimal == ",":
        if _ONE_POINT.match(text):
            return None  # a group of thousands, or a number with a decimal point
        text = text.replace(",", ".")
    try:
        return float(text.replace("\u2212", "-")) if "_" not in text else None
    except ValueError:
        pass
    clock = _time_of_day(text)
    return _date_and_time(text) if clock is None else clock


def _time_of_day(text: str) -> float | None:
    match = _CLOCK.match(text)
    if match is None:
        return None
    hours, minutes, seconds = match.groups()
    return 3600.0 * float(hours or 0) + 60.0 * float(minutes) + float(seconds.replace(",", "."))


def _date_and_time(text: str) -> float | None:
    match = _DATED.match(text)
    clock = _time_of_day(match[5]) if match else None
    if match is None or clock is None:
        return None
    first, middle, last = int(match[1]), int(match[3]), int(match[4])
    # 2024-03-02, 02.03.2024, and with strokes as in English 3/2/2024.
    year, month, day = (
        (first, middle, last)
        if first > 31
        else (last, first, middle)
        if match[2] == "/"
        else (last, middle, first)
    )
    try:
        begin = datetime.combine(date(year, month, day), datetime.min.time(), timezone.utc)
    except ValueError:
        return None
    return begin.timestamp() + clock


def is_time_of_day(cell: Cell) -> bool:
    """Return whether a cell is a time of day without a date, which begins anew at midnight."""
    return isinstance(cell, str) and _time_of_day(cell.strip()) is not None


def past_midnight(times: np.ndarray) -> np.ndarray:
    """Return times of day [s], shape (n,), counted on where they begin anew at midnight."""
    anew = np.diff(times, prepend=times[:1]) < -_DAY / 2
    return np.asarray(times + _DAY * np.cumsum(anew))
