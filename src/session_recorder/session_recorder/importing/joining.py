"""Parts of a recording with clocks of their own: angle and torque on one, EMG on another."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from session_recorder.errors import ImportRefused
from session_recorder.importing.clocks import Part
from session_recorder.importing.conversion import Signals, convert
from session_recorder.importing.sampling import judge_times
from session_recorder.importing.statement import meaning

DURATION_TOLERANCE = 0.02
"""Part by which EMG may last longer or shorter than angle and torque, as where one device stops
later. A rate that is stated wrongly is wrong by more."""


def convert_parts(
    source: Path,
    parts: Sequence[Part],
    sign: float,
    rate: float | None,
    resample: float | None,
    neutral: float,
    direction: float,
) -> list[Signals]:
    """Return the signals of each clock in SI, angle and torque before EMG.

    Parameters
    ----------
    source
        The file.
    parts
        See `clocks.parts`.
    sign, rate, resample, neutral, direction
        See `conversion.convert`.

    Raises
    ------
    ImportRefused
        Signals that belong together have different rates, and none is stated to bring them to; or
        what `convert` refuses.
    """
    made: list[Signals] = []
    for emg in (False, True):
        chosen = [part for part in parts if part.emg is emg]
        if not chosen:
            continue
        if len(chosen) > 1 and resample is None:
            raise ImportRefused(_different_rates(source, chosen, rate))
        to = resample
        if len(chosen) > 1 and resample == 0:
            to = max(_rate_of(part, rate) for part in chosen)
        elif len(chosen) == 1 and emg and made and _is_even(chosen[0]):
            to = None  # its own topic keeps its own rate
        stated_rate = None if made else rate
        converted = [_signals(part, sign, stated_rate, to, neutral, direction) for part in chosen]
        made.append(_on_one_grid(converted) if len(converted) > 1 else converted[0])
    if len(made) > 1:
        made[0].contradictions += _together(made[0], made[1])
    return made


def _signals(
    part: Part,
    sign: float,
    rate: float | None,
    resample: float | None,
    neutral: float,
    direction: float,
) -> Signals:
    stated = {name: meaning(name) for name in part.columns}
    signals = convert(part.columns, stated, part.values, sign, rate, resample, neutral, direction)
    signals.warnings[:0] = part.notes
    return signals


def _times(part: Part) -> np.ndarray | None:
    """Return the finite times of a part [s]; None where a stated rate gives them."""
    for name, column in part.columns.items():
        if name.startswith("t["):
            times = part.values[column] * meaning(name)[2]
            return np.asarray(times[np.isfinite(times)])
    return None


def _rate_of(part: Part, rate: float | None) -> float:
    times = _times(part)
    try:
        return judge_times(times).rate if times is not None else rate or 0.0
    except ValueError as error:
        raise ImportRefused(f"time column: {error}") from None


def _is_even(part: Part) -> bool:
    times = _times(part)
    try:
        return times is None or judge_times(times).kind != "irregular"
    except ValueError:
        return True


def _different_rates(source: Path, chosen: Sequence[Part], rate: float | None) -> str:
    rates = {part.columns[name]: _rate_of(part, rate) for part in chosen for name in _names(part)}
    listed = ", ".join(f"{name} {value:g} Hz" for name, value in rates.items())
    return (
        f"{source}: the signals have different sampling rates: {listed}. Bring them to one rate: "
        f"add --resample {max(rates.values()):.6g}; or leave one out"
    )


def _names(part: Part) -> list[str]:
    return [name for name in part.columns if not name.startswith("t[")]


def _on_one_grid(converted: Sequence[Signals]) -> Signals:
    """Return signals of one rate and different times on the even grid of the times that all have;
    where one has a gap, its samples are NaN.
    """
    rate = converted[0].rate
    begin = max(float(signals.time[0]) for signals in converted)
    end = min(float(signals.time[-1]) for signals in converted)
    if not end - begin > 2.0 / rate:
        raise ImportRefused("the signals have no time in common: each of them has its own times")
    grid = begin + np.arange(int((end - begin) * rate + 1e-6) + 1) / rate
    joined = Signals(grid, rate, {})
    for signals in converted:
        behind = np.clip(np.searchsorted(signals.time, grid), 1, len(signals.time) - 1)
        step = signals.time[behind] - signals.time[behind - 1]
        inside = step * rate < 1.5
        for topic, held in signals.columns.items():
            for name, values in held.items():
                made = np.where(inside, np.interp(grid, signals.time, values), np.nan)
                joined.columns.setdefault(topic, {})[name] = made
        joined.warnings += [w for w in signals.warnings if w not in joined.warnings]
        joined.contradictions += signals.contradictions
    return joined


def _together(main: Signals, emg: Signals) -> list[str]:
    """Return how EMG contradicts to be of the same trial as angle and torque."""
    spans = [(float(s.time[0]), float(s.time[-1])) for s in (main, emg)]
    lengths = [len(s.time) / s.rate for s in (main, emg)]
    common = min(end for _, end in spans) - max(begin for begin, _ in spans)
    said = (
        f"angle and torque last from {spans[0][0]:.6g} to {spans[0][1]:.6g} s, EMG from "
        f"{spans[1][0]:.6g} to {spans[1][1]:.6g} s"
    )
    if common <= 0:
        return [f"{said}: no time is common to both"]
    if abs(lengths[1] / lengths[0] - 1.0) > DURATION_TOLERANCE:
        return [f"{said}: is one of the rates wrong? Leave the EMG out, or correct it"]
    return []


def shift_to_zero(parts: Sequence[Signals]) -> None:
    """Add whole seconds to all times where some are negative, which a bag cannot hold."""
    begin = min(float(signals.time.min()) for signals in parts)
    if begin >= 0:
        return
    shift = float(-np.floor(begin))
    parts[0].warnings.append(
        f"time begins before 0: {shift:g} s are added, because a bag's times are not negative"
    )
    for signals in parts:
        signals.time = signals.time + shift
