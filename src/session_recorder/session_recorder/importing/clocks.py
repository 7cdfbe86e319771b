"""Which signals of a file share their times: one may be faster than another, or have a time column
of its own.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import numpy as np

from ankle_interfaces.continuity import RATE_TOLERANCE
from session_recorder.importing.column_names import MUSCLES, counts_samples, quantity_of
from session_recorder.importing.laboratory_units import to_si
from session_recorder.importing.sampling import Sampling, judge_times, resample_columns
from session_recorder.importing.statement import EMG_TOPIC, meaning
from session_recorder.importing.table import TIME, Table

FEWEST_TIMES = 100
"""Numbers of a column that can be a time; two seconds at the lowest rate."""
MAX_STEP = 1000
"""Largest number of rows from one number to the next of a slower signal: 10 Hz beside 10 kHz."""


@dataclass(frozen=True)
class Clock:
    """Says when the numbers of a column were taken.

    Attributes
    ----------
    time
        Name of the time column; None where a rate gives the times.
    rate
        Sampling rate [Hz] that the file states for this column; None without.
    step, first
        Rows from one number to the next, and the first that has one. A signal that is slower than
        its table has blank cells in the rows between.
    """

    time: str | None
    rate: float | None
    step: int
    first: int

    def rows(self, values: np.ndarray) -> np.ndarray:
        """Return the numbers of a column, without the blank cells between them."""
        return values[self.first :: self.step]


@dataclass(frozen=True)
class Part:
    """Holds stated columns that share one clock.

    Attributes
    ----------
    columns
        Stated name -> column of the table; with a time wherever the file gives one.
    values
        Numbers by column, each of shape (n,).
    emg
        Whether these are EMG, and nothing else.
    notes
        What a reader should know of the times, one sentence each.
    """

    columns: dict[str, str]
    values: dict[str, np.ndarray]
    emg: bool
    notes: tuple[str, ...] = field(default=())


def own_times(table: Table) -> dict[str, str]:
    """Return the time column of every column, where a table has several that differ.

    In a structure it is the one of the same structure, else the one of the same length; in a table
    of rows the one before the column. Equal times count as one. The time columns themselves are
    among the keys.
    """
    times = time_columns(table)
    if len(times) < 2:
        return {}
    first = {name: next(t for t in times if _same_times(table, t, name)) for name in times}
    if len(set(first.values())) < 2:
        return {}
    owner: dict[str, str] = {}
    before: str | None = None
    by_length = len({len(values) for values in table.columns.values()}) > 1
    inside = len({name.rpartition(".")[0] for name in times}) > 1
    for name, values in table.columns.items():
        if name in first:
            owner[name] = before = first[name]
            continue
        alike = [t for t in times if len(table.columns[t]) == len(values)]
        if inside:
            near = [t for t in alike if t.rpartition(".")[0] == name.rpartition(".")[0]]
            alike = near or alike
        if not by_length and not inside:
            alike = [before] if before is not None else []
        if len({first[t] for t in alike}) == 1:
            owner[name] = first[alike[0]]
    return {} if _is_one_clock(table, first) else owner


def time_columns(table: Table) -> list[str]:
    """Return the names of the columns that are times by their names and their numbers."""
    return [name for name in table.columns if _is_time(table, name)]


def _is_time(table: Table, name: str) -> bool:
    values = table.columns[name]
    if quantity_of(name, table.units.get(name)) != "t" or counts_samples(name):
        return False
    finite = np.isfinite(values)
    count = int(np.count_nonzero(finite))
    # A time that ends before the others has its blanks below its last number.
    if count < FEWEST_TIMES or not finite[:count].all():
        return False
    try:
        return judge_times(values[:count]).kind != "irregular"
    except ValueError:
        return False


def _same_times(table: Table, one: str, other: str) -> bool:
    return np.array_equal(table.columns[one], table.columns[other], equal_nan=True)


def _is_one_clock(table: Table, first: Mapping[str, str]) -> bool:
    """Return whether times that differ count the same samples, as the time of day beside that since
    the start does. Columns of one name, one for each signal, are taken at their word.
    """
    names = list(dict.fromkeys(first.values()))
    if len({name.rpartition(":")[0] or name for name in names}) < len(names):
        return False
    if len({len(table.columns[name]) for name in names}) > 1:
        return False
    counts = [np.count_nonzero(np.isfinite(table.columns[name])) for name in names]
    rates = [
        _seconds_rate(table, name, int(count)) for name, count in zip(names, counts, strict=True)
    ]
    return len(set(counts)) == 1 and max(rates) < (1.0 + RATE_TOLERANCE) * min(rates)


def _seconds_rate(table: Table, name: str, count: int) -> float:
    """Return the rate [Hz] of a time column; of one without a unit as if it were in seconds."""
    unit = table.units.get(name) or "s"
    return judge_times(table.columns[name][:count] * to_si(unit)[1]).rate


def clock_of(table: Table, column: str, time: str | None) -> Clock:
    """Return the clock of a column.

    Parameters
    ----------
    table
        Values of the file by column.
    column
        Name of a column.
    time
        Time column that is stated for the file; None without. Where the file has several, that of
        the column itself counts.
    """
    own = table.times.get(column, time) if time in table.times else time
    step, first = _blanks_between(table.columns.get(column, np.empty(0)))
    return Clock(None if own == TIME else own, table.rates.get(column), step, first)


def _blanks_between(values: np.ndarray) -> tuple[int, int]:
    """Return how many rows lie from one number to the next, and the first row with one."""
    at = np.flatnonzero(np.isfinite(values))
    if len(at) < FEWEST_TIMES or 2 * len(at) > len(values) + 1:
        return 1, 0
    step = int(np.median(np.diff(at)))
    if not 2 <= step <= MAX_STEP or np.any((at - at[0]) % step):
        return 1, 0
    return step, int(at[0] % step)


def parts(
    table: Table, columns: Mapping[str, str], stated: Mapping[str, tuple[str, str, float]]
) -> list[Part]:
    """Return the stated columns by clock; angle and torque before EMG.

    Parameters
    ----------
    table
        Values of the file by column.
    columns
        Stated name -> column of the table.
    stated
        What `meaning` says of each stated name.

    Raises
    ------
    ImportRefused
        A column is not there or refused, or those of one clock have different lengths.
    """
    time_name = next((name for name, (topic, _, _) in stated.items() if not topic), None)
    time = columns[time_name] if time_name else None
    groups: dict[Clock, dict[str, str]] = {}
    for name, column in columns.items():
        if name != time_name:
            groups.setdefault(clock_of(table, column, time), {})[name] = column
    if len(groups) < 2 and all(clock.step == 1 for clock in groups):
        held = table.choose(list(dict.fromkeys(columns.values())))
        return [Part(dict(columns), held, all(stated[n][0] in ("", EMG_TOPIC) for n in columns))]
    made = [_part(table, clock, held, time_name, time) for clock, held in groups.items()]
    return sorted(made, key=lambda part: part.emg)


def _part(
    table: Table, clock: Clock, held: dict[str, str], time_name: str | None, time: str | None
) -> Part:
    names = dict(held)
    own = clock.time or (TIME if time == TIME or clock.rate or clock.step > 1 else None)
    notes = []
    if own is not None:
        unit = table.units.get(own) or (time_name or "t[s]")[2:-1]
        names[f"t[{unit}]"] = own
    values = table.choose(list(dict.fromkeys(names.values())))
    if own == clock.time and own != time:
        notes.append(f"{', '.join(held.values())}: the time is '{own}', its own time column")
    values = {name: clock.rows(v) for name, v in values.items()}
    if clock.step > 1:
        notes.append(
            f"{', '.join(held.values())}: numbers stand in every {clock.step}th row alone; only "
            "these rows are taken, which is a slower rate"
        )
    if clock.time in table.times:
        filled = np.any([np.isfinite(v) for v in values.values()], axis=0)
        end = int(np.flatnonzero(filled)[-1]) + 1 if filled.any() else 0
        values = {name: v[:end] for name, v in values.items()}
    emg = all(meaning(name)[0] == EMG_TOPIC for name in held)
    return Part(names, values, emg, tuple(notes))


def main_column(found: Mapping[str, str]) -> str | None:
    """Return the column whose clock is that of the recording: the angle, else torque, else EMG."""
    order = ("position", "torque", "velocity", *MUSCLES)
    return next((found[quantity] for quantity in order if quantity in found), None)


def on_one_clock(
    table: Table, names: list[str], time: str | None, unit: str, sampling: Sampling
) -> tuple[Table, Sampling, bool]:
    """Return a table in which columns can be compared, row by row.

    Parameters
    ----------
    table
        Values of the file by column.
    names
        Columns to bring to one clock, the first of which is that of ``sampling``.
    time, unit
        Time column of the file with its unit; None where a rate gives the times.
    sampling
        Of the rows of the time column.

    Returns
    -------
    tuple[Table, Sampling, bool]
        The table, its sampling, and whether the columns had different clocks: they then are on an
        even grid of the highest rate.
    """
    clocks = {name: clock_of(table, name, time) for name in names}
    different = set(clocks.values())
    if not different or (len(different) == 1 and next(iter(different)).step == 1):
        return table, sampling, False
    factor = meaning(f"t[{unit}]")[2]
    held: dict[str, tuple[np.ndarray, np.ndarray]] = {}
    for name, clock in clocks.items():
        values = clock.rows(table.columns[name])
        if clock.time is not None:
            times = clock.rows(table.columns[clock.time]) * factor
        else:
            rate = clock.rate or table.rate or sampling.rate
            times = (clock.first + clock.step * np.arange(len(values))) / rate
        dated = np.isfinite(times)
        held[name] = (times[dated], values[dated])
    rates = {name: judge_times(times).rate for name, (times, _) in held.items()}
    if len(different) == 1:
        columns = {name: values for name, (_, values) in held.items()}
        kind = replace(sampling, rate=max(rates.values()))
        return replace(table, columns={**table.columns, **columns}), kind, False
    rate = max(rates.values())
    columns = {}
    for name, (times, values) in held.items():
        grid, made, _ = resample_columns(times, {name: values}, rate)
        columns[name] = made[name] if len(grid) else values
    shortest = min(len(values) for values in columns.values())
    columns = {name: values[:shortest] for name, values in columns.items()}
    judged = replace(table, columns={**table.columns, **columns})
    return judged, Sampling("regular", rate), True
