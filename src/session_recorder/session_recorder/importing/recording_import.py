"""Recordings of other systems into bags, in SI and with this project's signs.

The user states for every column its name and unit, the sampling rate or a time column, and the sign
of torque. What the data contradict is refused with the reason (`plausibility`), or, when forced,
recorded in the bag as a warning.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ankle_interfaces.block import TIME_COLUMN, Block
from ankle_interfaces.continuity import RATE_TOLERANCE, Continuity
from ankle_interfaces.errors import UnitError
from ankle_interfaces.topics import ANKLE_SAMPLES, EMG_SAMPLES, PERTURBATION_REFERENCE
from ankle_interfaces.units import split_column, to_si
from ankle_physics.rig_agreement import rig_warnings
from ankle_physics.rig_file import RigFile
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import ImportRefused
from session_recorder.importing.laboratory_units import known_unit
from session_recorder.importing.plausibility import (
    Intrinsic,
    check_intrinsic,
    check_ranges,
    check_velocity,
    intrinsic,
)
from session_recorder.importing.sampling import judge_times, resample_columns
from session_recorder.importing.tables import Table, read_table
from session_recorder.mcap_file import Progress
from session_recorder.rig_of_bag import RIG_KEY

# Torque positive in dorsiflexion: what the rig needs to move the ankle (this project), or what the
# subject exerts.
TORQUE_SIGNS = {"rig": 1.0, "subject": -1.0}
MISSING_POLICIES = ("nan", "gap")
# Quantity -> topic and column there. EMG columns have the muscle's name and a unit of voltage.
QUANTITIES = {
    "position": (ANKLE_SAMPLES.absolute, "position[rad]"),
    "velocity": (ANKLE_SAMPLES.absolute, "velocity[rad/s]"),
    "torque": (ANKLE_SAMPLES.absolute, "torque[N.m]"),
    "reference_position": (PERTURBATION_REFERENCE.absolute, "position[rad]"),
    "reference_velocity": (PERTURBATION_REFERENCE.absolute, "velocity[rad/s]"),
    "reference_acceleration": (PERTURBATION_REFERENCE.absolute, "acceleration[rad/s^2]"),
}
EMG_TOPIC = EMG_SAMPLES.absolute
# Slower does not show an ankle's mechanics, faster is no rig: such a rate is a time column in
# another unit.
RATE_RANGE = (50.0, 100_000.0)  # Hz
BLOCKS_PER_SECOND = 64
SHOWN_FINDINGS = 5


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
        Sampling rate [Hz].
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
    warnings: tuple[str, ...]
    ignored: tuple[str, ...]
    intrinsic: Intrinsic | None


@dataclass
class _Signals:
    """Columns in SI on their way into a bag, and what was found about them."""

    time: np.ndarray
    rate: float
    columns: dict[str, dict[str, np.ndarray]]
    warnings: list[str] = field(default_factory=list)
    contradictions: list[str] = field(default_factory=list)


def import_recording(
    source: Path | str | Table,
    bag: Path | str,
    columns: Mapping[str, str],
    *,
    torque_sign: str | None = None,
    rate: float | None = None,
    resample: float | None = None,
    missing: str = "nan",
    force: bool = False,
    rig: RigFile | None = None,
    overwrite: bool = False,
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
        "angle"}``. Names: ``t``, those of `QUANTITIES`, and muscles in a unit of voltage as
        ``SOL[mV]``.
    torque_sign
        ``rig`` (torque that moves the ankle, positive in dorsiflexion) or ``subject`` (the
        opposite); needed with a torque column.
    rate
        Sampling rate [Hz]; needed without a time column, compared with it otherwise.
    resample
        Rate [Hz] of an even grid onto which the samples are interpolated; 0 takes their mean rate.
        Needed where the time column is irregular.
    missing
        What becomes of samples that are not finite: ``nan`` keeps them, ``gap`` leaves them out.
    force
        Import in spite of contradictions; they are recorded in the bag.
    rig
        The calibrated rig that was in force; the bag carries it, and where the data contradict it
        there is a warning.
    overwrite
        Replace a bag that is there.
    progress
        Called with the fraction that is done.

    Raises
    ------
    ImportRefused
        The source is not readable, or what is stated is incomplete or contradicts the data.
    BagError
        The bag cannot be written.
    """
    columns = {_spelled(name): column for name, column in columns.items()}
    stated = {name: _meaning(name) for name in columns}
    _check_statement(stated, torque_sign, rate, missing)
    _check_grid(resample)
    table = source if isinstance(source, Table) else read_table(source)
    source = table.source
    chosen = table.choose(list(dict.fromkeys(columns.values())))
    ignored = [name for name in table.names if name not in chosen]
    if progress:
        progress(0.3)
    signals = _convert(columns, stated, chosen, TORQUE_SIGNS[torque_sign or "rig"], rate, resample)
    signals.warnings[:0] = table.notes
    signals.contradictions += _check_units(columns, table.units)
    found = _check_signals(signals, torque_sign or "rig")
    if signals.contradictions and not force:
        raise ImportRefused(f"{source}: " + "; ".join(signals.contradictions))
    signals.warnings += [f"forced: {sentence}" for sentence in signals.contradictions]
    _report_missing(signals, missing)
    if rig is not None:
        signals.warnings += _rig_contradictions(signals, rig)
    if progress:
        progress(0.5)
    with BagWriter(bag, overwrite=overwrite) as writer:
        written = _write(writer, signals, missing, progress)
        writer.custom_data.update(
            {
                "imported_from": Path(source).name,
                "stated_columns": ", ".join(
                    f"{name} = {column}" for name, column in columns.items()
                ),
                "stated_torque_sign": torque_sign or "no torque",
                "sampling_rate[Hz]": f"{signals.rate!r}",
                "warnings": "\n".join(signals.warnings),
            }
        )
        if rig is not None:
            writer.custom_data[RIG_KEY] = rig.text()
    names = {topic: tuple(held) for topic, held in signals.columns.items()}
    return ImportReport(
        writer.path,
        names,
        written,
        float(signals.time[-1] - signals.time[0]),
        signals.rate,
        tuple(signals.warnings),
        tuple(ignored),
        found,
    )


