"""Which column of an unknown file is the time, or which rate takes its place."""

from __future__ import annotations

from collections.abc import Iterable

import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.clocks import main_column, on_one_clock
from session_recorder.importing.column_names import counts_samples
from session_recorder.importing.laboratory_units import to_si
from session_recorder.importing.proposal import Proposal
from session_recorder.importing.sampling import (
    MAX_GRID,
    Sampling,
    judge_times,
    repeated_times,
)
from session_recorder.importing.table import TIME, Table

_TIME_UNITS = ("s", "ms", "us")
_MECHANICAL = ("position", "torque", "velocity", "reference_position", "reference_velocity")
"""Quantities that are compared sample by sample."""
_MAX_COMPARED_COLUMNS = 6
"""Columns of one quantity that are compared; more are markers or other joints."""
_LIKELY_RATE = (50.0, 20_000.0)  # Hz
_RATE_AGREEMENT = 0.01
"""Part by which a stated rate may differ from that of the time column without a doubt."""
_SERIAL_DATES = (20_000.0, 80_000.0)
"""[d] Dates as Excel counts them, in days since 1900: from 1954 to 2119."""


def find_time(table: Table, found: dict[str, str], proposal: Proposal) -> Sampling:
    """Find the time of the samples, and state it in the proposal.

    Parameters
    ----------
    table
        Values of the file by column.
    found
        Columns whose names are known, by quantity; the time is taken out.
    proposal
        Gets the time's column or the rate, with its reason.

    Raises
    ------
    ImportRefused
        Nothing gives the time; the message says what to state.
    """
    main = main_column(found) or ""
    stated = found.pop("t", None)
    name = table.times.get(main) or stated or _counting_column(table)
    if name is not None:
        times = table.columns[name][np.isfinite(table.columns[name])]
        times = times[~repeated_times(times)]
        unit = table.units.get(name) or time_unit(times)
        if unit is not None and len(times) > 1:
            try:
                sampling = judge_times(times * to_si(unit)[1])
            except ValueError as error:
                raise ImportRefused(
                    f"{table.source}: '{name}' looks like the time, but {error}; state the "
                    "sampling rate instead: --rate HZ"
                ) from None
            proposal.columns[f"t[{unit}]"] = name
            proposal.reasons.append(
                f"'{name}' is the time in {unit}: it steps at {sampling.rate:.6g} Hz"
            )
            if table.rate and abs(sampling.rate / table.rate - 1.0) > _RATE_AGREEMENT:
                proposal.doubts.append(
                    f"a rate of {table.rate:.6g} Hz is stated, but '{name}' steps at "
                    f"{sampling.rate:.6g} Hz, which counts: is '{name}' in {unit}?"
                )
            if table.times:
                proposal.reasons.append("each signal has the times of its own time column")
            if sampling.kind == "irregular":
                proposal.resample = sampling.rate
            if sampling.sentence:
                proposal.doubts.append(sampling.sentence)
            return sampling
    rate = table.rates.get(main) or (None if main else next(iter(table.rates.values()), None))
    if rate is not None:
        if TIME not in table.columns:
            proposal.columns["t[s]"] = TIME
        proposal.reasons.append(f"the file states a sampling rate of {rate:.6g} Hz")
        return Sampling("regular", rate)
    if table.rate is not None:
        proposal.rate = table.rate
        proposal.reasons.append(f"the file's header states a sampling rate of {table.rate:.6g} Hz")
        return Sampling("regular", table.rate)
    raise ImportRefused(
        f"{table.source}: no column looks like the time and the file states no sampling rate; it "
        f"holds {', '.join(table.names)}. State the rate [Hz] of its samples, as in: ankle "
        f"import {table.source} --rate 2048"
    )


