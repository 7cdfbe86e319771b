"""Columns of a table as signals in SI with times: what is stated about them is applied here."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from ankle_interfaces.continuity import RATE_TOLERANCE, Continuity
from session_recorder.errors import ImportRefused
from session_recorder.importing.sampling import judge_times, repeated_times, resample_columns
from session_recorder.importing.statement import EMG_TOPIC, RATE_RANGE

SHOWN_FINDINGS = 5


@dataclass
class Signals:
    """Holds columns in SI on their way into a bag, and what was found about them.

    Attributes
    ----------
    time
        [s], shape (n,).
    rate
        Sampling rate [Hz].
    columns
        Values of each column, shape (n,), by topic.
    warnings
        One sentence each.
    contradictions
        Where the data contradict what is stated, one sentence each.
    """

    time: np.ndarray
    rate: float
    columns: dict[str, dict[str, np.ndarray]]
    warnings: list[str] = field(default_factory=list)
    contradictions: list[str] = field(default_factory=list)


def convert(
    columns: Mapping[str, str],
    stated: Mapping[str, tuple[str, str, float]],
    table: Mapping[str, np.ndarray],
    sign: float,
    rate: float | None,
    resample: float | None,
    neutral: float = 0.0,
    direction: float = 1.0,
) -> Signals:
    """Return the columns of a table in SI, on even times where that is asked for or harmless.

    Parameters
    ----------
    columns
        Stated name -> column of the table.
    stated
        What `meaning` says of each stated name.
    table
        Values of the file by column.
    sign
        1 or -1 for torque.
    rate, resample, neutral
        See `import_recording`.
    direction
        1 or -1 for angles, velocities and torque.

    Raises
    ------
    ImportRefused
        There are no two samples, or the times cannot be those of a recording.
    """
    signals = Signals(np.empty(0), rate or 0.0, {})
    for name, (topic, column, factor) in stated.items():
        values = table[columns[name]]
        if topic and column == "position[rad]":
            values = values - neutral
        values = values * (factor * sign if column == "torque[N.m]" else factor)
        if topic:
            turned = values if topic == EMG_TOPIC else values * direction
            signals.columns.setdefault(topic, {})[column] = turned
        else:
            signals.time = values
    length = len(next(iter(table.values())))
    if length < 2:
        raise ImportRefused(f"{length} sample(s); a recording has at least 2")
    if len(signals.time):
        _keep_dated(signals)
        _keep_once(signals)
        _make_even(signals, resample)
        _check_time(signals, rate)
    else:
        signals.time = np.arange(length) / signals.rate
        if resample is not None:
            _make_even(signals, resample)
    return signals


def _keep_dated(signals: Signals) -> None:
    finite = np.isfinite(signals.time)
    if finite.all():
        return
    signals.warnings.append(f"{int((~finite).sum())} samples have no time and are left out")
    _keep(signals, finite)


def _keep_once(signals: Signals) -> None:
    """Leave out samples that repeat the time of the sample before, which has their place."""
    repeated = repeated_times(signals.time)
    if not repeated.any():
        return
    at = np.flatnonzero(repeated)
    columns = [values for held in signals.columns.values() for values in held.values()]
    same = np.all([np.equal(v[at], v[at - 1]) for v in columns], axis=0)
    signals.warnings.append(
        f"{len(at)} samples have the time of the sample before them (first at t = "
        f"{signals.time[at[0]]:.6f} s) and are left out; {int(same.sum())} of them hold the same "
        "numbers as well"
    )
    _keep(signals, ~repeated)


def _keep(signals: Signals, kept: np.ndarray) -> None:
    signals.time = signals.time[kept]
    signals.columns = {
        topic: {name: v[kept] for name, v in held.items()}
        for topic, held in signals.columns.items()
    }


def _make_even(signals: Signals, resample: float | None) -> None:
    """Put irregular or rounded times onto an even grid; the rate is that of the time column."""
    try:
        sampling = judge_times(signals.time)
    except ValueError as error:
        raise ImportRefused(f"time column: {error}") from None
    signals.rate = sampling.rate
    likely = RATE_RANGE[0] <= sampling.rate <= RATE_RANGE[1]
    if sampling.kind == "rounded" and resample is None and likely:
        signals.time = signals.time[0] + np.arange(len(signals.time)) / sampling.rate
        signals.warnings.append(sampling.sentence)
        return
    if sampling.kind == "irregular" and resample is None and likely:
        raise ImportRefused(
            f"time column: {sampling.sentence}. Estimators need even steps: add --resample "
            f"{sampling.rate:.6g} (interpolates along lines; pauses stay gaps)"
        )
    if resample is None:
        return
    signals.rate = resample or sampling.rate
    flat = {(topic, name): v for topic, held in signals.columns.items() for name, v in held.items()}
    before = len(signals.time)
    grid, columns, left_out = resample_columns(
        signals.time, {"\n".join(key): values for key, values in flat.items()}, signals.rate
    )
    signals.time = grid
    signals.columns = {topic: {} for topic in signals.columns}
    for key, values in columns.items():
        topic, name = key.split("\n")
        signals.columns[topic][name] = values
    signals.warnings.append(
        f"{sampling.sentence or 'the sampling is regular'}; resampled from {before} samples to "
        f"{len(grid)} at {signals.rate:.6g} Hz"
        + (f", {left_out} in pauses left out" if left_out else "")
    )


def _check_time(signals: Signals, stated_rate: float | None) -> None:
    if not RATE_RANGE[0] <= signals.rate <= RATE_RANGE[1]:
        raise ImportRefused(
            f"the time column steps by {1 / signals.rate:g} s, a rate of {signals.rate:g} Hz; "
            f"expected {RATE_RANGE[0]:g} to "
            f"{RATE_RANGE[1]:g} Hz. Is it in {'ms or us' if signals.rate < RATE_RANGE[0] else 's'}?"
        )
    if stated_rate is not None and abs(signals.rate / stated_rate - 1) > RATE_TOLERANCE:
        signals.contradictions.append(
            f"the stated sampling rate is {stated_rate:g} Hz, the time column steps at "
            f"{signals.rate:.6g} Hz"
        )
    findings = Continuity(signals.rate).check(signals.time[:, None])
    backwards = [finding.message for finding in findings if finding.kind == "backwards"]
    others = [finding.message for finding in findings if finding.kind != "backwards"]
    for sentences, out in ((backwards, signals.contradictions), (others, signals.warnings)):
        out += sentences[:SHOWN_FINDINGS]
        if len(sentences) > SHOWN_FINDINGS:
            out.append(f"and {len(sentences) - SHOWN_FINDINGS} more like these")
