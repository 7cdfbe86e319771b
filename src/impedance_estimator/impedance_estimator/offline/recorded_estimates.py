"""Estimates from recorded signals and bags.

The numbers are those of the node fed with the same samples.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ankle_interfaces.block import Block
from ankle_interfaces.errors import BlockError
from impedance_estimator.algorithms import DEFAULT
from impedance_estimator.estimator import (
    ESTIMATE_COLUMNS,
    ESTIMATE_TOPIC,
    REFLEX_COLUMNS,
    REFLEX_TOPIC,
)
from impedance_estimator.settings import EstimatorSettings
from impedance_estimator.stream import TOPIC, Estimates, EstimateStream
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter

GROUPED = 256
"""Blocks joined before they are processed: fewer calls, same numbers."""


@dataclass(frozen=True)
class OfflineResult:
    """Estimates of a whole recording.

    Attributes
    ----------
    rows
        Shape (k, 12), columns `ESTIMATE_COLUMNS`.
    responses
        (t [s], shape (L, 2)) for each reflex impulse response, columns `REFLEX_COLUMNS`.
    torques
        Shape (j, 4), columns `TORQUE_COLUMNS`: filtered torque and its predicted parts, 125-128 a
        second.
    notes
        What happened to the stream, one sentence each.
    """

    rows: np.ndarray
    responses: list[tuple[float, np.ndarray]]
    torques: np.ndarray
    notes: list[str]

    @property
    def valid(self) -> np.ndarray:
        """The valid rows."""
        return self.rows[self.rows[:, ESTIMATE_COLUMNS.index("valid[1]")] > 0]

    def median(self) -> dict[str, float]:
        """Median of each column over the valid rows, by column name without ``t[s]`` and
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
) -> OfflineResult:
    """Estimates from arrays of shape (n,): time [s], position [rad], velocity [rad/s] or None,
    torque [N.m].

    Raises
    ------
    ValueError
        Shapes differ, fewer than 256 samples, an unknown algorithm, or a sampling rate that is
        refused.
    """
    columns = [time, position, torque] if velocity is None else [time, position, velocity, torque]
    shapes = {np.shape(column) for column in columns}
    if len(shapes) != 1 or len(next(iter(shapes))) != 1:
        raise ValueError(
            "time, position, velocity and torque must have the same length, got shapes "
            f"{[np.shape(c) for c in columns]}"
        )
    stream = EstimateStream(algorithm, settings)
    result = _join([stream.feed_samples(np.column_stack(columns), velocity is not None)])
    _require_start(stream, f"{len(time)} samples")
    return result


def estimate_bag(
    bag: Path | str,
    out: Path | str | None = None,
    algorithm: str = DEFAULT,
    settings: EstimatorSettings | None = None,
    *,
    overwrite: bool = False,
    progress: Callable[[float], None] | None = None,
) -> OfflineResult:
    """Estimates from ``/ankle/samples`` of a bag, written as a new bag where `out` is given.

    The new bag holds ``/impedance/estimate``, many rows to a message, and
    ``/impedance/reflex_irf``, at the samples' own time.

    Parameters
    ----------
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
    reader = BagReader(bag)
    stream = EstimateStream(algorithm, settings)
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
            writer.custom_data = {
                "estimated_from": str(bag),
                "algorithm": algorithm,
                "settings": str(stream.settings),
            }
        for block in _joined_blocks(reader.blocks(TOPIC, refused.append, progress)):
            try:
                due = stream.feed(block)
            except BlockError as error:
                refused.append(str(error))
                continue
            parts.append(due)
            if writer is not None:
                _write(writer, due)
    finally:
        if writer is not None:
            writer.close()
    if stream.estimator is None and refused:
        raise BlockError(refused[0])
    parts[0].notes.extend(f"{sentence} (left out)" for sentence in dict.fromkeys(refused))
    _require_start(stream, str(bag))
    return _join(parts)


def _require_start(stream: EstimateStream, source: str) -> None:
    if stream.estimator is None:
        raise ValueError(
            f"{source}: no estimate; {stream.reason} (at least 256 samples in order are needed)"
        )


def _joined_blocks(blocks: Iterator[Block]) -> Iterator[Block]:
    waiting: list[Block] = []
    for block in blocks:
        if waiting and (block.columns != waiting[0].columns or len(waiting) == GROUPED):
            yield _concatenate(waiting)
            waiting = []
        waiting.append(block)
    if waiting:
        yield _concatenate(waiting)


def _concatenate(blocks: list[Block]) -> Block:
    return Block(blocks[0].columns, np.concatenate([block.data for block in blocks]))


def _write(writer: BagWriter, due: Estimates) -> None:
    if len(due.rows):
        writer.write_block(ESTIMATE_TOPIC, Block(ESTIMATE_COLUMNS, due.rows))
    for t, response in due.responses:
        writer.write_block(REFLEX_TOPIC, Block(REFLEX_COLUMNS, response), round(t * 1e9))


def _join(parts: list[Estimates]) -> OfflineResult:
    return OfflineResult(
        np.concatenate([part.rows for part in parts]),
        [response for part in parts for response in part.responses],
        np.concatenate([part.torques for part in parts]),
        [note for part in parts for note in part.notes],
    )
