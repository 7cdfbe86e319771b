"""Units: SI inside the graph, conversion at its borders.

A column name carries its unit in brackets, as in ``torque[N.m]``.
"""

from __future__ import annotations

import math
import re

from ankle_interfaces.errors import UnitError

_COLUMN = re.compile(r"^(?P<quantity>[^\[\],]+)\[(?P<unit>[^\[\],]+)\]$")

_TO_SI: dict[str, tuple[str, float]] = {
    "s": ("s", 1.0),
    "ms": ("s", 1e-3),
    "us": ("s", 1e-6),
    "rad": ("rad", 1.0),
    "mrad": ("rad", 1e-3),
    "deg": ("rad", math.pi / 180.0),
    "rad/s": ("rad/s", 1.0),
    "mrad/s": ("rad/s", 1e-3),
    "deg/s": ("rad/s", math.pi / 180.0),
    "rad/s^2": ("rad/s^2", 1.0),
    "deg/s^2": ("rad/s^2", math.pi / 180.0),
    "m": ("m", 1.0),
    "mm": ("m", 1e-3),
    "m/s": ("m/s", 1.0),
    "mm/s": ("m/s", 1e-3),
    "m/s^2": ("m/s^2", 1.0),
    "N": ("N", 1.0),
    "kN": ("N", 1e3),
    "N.m": ("N.m", 1.0),
    "mN.m": ("N.m", 1e-3),
    "N.mm": ("N.m", 1e-3),
    "N.cm": ("N.m", 1e-2),
    "kN.m": ("N.m", 1e3),
    "A": ("A", 1.0),
    "mA": ("A", 1e-3),
    "V": ("V", 1.0),
    "V.s": ("V.s", 1.0),
    "mV": ("V", 1e-3),
    "uV": ("V", 1e-6),
    "N.m/rad": ("N.m/rad", 1.0),
    "N.m.s/rad": ("N.m.s/rad", 1.0),
    "kg.m^2": ("kg.m^2", 1.0),
    "%": ("%", 1.0),
    "1": ("1", 1.0),
}

KNOWN_UNITS = tuple(_TO_SI)


def split_column(column: str) -> tuple[str, str]:
    """Split a column name into quantity and unit: ``torque[N.m]`` -> (``torque``, ``N.m``).

    Raises
    ------
    UnitError
        The name does not have the form ``quantity[unit]``.
    """
    match = _COLUMN.match(column.strip())
    if match is None:
        raise UnitError(
            f"column '{column}' does not say its unit: expected 'quantity[unit]', as in "
            "'torque[N.m]'"
        )
    return match["quantity"], match["unit"]


def to_si(unit: str) -> tuple[str, float]:
    """Return SI unit and factor of a unit: ``deg`` gives (``rad``, 0.01745...).

    Raises
    ------
    UnitError
        The unit is not one of `KNOWN_UNITS`.
    """
    try:
        return _TO_SI[unit]
    except KeyError:
        raise UnitError(f"unknown unit '{unit}'; known units: {', '.join(KNOWN_UNITS)}") from None
