"""Tables of one file that belong to one recording, as angle and torque at one rate and EMG at
another: one table, whose columns keep their own times.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.clocks import own_times, time_columns
from session_recorder.importing.joining import DURATION_TOLERANCE
from session_recorder.importing.laboratory_units import to_si
from session_recorder.importing.table import TIME, Table
from session_recorder.importing.time_column import time_unit

_TITLE_SEPARATOR = "/"
"""Stands between the title of a table and the name of a column that another table has as well."""
_TIME_TOLERANCE = 1e-6
"""[s] Largest difference of times that are the same; a tenth of the smallest step that is read."""


def why_not_joined(main: Table, other: Table) -> str:
    """Return why a table does not belong to the recording of another; empty where it does.

    Parameters
    ----------
    main
        The table that holds the recording's angle and torque, or what there is of it.
    other
        The table that may be joined to it.
    """
    for table in (main, other):
        if not _is_dated(table):
            return _undated(table)
    spans = _span(main), _span(other)
    said = f"it lasts {_told(spans[1])}, and '{main.section}' {_told(spans[0])}"
    if min(end for _, end in spans) <= max(begin for begin, _ in spans):
        return f"{said}: no time is common to both"
    lengths = [end - begin for begin, end in spans]
    if abs(lengths[1] / lengths[0] - 1.0) > DURATION_TOLERANCE:
        return f"{said}: is it of another trial, or is a rate wrong?"
    return ""


def joined(tables: Sequence[Table]) -> Table:
    """Return several tables of a file as one.

    Parameters
    ----------
    tables
        At least two, each with a title or a number in `Table.section`.

    Returns
    -------
    Table
        With the columns of all. A name that an earlier table has as well gets the title of its
        table before it. `Table.times` says whose times are whose. A table without a time column
        gets one from its sampling rate, and begins with the first table that has times.

    Raises
    ------
    ImportRefused
        A table has neither a time column nor a sampling rate.
    """
    for table in tables:
        if not _is_dated(table):
            raise ImportRefused(f"{table.source}: '{table.section}': {_undated(table)}")
    main = tables[0]
    timed = next((table for table in tables if time_columns(table)), main)
    begin = _span(timed)[0]
    result = Table(main.source, section=main.section)
    result.sections = tuple(table.section for table in tables)
    for table in tables:
        if not time_columns(table):
            result.notes.append(
                f"'{table.section}' states {_rate(table):.6g} Hz and no times: it is taken to begin"
                f" at {begin:.6g} s" + (f", as '{timed.section}'" if timed is not table else "")
            )
            table = _with_times(table, begin)
        _append(result, table)
    _count_equal_times_as_one(result)
    return result


def _is_dated(table: Table) -> bool:
    return bool(time_columns(table)) or _rate(table) is not None


def _rate(table: Table) -> float | None:
    return table.rate or next(iter(table.rates.values()), None)


def _undated(table: Table) -> str:
    return (
        f"'{table.section}' has neither a time column nor a sampling rate; write one above its "
        "names, as 'Sampling rate (Hz): 2000'"
    )


def _span(table: Table) -> tuple[float, float]:
    """Return begin and end [s] of a table; one without times begins at 0."""
    times = time_columns(table)
    if not times:
        rows = max(len(values) for values in table.columns.values())
        return 0.0, (rows - 1) / (_rate(table) or 1.0)
    seconds = _seconds(table, times[0])
    dated = seconds[np.isfinite(seconds)]
    return float(dated[0]), float(dated[-1])


def _told(span: tuple[float, float]) -> str:
    return f"from {span[0]:.6g} to {span[1]:.6g} s"


def _unit(table: Table, time: str) -> str:
    values = table.columns[time]
    return table.units.get(time) or time_unit(values[np.isfinite(values)]) or "s"


def _with_times(table: Table, begin: float) -> Table:
    """Return a table with a column of times from its sampling rate."""
    rows = max(len(values) for values in table.columns.values())
    name = f"{table.section}{_TITLE_SEPARATOR}{TIME}"
    times = begin + np.arange(rows) / (_rate(table) or 1.0)
    return replace(
        table,
        columns={name: times, **table.columns},
        units={**table.units, name: "s"},
        rates={},
    )


def _append(result: Table, table: Table) -> None:
    """Add the columns of a table with their times."""
    taken = set(result.names)
    names = {
        name: f"{table.section}{_TITLE_SEPARATOR}{name}" if name in taken else name
        for name in table.names
    }
    times = time_columns(table)
    own = own_times(table) or dict.fromkeys(table.columns, times[0])
    for name, values in table.columns.items():
        result.columns[names[name]] = values
        if name in own:
            result.times[names[name]] = names[own[name]]
    result.units |= {names[name]: unit for name, unit in table.units.items()}
    result.units |= {names[time]: _unit(table, time) for time in times}
    result.refused |= {names[name]: reason for name, reason in table.refused.items()}
    result.notes += table.notes


def _seconds(table: Table, time: str) -> np.ndarray:
    values: np.ndarray = table.columns[time] * to_si(_unit(table, time))[1]
    return values


def _equal(one: np.ndarray, other: np.ndarray) -> bool:
    return len(one) == len(other) and np.allclose(
        one, other, rtol=0.0, atol=_TIME_TOLERANCE, equal_nan=True
    )


def _count_equal_times_as_one(table: Table) -> None:
    """Let columns of equal times share one clock; without different ones no column has its own."""
    first: dict[str, str] = {}
    for time in dict.fromkeys(table.times.values()):
        first[time] = next(
            (
                earlier
                for earlier in first.values()
                if _equal(_seconds(table, earlier), _seconds(table, time))
            ),
            time,
        )
    table.times = {name: first[time] for name, time in table.times.items()}
    if len(set(table.times.values())) < 2:
        table.times = {}
