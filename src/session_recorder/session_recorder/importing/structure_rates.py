"""Sampling rates in files of arrays: one for all, one for each structure, one by the name."""

from __future__ import annotations

import re
from collections.abc import Mapping

from session_recorder.importing.column_names import MUSCLES, quantity_of
from session_recorder.importing.table import Table

_RATE_NAMES = (
    "fs",
    "rate",
    "samplingrate",
    "samplerate",
    "samplingfrequency",
    "samplefrequency",
    "frequency",
    "hz",
)
"""Names of a rate, in small letters without underscores."""
_RATE_OF = re.compile(
    r"^(?:fs|rate)_?(?P<behind>\w+)$|^(?P<before>\w+?)_?(?:fs|rate)$", re.IGNORECASE
)
"""A rate with the name of what it belongs to, as in ``fs_emg`` and ``emg_fs``."""
_MECHANICAL_WORDS = (
    "kin",
    "kinematic",
    "kinematics",
    "mech",
    "motion",
    "dyn",
    "dynamics",
    "biodex",
)
"""What laboratories call angle and torque together."""
_MECHANICAL = ("position", "torque", "velocity", "reference_position", "reference_velocity")


def state_rates(table: Table, single: Mapping[str, float]) -> None:
    """State in a table which rate belongs to which column.

    A rate belongs to the columns of its structure; in a structure without columns, to those of the
    structure around it. A name as ``fs_emg`` says the columns itself. A name that says nothing
    known is left alone, and so are rates that contradict each other.

    Parameters
    ----------
    table
        Gets the rates.
    single
        Single positive numbers of the file, by name.
    """
    of_place: dict[str, set[float]] = {}
    for name, rate in single.items():
        place, _, own = name.rpartition(".")
        if own.lower().replace("_", "") in _RATE_NAMES:
            while place and not any(column.startswith(f"{place}.") for column in table.columns):
                place = place.rpartition(".")[0]
            of_place.setdefault(place, set()).add(rate)
    for place in sorted(of_place, key=len):
        if len(of_place[place]) > 1:
            rates = " and ".join(f"{rate:g}" for rate in sorted(of_place[place]))
            table.notes.append(f"the file states rates of {rates} Hz at one place; none is taken")
        elif not place:
            table.rate = min(of_place[place])
        else:
            for column in table.columns:
                if column.startswith(f"{place}."):
                    table.rates[column] = min(of_place[place])
    for name, rate in single.items():
        found = _RATE_OF.match(name.rpartition(".")[2])
        if found is None or name.rpartition(".")[2].lower().replace("_", "") in _RATE_NAMES:
            continue
        for column in _columns_of(table, (found["behind"] or found["before"]).lower()):
            table.rates[column] = rate


def _columns_of(table: Table, word: str) -> list[str]:
    """Return the columns that the word in the name of a rate means."""
    quantities = {name: quantity_of(name, table.units.get(name)) for name in table.columns}
    if word == "emg":
        return [name for name, q in quantities.items() if q in MUSCLES or "emg" in name.lower()]
    if word in _MECHANICAL_WORDS:
        return [name for name, q in quantities.items() if q in _MECHANICAL]
    kind = quantity_of(word, None)
    return [name for name, q in quantities.items() if q is not None and q == kind]