def _rig_contradictions(signals: _Signals, rig: RigFile) -> list[str]:
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


def _spelled(name: str) -> str:
    """Return a stated name with its unit in the project's spelling: ``torque[Nm]`` as
    ``torque[N.m]``.
    """
    quantity, bracket, unit = name.strip().rstrip("]").partition("[")
    return f"{quantity.strip()}[{known_unit(unit) or unit}]" if bracket else name


def _meaning(name: str) -> tuple[str, str, float]:
    """Return topic (empty for time), SI column and factor of a stated name."""
    try:
        quantity, unit = split_column(name)
        si, factor = to_si(unit)
    except UnitError as error:
        raise ImportRefused(str(error)) from None
    if quantity == "t":
        topic, column = "", TIME_COLUMN
    elif quantity in QUANTITIES:
        topic, column = QUANTITIES[quantity]
    elif si == "V":
        return EMG_TOPIC, f"{quantity}[V]", factor
    else:
        raise ImportRefused(
            f"'{name}': unknown quantity; known: t, {', '.join(QUANTITIES)}, and muscles in V, mV "
            "or uV"
        )
    expected = split_column(column)[1]
    if si != expected:
        raise ImportRefused(
            f"'{name}': {quantity} is given in '{unit}', expected {expected} or a multiple of it"
        )
    return topic, column, factor


def _check_statement(
    stated: Mapping[str, tuple[str, str, float]],
    torque_sign: str | None,
    rate: float | None,
    missing: str,
) -> None:
    held = [(topic, column) for topic, column, _ in stated.values()]
    if len(set(held)) < len(held):
        raise ImportRefused(f"a quantity is stated twice: {', '.join(stated)}")
    if all(not topic for topic, _ in held):
        raise ImportRefused(
            "no signal is stated; expected for example 'position[rad]' and 'torque[N.m]'"
        )
    if (ANKLE_SAMPLES.absolute, "torque[N.m]") in held and torque_sign is None:
        raise ImportRefused(
            "the sign of torque is not stated: 'rig' (torque that moves the ankle) or 'subject' "
            "(the opposite)"
        )
    if torque_sign is not None and torque_sign not in TORQUE_SIGNS:
        raise ImportRefused(
            f"torque sign '{torque_sign}' is not known; expected {' or '.join(TORQUE_SIGNS)}"
        )
    if missing not in MISSING_POLICIES:
        raise ImportRefused(
            f"policy '{missing}' for missing samples is not known; expected "
            f"{' or '.join(MISSING_POLICIES)}"
        )
    if rate is None and ("", TIME_COLUMN) not in held:
        raise ImportRefused("neither a sampling rate nor a time column is stated")
    if rate is not None and not RATE_RANGE[0] <= rate <= RATE_RANGE[1]:
        raise ImportRefused(
            f"sampling rate {rate:g} Hz is refused; allowed: {RATE_RANGE[0]:g} to "
            f"{RATE_RANGE[1]:g} Hz"
        )


