"""Recordings of other systems into bags, in SI and with this project's signs.

The user states for every column its name and unit, the sampling rate or a time column, and the sign
of torque. What the data contradict is refused with the reason (`plausibility`), or, when forced,
recorded in the bag as a warning.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from ankle_interfaces.block import TIME_COLUMN, Block
from ankle_interfaces.saturation import saturation_sentences
from ankle_interfaces.topics import ANKLE_SAMPLES, PERTURBATION_REFERENCE
from ankle_physics.rig_agreement import rig_warnings
from ankle_physics.rig_file import RigFile
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import ImportRefused
from session_recorder.importing.clocks import Part, parts
from session_recorder.importing.conversion import Signals
from session_recorder.importing.joining import convert_parts, shift_to_zero
from session_recorder.importing.plausibility import (
    Intrinsic,
    check_intrinsic,
    check_ranges,
    check_velocity,
    intrinsic,
)
from session_recorder.importing.source_of_bag import source_record, without_name
from session_recorder.importing.statement import (
    DIRECTIONS,
    EMG_TOPIC,
    PROJECT_DIRECTION,
    TORQUE_SIGNS,
    check_grid,
    check_statement,
    check_units,
    meaning,
    spelled,
)
from session_recorder.importing.table import Table
from session_recorder.importing.tables import read_table
from session_recorder.mcap_file import Progress
from session_recorder.rig_of_bag import RIG_KEY

BLOCKS_PER_SECOND = 64


@dataclass(frozen=True)
class ImportReport:
    """Holds the outcome of `import_recording`.

    Attributes
    ----------
    bag
        The new bag.
    columns
        Of each topic.
    samples
        Imported.
    duration
        From the first to the last sample [s].
    rate
        Sampling rate [Hz] of angle and torque; of the EMG where there is nothing else.
    rates
        Sampling rate [Hz] of each topic.
    warnings
        Missing samples, contradictions that were forced, conversions worth knowing.
    ignored
        Columns of the source that were not stated.
    intrinsic
        What the torque's sign and the units were judged by; None where the data do not say.
    """

    bag: Path
    columns: dict[str, tuple[str, ...]]
    samples: int
    duration: float
    rate: float
    rates: dict[str, float]
    warnings: tuple[str, ...]
    ignored: tuple[str, ...]
    intrinsic: Intrinsic | None


def import_recording(
    source: Path | str | Table,
    bag: Path | str,
    columns: Mapping[str, str],
    *,
    torque_sign: str | None = None,
    rate: float | None = None,
    resample: float | None = None,
    neutral: float | None = None,
    positive: str | None = None,
    missing: str = "nan",
    force: bool = False,
    rig: RigFile | None = None,
    overwrite: bool = False,
    keep_source_name: bool = False,
    progress: Progress | None = None,
) -> ImportReport:
    """Import one recording into a new bag.

    Parameters
    ----------
    source
        A file of one of the kinds of `tables.READERS`, or a table that was read from one.
    bag
        The directory to create.
    columns
        Stated name with unit -> column of the source, as ``{"t[ms]": "time", "position[deg]":
        "angle"}``. Names: ``t``, those of `statement.QUANTITIES`, and muscles in a unit of voltage
        as ``SOL[mV]``.
    torque_sign
        ``rig`` (torque that moves the ankle, positive in dorsiflexion) or ``subject`` (the
        opposite); needed with a torque column.
    rate
        Sampling rate [Hz]; needed without a time column, compared with it otherwise.
    resample
        Rate [Hz] of an even grid onto which the samples are interpolated; 0 takes their mean rate.
        Needed where the time column is irregular.
    neutral
        Angle of the neutral ankle, in the unit of the position's column: 90 where a file counts
        the angle between shank and foot. It is taken off the measured and the commanded angle;
        None for 0.
    positive
        Direction in which the file's angle rises. With ``plantarflexion`` angles, velocities and
        torque are turned round; None for this project's ``dorsiflexion``.
    missing
        What becomes of samples that are not finite: ``nan`` keeps them, ``gap`` leaves them out.
    force
        Import in spite of contradictions; they are recorded in the bag.
    rig
        The calibrated rig that was in force; the bag carries it, and where the data contradict it
        there is a warning.
    overwrite
        Replace a bag that is there.
    keep_source_name
        Let the bag name its file, which may hold a person's name. Otherwise the bag states the
        file's SHA-256, format and size.
    progress
        Called with the fraction that is done.

    Raises
    ------
    ImportRefused
        The source is not readable, or what is stated is incomplete or contradicts the data.
    BagError
        The bag cannot be written.
    """
    columns = {spelled(name): column for name, column in columns.items()}
    stated = {name: meaning(name) for name in columns}
    check_statement(stated, torque_sign, rate, missing, positive)
    check_grid(resample)
    table = (
        source if isinstance(source, Table) else read_table(source, wanted=tuple(columns.values()))
    )
    source = table.source
    if table.rate is None:
        table = replace(table, rate=rate)
    by_clock = parts(table, columns, stated)
    ignored = _ignored(table, columns, by_clock)
    if progress:
        progress(0.3)
    sign = TORQUE_SIGNS[torque_sign or "rig"]
    direction = DIRECTIONS[positive or PROJECT_DIRECTION]
    converted = convert_parts(source, by_clock, sign, rate, resample, neutral or 0.0, direction)
    signals = converted[0]
    found = _check(converted, torque_sign or "rig", missing)
    shift_to_zero(converted)
    signals.warnings[:0] = table.notes
    signals.contradictions += check_units(columns, table.units)
    if signals.contradictions and not force:
        raise ImportRefused(f"{source}: " + "; ".join(signals.contradictions))
    signals.warnings += [f"forced: {sentence}" for sentence in signals.contradictions]
    if rig is not None:
        signals.warnings += _rig_contradictions(signals, rig)
    if progress:
        progress(0.5)
    with BagWriter(bag, overwrite=overwrite) as writer:
        written = _write(writer, converted, missing, progress)
        writer.custom_data.update(
            {
                **source_record(source, keep_source_name),
                **_texts(table, columns, signals.warnings, keep_source_name),
                "stated_torque_sign": torque_sign or "no torque",
                "stated_neutral": f"{neutral or 0.0:g}",
                "stated_positive": positive or PROJECT_DIRECTION,
                "sampling_rate[Hz]": f"{signals.rate!r}",
            }
        )
        if rig is not None:
            writer.custom_data[RIG_KEY] = rig.text()
    names = {topic: tuple(held) for s in converted for topic, held in s.columns.items()}
    rates = {topic: s.rate for s in converted for topic in s.columns}
    return ImportReport(
        writer.path,
        names,
        written,
        float(signals.time[-1] - signals.time[0]),
        signals.rate,
        rates,
        tuple(signals.warnings),
        tuple(ignored),
        found,
    )


def _ignored(table: Table, columns: Mapping[str, str], by_clock: Sequence[Part]) -> list[str]:
    """Return the columns of a table that are neither stated nor the time of one that is."""
    chosen = {name: values for part in by_clock for name, values in part.values.items()}
    held = [*columns.values(), *chosen, *table.times.values()]
    times = [table.columns[n] for n, t in table.times.items() if n == t]
    times += [chosen[c] for n, c in columns.items() if n.startswith("t[") and c in chosen]
    return [
        name
        for name in table.names
        if name not in held
        and f"{name}:1" not in table.columns  # a name that stands above several columns
        and not any(np.array_equal(table.columns.get(name, []), time) for time in times)
    ]


def _check(converted: Sequence[Signals], torque_sign: str, missing: str) -> Intrinsic | None:
    """Note in the first signals what is wrong with all; return what the torque was judged by."""
    signals = converted[0]
    found = _check_signals(signals, torque_sign)
    _report_missing(signals, missing)
    for other in converted[1:]:
        other.contradictions += check_ranges(other.columns[EMG_TOPIC])
        other.warnings += saturation_sentences(other.columns[EMG_TOPIC])
        _report_missing(other, missing)
        signals.warnings += [w for w in other.warnings if w not in signals.warnings]
        signals.contradictions += other.contradictions
    return found


def _texts(
    table: Table, columns: Mapping[str, str], warnings: Sequence[str], keep_source_name: bool
) -> dict[str, str]:
    """Return what a bag states of its source in words, with or without the file's name."""
    texts = {
        "imported_table": " and ".join(table.sections) or "the only one",
        "stated_columns": ", ".join(f"{name} = {column}" for name, column in columns.items()),
        "warnings": "\n".join(warnings),
    }
    if keep_source_name:
        return texts
    return {key: without_name(text, table.source) for key, text in texts.items()}


