"""Units as laboratories spell them, and the units in the names of columns."""

from __future__ import annotations

import math
import re
import unicodedata

from ankle_interfaces import units

IMPORTED_UNITS: dict[str, tuple[str, float]] = {
    "min": ("s", 60.0),
    "d": ("s", 86_400.0),
    "lbf.ft": ("N.m", 4.4482216152605 * 0.3048),
    "lbf.in": ("N.m", 4.4482216152605 * 0.0254),
    "kgf.m": ("N.m", 9.80665),
    "kgf.cm": ("N.m", 0.0980665),
    "rpm": ("rad/s", math.tau / 60.0),
}
"""Units that files of others have and the project does not write, with SI unit and exact factor."""

# Spellings by the project's unit; compared without blanks, and without case where no two units
# differ by case alone.
_SPELLINGS = {
    "s": ("sec", "secs", "second", "seconds", "sek", "sekunden", "seconden", "secondes"),
    "ms": ("msec", "msecs", "millisecond", "milliseconds"),
    "us": ("usec", "microsecond", "microseconds"),
    "rad": ("radian", "radians", "radiant", "radialen", "radians"),
    "mrad": ("milliradian", "milliradians"),
    "deg": ("degree", "degrees", "degs", "grad", "graden", "degrés", "altgrad"),
    "rad/s": (
        "rad/sec",
        "rads-1",
        "rad.s-1",
        "rads^-1",
        "rad.s^-1",
        "radians/s",
        "rad_s",
        "rad_per_s",
        "rad_per_sec",
    ),
    "deg/s": (
        "deg/sec",
        "degs-1",
        "deg.s-1",
        "deg.s^-1",
        "degrees/s",
        "degrees/sec",
        "dps",
        "deg_s",
        "deg_sec",
        "deg_per_s",
        "deg_per_sec",
    ),
    "rad/s^2": ("rad/s2", "rad/s/s", "rad/sec^2", "rad/s**2", "rad_s2"),
    "deg/s^2": ("deg/s2", "deg/s/s", "deg/sec^2", "deg/s**2", "deg_s2"),
    "N.m": (
        "Nm",
        "N-m",
        "Nmeter",
        "newtonmeter",
        "newton-meter",
        "newtonmeters",
        "newtonmetre",
        "N_m",
    ),
    "mN.m": ("mNm", "mN-m"),
    "N.mm": ("Nmm", "N-mm"),
    "N.cm": ("Ncm", "N-cm"),
    "kN.m": ("kNm", "kN-m"),
    "V": ("volt", "volts"),
    "mV": ("millivolt", "millivolts"),
    "uV": ("microvolt", "microvolts"),
    "min": ("mins", "minute", "minutes", "minuten"),
    "d": ("day", "days", "tage", "dagen"),
    "lbf.ft": (
        "ft-lb",
        "ft-lbs",
        "ft-lbf",
        "ft.lb",
        "ft.lbs",
        "ft.lbf",
        "ftlb",
        "ftlbs",
        "lb-ft",
        "lbs-ft",
        "lb.ft",
        "foot-pounds",
        "footpounds",
    ),
    "lbf.in": ("in-lb", "in-lbs", "in-lbf", "in.lb", "in.lbs", "in.lbf", "inlb", "lb-in", "lb.in"),
    "kgf.m": ("kgf-m", "kp.m", "kpm", "kg-m", "kgm"),
    "kgf.cm": ("kgf-cm", "kp.cm", "kpcm", "kg-cm", "kgcm", "kg.cm"),
    "rpm": ("r/min", "rev/min", "1/min", "min-1"),
}
_ALSO_WORDS = {"min", "d"}
"""Units that count as such in brackets or in a row of units only: ``torque_min`` is a minimum."""
_CASE_MATTERS = {"mV", "mN.m", "mNm", "mN-m", "N.m", "Nm", "N-m", "mrad", "ms", "s", "V"}


def _key(text: str) -> str:
    """Return a spelling without what does not distinguish units."""
    text = unicodedata.normalize("NFKC", text).strip().strip("()[]{}<>").strip()
    for sign, plain in (("μ", "u"), ("µ", "u"), ("°", "deg"), ("º", "deg"), ("˚", "deg")):
        text = text.replace(sign, plain)
    text = re.sub(r"\s*[·⋅∙•×*]\s*", ".", text)
    return re.sub(r"\s+", "", text)


_BY_SPELLING = {
    _key(unit): unit for unit in [*units.KNOWN_UNITS, *IMPORTED_UNITS] if unit not in ("1", "%")
}
for _unit, _spellings in _SPELLINGS.items():
    _BY_SPELLING.update({_key(spelling): _unit for spelling in _spellings})
_BY_LOWER = {key.lower(): unit for key, unit in _BY_SPELLING.items() if key not in _CASE_MATTERS}
_BY_LOWER.update({"nm": "N.m", "n.m": "N.m", "n-m": "N.m"})

_IN_BRACKETS = re.compile(r"^(?P<name>.*?)[\s_]*[\(\[\{<](?P<unit>[^()\[\]{}<>]*)[\)\]\}>]\s*$")
_SEPARATOR = re.compile(r"\s*,\s*|\s*/\s*|\s+in\s+|[\s_]+")


def known_unit(text: str) -> str | None:
    """Return the project's spelling of a unit.

    Parameters
    ----------
    text
        As a laboratory writes it: ``Nm``, ``N*m``, ``deg/sec``, ``°``, ``[µV]``.

    Returns
    -------
    str | None
        As ``N.m``; None where it is no unit that is known.
    """
    key = _key(text)
    return _BY_SPELLING.get(key) or _BY_LOWER.get(key.lower())


def split_header(name: str) -> tuple[str, str | None]:
    """Split a column's name into what it says and its unit.

    Parameters
    ----------
    name
        As ``Time (s)``, ``Torque_Nm``, ``SOL_EMG_uV``, ``Angle, deg``, ``Pos/rad``.

    Returns
    -------
    tuple[str, str | None]
        The name without unit, and the project's spelling of the unit; None without one.
    """
    name = name.strip()
    match = _IN_BRACKETS.match(name)
    if match and (unit := known_unit(match["unit"])) is not None:
        return match["name"].strip(), unit
    for separator in _SEPARATOR.finditer(name):
        unit = known_unit(name[separator.end() :]) if separator.start() else None
        if unit is not None and unit not in _ALSO_WORDS:
            return name[: separator.start()], unit
    return name, None


def unknown_unit(name: str) -> str | None:
    """Return what stands in brackets behind a column's name and is no unit that is known; None
    without.
    """
    match = _IN_BRACKETS.match(name.strip())
    return match["unit"].strip() if match and known_unit(match["unit"]) is None else None


def is_surely_a_unit(text: str) -> bool:
    """Return whether a text is a unit and not also a word, as ``min`` is."""
    unit = known_unit(text)
    return unit is not None and (unit not in _ALSO_WORDS or text.strip()[:1] in "([{")


def to_si(unit: str) -> tuple[str, float]:
    """Return SI unit and factor of a unit, also of those that only files of others have.

    Raises
    ------
    UnitError
        The unit is not known.
    """
    return IMPORTED_UNITS.get(unit) or units.to_si(unit)