def _check_grid(resample: float | None) -> None:
    if resample is not None and resample != 0 and not RATE_RANGE[0] <= resample <= RATE_RANGE[1]:
        raise ImportRefused(
            f"resampling to {resample:g} Hz is refused; allowed: {RATE_RANGE[0]:g} to "
            f"{RATE_RANGE[1]:g} Hz, or 0 for the mean rate of the samples"
        )


def _convert(
    columns: Mapping[str, str],
    stated: Mapping[str, tuple[str, str, float]],
    table: Mapping[str, np.ndarray],
    sign: float,
    rate: float | None,
    resample: float | None,
) -> _Signals:
    signals = _Signals(np.empty(0), rate or 0.0, {})
    for name, (topic, column, factor) in stated.items():
        values = table[columns[name]] * (factor * sign if column == "torque[N.m]" else factor)
        if topic:
            signals.columns.setdefault(topic, {})[column] = values
        else:
            signals.time = values
    length = len(next(iter(table.values())))
    if length < 2:
        raise ImportRefused(f"{length} sample(s); a recording has at least 2")
    if len(signals.time):
        _keep_dated(signals)
        _make_even(signals, resample)
        _check_time(signals, rate)
    else:
        signals.time = np.arange(length) / signals.rate
    return signals


def _check_units(columns: Mapping[str, str], declared: Mapping[str, str]) -> list[str]:
    """Return where a stated unit is another than the file declares; both are compared in SI, and
    what is no unit to us is not judged.
    """
    found = []
    for name, column in columns.items():
        stated = split_column(name)[1]
        try:
            own = to_si(declared.get(column, ""))
        except UnitError:
            continue
        if own != to_si(stated):
            found.append(
                f"'{name}' is stated in {stated}, the file declares '{column}' in "
                f"{declared[column]}"
            )
    return found


def _keep_dated(signals: _Signals) -> None:
    finite = np.isfinite(signals.time)
    if finite.all():
        return
    signals.warnings.append(f"{int((~finite).sum())} samples have no time and are left out")
    signals.time = signals.time[finite]
    signals.columns = {
        topic: {name: v[finite] for name, v in held.items()}
        for topic, held in signals.columns.items()
    }


def _make_even(signals: _Signals, resample: float | None) -> None:
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


def _check_time(signals: _Signals, stated_rate: float | None) -> None:
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
    if signals.time.min() < 0:
        shift = float(-np.floor(signals.time.min()))
        signals.warnings.append(
            f"time begins before 0: {shift:g} s are added, because a bag's times are not negative"
        )
        signals.time = signals.time + shift


def _check_signals(signals: _Signals, torque_sign: str) -> Intrinsic | None:
    ankle = signals.columns.get(ANKLE_SAMPLES.absolute, {})
    reference = signals.columns.get(PERTURBATION_REFERENCE.absolute, {})
    signals.contradictions += check_ranges({**ankle, **signals.columns.get(EMG_TOPIC, {})})
    signals.contradictions += [f"reference: {sentence}" for sentence in check_ranges(reference)]
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


def _report_missing(signals: _Signals, missing: str) -> None:
    fate = "kept as NaN" if missing == "nan" else "left out as gaps"
    for topic, held in signals.columns.items():
        for name, values in held.items():
            bad = np.flatnonzero(~np.isfinite(values))
            if len(bad):
                signals.warnings.append(
                    f"{topic} {name}: {len(bad)} samples are missing or not finite, first at t = "
                    f"{signals.time[bad[0]]:.6f} s; {fate}"
                )


def _write(writer: BagWriter, signals: _Signals, missing: str, progress: Progress | None) -> int:
    """Write blocks of all topics in the order of time; return the samples of the longest
    topic.
    """
    size = max(1, round(signals.rate / BLOCKS_PER_SECOND))
    blocks: dict[str, tuple[tuple[str, ...], np.ndarray]] = {}
    for topic, held in signals.columns.items():
        data = np.column_stack([signals.time, *held.values()])
        if missing == "gap":
            data = data[np.isfinite(data).all(axis=1)]
        else:
            data[~np.isfinite(data)] = np.nan
        blocks[topic] = ((TIME_COLUMN, *held), data)
        writer.add_topic(topic)
    total = max(len(data) for _, data in blocks.values())
    for start in range(0, total, size):
        for topic, (names, data) in blocks.items():
            piece = data[start : start + size]
            if len(piece):
                writer.write_block(topic, Block(names, piece))
        if progress and start % (size * BLOCKS_PER_SECOND) == 0:
            progress(0.5 + 0.5 * start / total)
    return total