def _counting_column(table: Table) -> str | None:
    """Return a column that can only be time: it rises in even steps of a plausible size."""
    for name, values in table.columns.items():
        if name in table.rates or counts_samples(name) or len(values) < 100:
            continue
        steps = np.diff(values)
        if not np.isfinite(steps).all() or np.any(steps <= 0):
            continue
        step = float(np.median(steps))
        if np.max(np.abs(steps - step)) < 0.1 * step and time_unit(values) is not None:
            return name
    return None


def time_unit(times: np.ndarray) -> str | None:
    """Return the unit in which a column of times has a likely rate; None for a counter."""
    if len(times) < 2:
        return None
    steps = np.diff(times)
    step = float(np.mean(steps[steps > 0])) if np.any(steps > 0) else 0.0
    if step <= 0 or (step == 1.0 and np.array_equal(times, np.round(times))):
        return None
    dated = _SERIAL_DATES[0] < times[0] < _SERIAL_DATES[1] and step < 1e-6
    for unit in ("d",) if dated else _TIME_UNITS:
        if _LIKELY_RATE[0] <= 1.0 / (step * to_si(unit)[1]) <= _LIKELY_RATE[1]:
            return unit
    return None


def comparable(
    table: Table,
    candidates: dict[str, list[str]],
    found: dict[str, str],
    sampling: Sampling,
    proposal: Proposal,
) -> tuple[Table, Sampling]:
    """Return a table in which angle, torque and what goes with them have one clock.

    Parameters
    ----------
    table
        Values of the file by column.
    candidates
        Columns whose names say what they are, by quantity.
    found
        The likeliest of them, by quantity.
    sampling
        Of the time that is proposed.
    proposal
        Holds the time; gets the rate to resample to where the clocks differ.

    Returns
    -------
    tuple[Table, Sampling]
        The table with these columns on one clock, and its sampling.
    """
    main = main_column(found)
    names = [
        n
        for q, held in candidates.items()
        if q in _MECHANICAL
        for n in held[:_MAX_COMPARED_COLUMNS]
    ]
    if main not in names:
        return table, sampling
    time_name = next((n for n in proposal.columns if n.startswith("t[")), None)
    time = proposal.columns[time_name] if time_name else None
    judged, even, differ = on_one_clock(
        table, [main, *names], time, (time_name or "t[s]")[2:-1], sampling
    )
    if differ:
        proposal.resample = even.rate
        proposal.doubts.append(
            f"angle and torque have different sampling rates: they are brought to {even.rate:.6g} "
            "Hz"
        )
    return judged, even


def even_columns(
    table: Table, names: Iterable[str], sampling: Sampling, proposal: Proposal
) -> dict[str, np.ndarray]:
    """Return columns as they would be imported: evenly spaced, NaN where time has a gap."""
    columns = {name: table.columns[name] for name in names}
    time_name = next((c for n, c in proposal.columns.items() if n.startswith("t[")), None)
    if time_name is None or time_name not in table.columns:
        return columns
    unit = next(n for n in proposal.columns if n.startswith("t["))[2:-1]
    time = table.columns[time_name] * to_si(unit)[1]
    if any(len(values) != len(time) for values in columns.values()):
        return columns
    kept = ~repeated_times(time)
    time, columns = time[kept], {name: values[kept] for name, values in columns.items()}
    if sampling.kind == "irregular":
        order = np.argsort(time, kind="stable")
        order = order[np.isfinite(time[order])]
        if len(order) < 2 or (time[order[-1]] - time[order[0]]) * sampling.rate > MAX_GRID:
            return columns
        grid = np.arange(time[order[0]], time[order[-1]], 1.0 / sampling.rate)
        return {name: np.interp(grid, time[order], v[order]) for name, v in columns.items()}
    if sampling.kind == "rounded":
        return columns
    jumps = np.abs(np.diff(time, prepend=time[0] - 1.0 / sampling.rate) * sampling.rate - 1) > 0.5
    return {name: np.where(jumps, np.nan, values) for name, values in columns.items()}
