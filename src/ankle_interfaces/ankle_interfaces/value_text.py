"""Numbers as reports print them."""

from __future__ import annotations

import math
from decimal import Decimal

ERROR_DIGITS = 2
"""Number of digits of a standard error; a value is rounded to the same place."""
_ABBREVIATIONS = {"mvc": "MVC", "vaf": "VAF"}
VALUE_DIGITS = 3
"""Least number of digits of a value whose error is not known; whole numbers keep all of theirs."""


def with_unit(quantity: str) -> str:
    """Return a quantity's name as people read it: ``K [N·m/rad]`` for ``K[N.m/rad]``.

    Parameters
    ----------
    quantity
        Name and unit, as in tables and topics.
    """
    name, _, unit = quantity.partition("[")
    shown = "" if unit in ("", "1]") else f" [{readable_unit(unit.removesuffix(']'))}]"
    words = [_ABBREVIATIONS.get(word, word) for word in name.split("_")]
    return f"{' '.join(words)}{shown}"


def readable_unit(unit: str) -> str:
    """Return a unit as people read it: ``N·m·s/rad²`` for ``N.m.s/rad^2``; nothing for 1.

    Parameters
    ----------
    unit
        As in tables and topics.
    """
    return "" if unit == "1" else unit.replace(".", "·").replace("^2", "²")


def with_error(value: tuple[float, float]) -> str:
    """Return a value and its standard error as text, as ``89.9 ± 0.4``.

    Both are rounded to the same place, the error to `ERROR_DIGITS` digits.

    Parameters
    ----------
    value
        The value and its standard error; a dash stands for a value that is not finite, and an error
        that is not finite is left out.
    """
    number, error = value
    if not math.isfinite(number):
        return "-"
    if not math.isfinite(error) or error <= 0.0:
        return _rounded(number, max(_place(number, VALUE_DIGITS), 0))
    place = _place(error, ERROR_DIGITS)
    return f"{_rounded(number, place)} ± {_rounded(error, place)}"


def three_digits(value: float) -> str:
    """Return a value whose error is not known as text: three digits, or all of a whole number."""
    return with_error((value, math.nan))


def _place(number: float, digits: int) -> int:
    """Return the decimal place, counted from the point, of the last of so many digits."""
    return 0 if number == 0.0 else digits - 1 - Decimal(f"{number:.{digits - 1}e}").adjusted()


def _rounded(number: float, place: int) -> str:
    return f"{round(number, place):.{max(place, 0)}f}"
