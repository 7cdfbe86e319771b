"""What ``verdict.json`` holds as keys and bare numbers, in the words of a report."""

from __future__ import annotations

import re
from decimal import Decimal
from typing import Any

import numpy as np

from ankle_interfaces.value_text import three_digits, with_error, with_unit
from ankle_physics.term import term_library

# Decimal places of a VAF: of a sum of squares nobody knows more.
_MOST_PLACES = 6
_PLACES_IN_FILE = 2
# A term, perhaps with the symbol of one of its parameters.
_NAME = re.compile(r"\b([a-z][a-z0-9_]*)(?:\.([A-Za-z]\w*))?\b")
_MEASURES = {
    "share_of_mean[1]": ("variation [% of the mean]", 100.0),
    "timing[s]": ("variation of its time [ms]", 1000.0),
    "rms[N.m]": ("root mean square [N·m]", 1.0),
    "serial_correlation[1]": ("correlation of one with the next", 1.0),
}
"""What a key of the variability means, and the factor to the unit that is shown."""
_SYMMETRY = {
    "odd": "opposite in the two directions",
    "even": "the same in both directions",
    "mixed": "neither opposite nor the same in the two directions",
}
_LOCATION = {
    "path": "place in the signal path",
    "window_s": "time after a movement begins",
    "band_hz": "frequencies",
    "direction": "direction of the movements",
    "symmetry": "torque that is missing",
    "depends_on": "it depends on",
}


def words(name: str) -> str:
    """Return the name of a term or of a quantity with blanks."""
    return name.replace("_", " ")


def sentence(text: str) -> str:
    """Return a remark as a sentence: with a capital, a full stop and the names of terms in words.

    Parameters
    ----------
    text
        As the verdict holds it, as ``stiffness_drift.kt ended at the bound of its range``.
    """
    told, first = in_words(text), _NAME.match(text)
    # A symbol keeps its case.
    if first is None or first.group(1) not in term_library() or not first.group(2):
        told = told[:1].upper() + told[1:]
    return told if told.endswith((".", "!", "?")) else f"{told}."


def in_words(text: str) -> str:
    """Return a text in which the names of terms and of their parameters are words: ``kt of
    stiffness drift`` for ``stiffness_drift.kt``.
    """
    library = term_library()

    def named(match: re.Match[str]) -> str:
        name, symbol = match.group(1), match.group(2)
        if name not in library:
            return match.group(0)
        return f"{symbol} of {words(name)}" if symbol else words(name)

    return _NAME.sub(named, text)


def vaf_text(vaf: float) -> str:
    """Return a VAF [%] as text: with one decimal, and near 100 % with two digits of what is left.

    What a model leaves of a recording with little noise is a small part of a per cent: 99.96 and
    99.99 % are far apart.

    Parameters
    ----------
    vaf
        In per cent; a dash stands for a value that is not finite.
    """
    return f"{vaf:.{_places(vaf)}f}" if np.isfinite(vaf) else "-"


def rounded_vaf(vaf: float) -> float:
    """Return a VAF [%] with the digits that ``verdict.json`` states: two decimals, or those of
    `vaf_text` where these are more.
    """
    return round(vaf, max(_places(vaf), _PLACES_IN_FILE))


def _places(vaf: float) -> int:
    left = abs(100.0 - vaf)
    if left < 10.0**-_MOST_PLACES or not np.isfinite(left):
        return 1
    return min(max(1 - Decimal(f"{left:.1e}").adjusted(), 1), _MOST_PLACES)


def variability_rows(found: dict[str, dict[str, Any]]) -> list[list[str]]:
    """Return the variability of a verdict as rows of a table: what it is, and its value with its
    standard error.

    Parameters
    ----------
    found
        The ``variability`` of a verdict.
    """
    rows = []
    for name, entry in found.items():
        for key, value in entry.items():
            meaning, factor = _MEASURES.get(key, (with_unit(key), 1.0))
            if isinstance(value, list):
                number, error = (factor * float(part) for part in value)
                text = with_error((number, error))
            else:
                text = three_digits(factor * float(value))
            rows.append([f"{words(name)}: {meaning}", text])
    return rows


def location_rows(found: dict[str, Any]) -> list[list[str]]:
    """Return where the mismatch sits as rows of a table, in words.

    Parameters
    ----------
    found
        The ``localisation`` of a verdict; what is not seen there says so itself.
    """
    rows = []
    for key, meaning in _LOCATION.items():
        if key not in found:
            continue
        value = found[key]
        if key == "window_s" and not isinstance(value, str):
            text = f"{1000 * value[0]:.0f} to {1000 * value[1]:.0f} ms"
        elif key == "band_hz" and not isinstance(value, str):
            text = f"{value[0]:g} to {value[1]:g} Hz"
        else:
            text = _SYMMETRY.get(value, str(value))
        rows.append([meaning, text])
    return rows