def _rig_contradictions(signals: Signals, rig: RigFile) -> list[str]:
    """Return in which ways the rig file contradicts the samples, one sentence each."""
    held = signals.columns.get(ANKLE_SAMPLES.absolute, {})
    named = {name.split("[")[0]: np.asarray(values) for name, values in held.items()}
    if "position" not in named or "torque" not in named:
        return []
    good = np.isfinite(np.column_stack(list(named.values()))).all(axis=1)
    if not good.all():
        return []
    # How old the calibration was is not known of a recording without a date.
    return rig_warnings(
        rig,
        signals.rate,
        named["position"],
        named.get("velocity"),
        named["torque"],
        now=rig.calibrated,
    )


def _check_signals(signals: Signals, torque_sign: str) -> Intrinsic | None:
    ankle = signals.columns.get(ANKLE_SAMPLES.absolute, {})
    reference = signals.columns.get(PERTURBATION_REFERENCE.absolute, {})
    measured = {**ankle, **signals.columns.get(EMG_TOPIC, {})}
    signals.contradictions += check_ranges(measured)
    signals.contradictions += [f"reference: {sentence}" for sentence in check_ranges(reference)]
    signals.warnings += saturation_sentences(measured, reference.get("position[rad]"))
    # Where samples are missing in time, neighbours are not one step apart: such a place is kept out
    # of the estimates.
    jumps = np.concatenate([[False], np.abs(np.diff(signals.time) * signals.rate - 1) > 0.5])
    position = ankle.get("position[rad]")
    if position is None:
        return None
    position = np.where(jumps, np.nan, position)
    if "velocity[rad/s]" in ankle:
        signals.contradictions += check_velocity(signals.rate, position, ankle["velocity[rad/s]"])
    if "torque[N.m]" not in ankle:
        return None
    found = intrinsic(signals.rate, position, ankle["torque[N.m]"])
    if found is None:
        signals.warnings.append(
            "units and sign of torque were not verified: the data show too little fast movement"
        )
        return None
    signals.contradictions += check_intrinsic(found, torque_sign)
    return found


