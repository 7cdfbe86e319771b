"""Estimates from recorded signals and bags.

The numbers are those of the node fed with the same samples.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ankle_interfaces.block import TIME_COLUMN, Block
from ankle_interfaces.errors import BlockError
from ankle_interfaces.topics import IMPEDANCE_MODEL, IMPEDANCE_PROVENANCE, IMPEDANCE_TRACKED
from impedance_estimator.algorithms import DEFAULT
from impedance_estimator.errors import EstimateError
from impedance_estimator.estimator import (
    ESTIMATE_COLUMNS,
    ESTIMATE_TOPIC,
    REFLEX_COLUMNS,
    REFLEX_TOPIC,
)
from impedance_estimator.judgements import (
    Judgement,
    shares_of_doubted_time,
    shares_of_invalid_time,
)
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.provenance import model_text, provenance
from impedance_estimator.settings import EstimatorSettings
from impedance_estimator.stream import REFERENCE_TOPIC, TOPIC, Estimates, EstimateStream
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.message_definitions import typestore

PROVENANCE_TOPIC = IMPEDANCE_PROVENANCE.absolute
NOT_VALID_KEY, DOUBTS_KEY = "not_valid", "doubts"
"""Keys under which a bag of estimates says, in ``custom_data`` of its ``metadata.yaml``, why they
are not valid or doubted, with the share of the recording."""
BLOCKS_PER_CALL = 256
"""So many blocks are joined before they are processed: fewer calls, same numbers."""
KEPT_BYTES = 64_000_000
"""So much of a bag stays decompressed between the pass for the reference and that for the samples:
eight minutes of both at 2048 Hz."""


@dataclass(frozen=True)
class OfflineResult:
    """Holds the estimates of a whole recording.

    Attributes
    ----------
    rows
        Shape (k, 13), columns `ESTIMATE_COLUMNS`.
    responses
        (t [s], shape (L, 3)) for each reflex impulse response, columns `REFLEX_COLUMNS`.
    torques
        Shape (j, 4), columns `TORQUE_COLUMNS`: filtered torque and its predicted parts, 125-128 a
        second.
    notes
        What happened to the stream, one sentence each.
    provenance
        What they are made with; see `impedance_estimator.provenance`.
    judgements
        Why estimates were not valid or doubted, twice a second.
    tracked
        Time [s] and the gains of terms that the model marks as tracked, each with its standard
        error, twice a second; shape (j, 1 + m).
    """

    rows: np.ndarray
    responses: list[tuple[float, np.ndarray]]
    torques: np.ndarray
    notes: list[str]
    provenance: str = ""
    judgements: list[Judgement] = field(default_factory=list)
    tracked: np.ndarray = field(default_factory=lambda: np.empty((0, 1)))

    @property
    def valid(self) -> np.ndarray:
        """Return the valid rows."""
        return self.rows[self.rows[:, ESTIMATE_COLUMNS.index("valid[1]")] > 0]

    def median(self) -> dict[str, float]:
        """Return the median of each column over the valid rows, by column name without ``t[s]`` and
        ``valid[1]``; NaN where none is valid.
        """
        valid = self.valid
        names = [name for name in ESTIMATE_COLUMNS if name not in ("t[s]", "valid[1]")]
        return {
            name: float(np.median(valid[:, ESTIMATE_COLUMNS.index(name)]))
            if len(valid)
            else float("nan")
            for name in names
        }


def estimate_signal(
    time: np.ndarray,
    position: np.ndarray,
    velocity: np.ndarray | None,
    torque: np.ndarray,
    algorithm: str = DEFAULT,
    settings: EstimatorSettings | None = None,
    reference: np.ndarray | None = None,
    known: KnownPhysics | None = None,
) -> OfflineResult:
    """Return estimates from arrays of shape (n,): time [s], position [rad], velocity [rad/s] or
    None, torque [N.m], and the reference's position [rad] where there is one.

    `known` is physics of rig and subject that is known beforehand.

    Raises
    ------
    ValueError
        Shapes differ.
    EstimateError
        There are fewer than 256 samples.
    QuantityError, SamplingError
        The algorithm is unknown, or the sampling rate is refused.
    """
    columns = [time, position, torque] if velocity is None else [time, position, velocity, torque]
    shapes = {np.shape(column) for column in (*columns, time if reference is None else reference)}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise ValueError(
            "time, position, velocity, torque and reference must have the same length, got shapes "
            f"{[np.shape(c) for c in columns]}"
        )
    stream = EstimateStream(algorithm, settings, known)
    due = stream.feed_samples(np.column_stack(columns), velocity is not None, reference)
    result = _join([due], stream)
    _require_start(stream, f"{len(time)} samples")
    return result


def estimate_bag(
    bag: Path | str,
    out: Path | str | None = None,
    algorithm: str = DEFAULT,
    settings: EstimatorSettings | None = None,
    *,
    known: KnownPhysics | None = None,
    overwrite: bool = False,
    progress: Callable[[float], None] | None = None,
) -> OfflineResult:
    """Return estimates from ``/ankle/samples`` of a bag, written as a new bag where `out` is given.

    The new bag holds ``/impedance/estimate``, many rows to a message, ``/impedance/reflex_irf``,
    where the model tracks further terms ``/impedance/tracked``,
    at the samples' own time, and what they are made with on ``/impedance/provenance`` and
    ``/impedance/model``.

    Parameters
    ----------
    bag
        A bag with ``/ankle/samples``.
    out
        The new bag; None writes none.
    algorithm
        A key of `algorithms.ALGORITHMS`.
    settings
        The algorithm's defaults where None.
    known
        Physics of rig and subject that is known beforehand.
    overwrite
        Replace a bag at `out`.
    progress
        Called with the fraction of the bag that is read.

    Raises
    ------
    BagError
        No such bag or topic, or `out` cannot be written.
    BlockError
        No block of the topic has the needed columns.
    ValueError
        An unknown algorithm, or a sampling rate that is refused.
    """
    reader = BagReader(bag, kept_bytes=KEPT_BYTES)
    stream = EstimateStream(algorithm, settings, known)
    parts = [
        Estimates(np.empty((0, len(ESTIMATE_COLUMNS))), [], np.empty((0, 4)), list(reader.problems))
    ]
    refused: list[str] = []
    reader.topic(TOPIC)
    writer = BagWriter(out, overwrite=overwrite) if out is not None else None
    try:
        if writer is not None:
            writer.add_topic(ESTIMATE_TOPIC)
            writer.add_topic(REFLEX_TOPIC)
            if stream.tracked_columns:
                writer.add_topic(IMPEDANCE_TRACKED.absolute)
            for topic in (IMPEDANCE_PROVENANCE, IMPEDANCE_MODEL):
                writer.add_topic(topic.absolute, topic.message)
            writer.custom_data = {
                "estimated_from": str(bag),
                "algorithm": algorithm,
                "settings": str(stream.settings),
            }
        stated = False
        _feed_reference(reader, stream)
        for block in reader.joined_blocks(TOPIC, BLOCKS_PER_CALL, refused.append, progress):
            try:
                due = stream.feed(block)
            except BlockError as error:
                refused.append(str(error))
                continue
            parts.append(due)
            if writer is not None:
                if not stated and len(due.rows):
                    _state_provenance(writer, stream, float(due.rows[0, 0]))
                    stated = True
                _write(writer, due, stream.tracked_columns)
    finally:
        if writer is not None:
            judgements = [judgement for part in parts for judgement in part.judgements]
            writer.custom_data |= {
                NOT_VALID_KEY: "; ".join(map(str, shares_of_invalid_time(judgements))),
                DOUBTS_KEY: "; ".join(map(str, shares_of_doubted_time(judgements))),
            }
            writer.close()
    if stream.estimator is None and refused:
        raise BlockError(refused[0])
    parts[0].notes.extend(f"{sentence} (left out)" for sentence in dict.fromkeys(refused))
    _require_start(stream, str(bag))
    return _join(parts, stream)


def _require_start(stream: EstimateStream, source: str) -> None:
    if stream.estimator is None:
        raise EstimateError(
            f"{source}: no estimate; {stream.reason} (at least 256 samples in order are needed)"
        )


def _feed_reference(reader: BagReader, stream: EstimateStream) -> None:
    """Return all of the recorded reference: what is in the file has come in time."""
    if REFERENCE_TOPIC in reader.topics:
        for block in reader.joined_blocks(REFERENCE_TOPIC, BLOCKS_PER_CALL):
            stream.feed_reference(block)


def _state_provenance(writer: BagWriter, stream: EstimateStream, time: float) -> None:
    store = typestore()
    stated = {IMPEDANCE_MODEL: model_text(stream), IMPEDANCE_PROVENANCE: provenance(stream)}
    for topic, text in stated.items():
        message = store.serialize_cdr(store.types[topic.message](data=text), topic.message)
        writer.write(topic.absolute, round(time * 1e9), bytes(message))


def _write(writer: BagWriter, due: Estimates, tracked: tuple[str, ...]) -> None:
    if len(due.rows):
        writer.write_block(ESTIMATE_TOPIC, Block(ESTIMATE_COLUMNS, due.rows))
    for t, response in due.responses:
        writer.write_block(REFLEX_TOPIC, Block(REFLEX_COLUMNS, response), round(t * 1e9))
    if tracked and len(due.tracked):
        writer.write_block(IMPEDANCE_TRACKED.absolute, Block((TIME_COLUMN, *tracked), due.tracked))


def _join(parts: list[Estimates], stream: EstimateStream) -> OfflineResult:
    return OfflineResult(
        np.concatenate([part.rows for part in parts]),
        [response for part in parts for response in part.responses],
        np.concatenate([part.torques for part in parts]),
        [note for part in parts for note in part.notes],
        provenance(stream),
        [judgement for part in parts for judgement in part.judgements],
        np.concatenate([part.tracked for part in parts if len(part.tracked)] or [np.empty((0, 1))]),
    )