def _report_missing(signals: Signals, missing: str) -> None:
    fate = "kept as NaN" if missing == "nan" else "left out as gaps"
    alike: dict[bytes, list[str]] = {}
    for held in signals.columns.values():
        for name, values in held.items():
            alike.setdefault((~np.isfinite(values)).tobytes(), []).append(name)
    for mask, names in alike.items():
        bad = np.flatnonzero(np.frombuffer(mask, dtype=bool))
        if len(bad):
            signals.warnings.append(
                f"{', '.join(names)}: {len(bad)} samples are missing or not finite, from t = "
                f"{signals.time[bad[0]]:.6f} to {signals.time[bad[-1]]:.6f} s; {fate}"
            )


def _write(
    writer: BagWriter, converted: Sequence[Signals], missing: str, progress: Progress | None
) -> int:
    """Write blocks of all topics in the order of time; return the samples of the longest topic of
    the first signals.
    """
    blocks: list[tuple[float, str, Block]] = []
    counts = []
    for signals in converted:
        size = max(1, round(signals.rate / BLOCKS_PER_SECOND))
        for topic, held in signals.columns.items():
            data = np.column_stack([signals.time, *held.values()])
            if missing == "gap":
                data = data[np.isfinite(data).all(axis=1)]
            else:
                data[~np.isfinite(data)] = np.nan
            names = (TIME_COLUMN, *held)
            pieces = [data[start : start + size] for start in range(0, len(data), size)]
            blocks += [(float(piece[0, 0]), topic, Block(names, piece)) for piece in pieces]
            if signals is converted[0]:
                counts.append(len(data))
            writer.add_topic(topic)
    blocks.sort(key=lambda entry: entry[0])
    for number, (_, topic, block) in enumerate(blocks):
        writer.write_block(topic, block)
        if progress and number % BLOCKS_PER_SECOND == 0:
            progress(0.5 + 0.5 * number / len(blocks))
    return max(counts)
