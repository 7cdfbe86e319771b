"""Responses from a recorded bag; the numbers are those of the node fed with the same samples."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ankle_interfaces.block import Block, require_columns, unpack
from ankle_interfaces.errors import BlockError
from ankle_interfaces.topics import ANKLE_SAMPLES, PERTURBATION_REFERENCE
from emg_driver.muscles import (
    BACKGROUND,
    ENSEMBLE_COLUMNS,
    ENSEMBLE_TOPIC,
    MUSCLES,
    REFLEX,
    RESPONSE_COLUMNS,
    RESPONSE_TOPIC,
    SAMPLE_COLUMNS,
    SAMPLES_TOPIC,
    STRETCHED_BY,
)
from emg_driver.processor import EmgProcessor, Responses
from emg_driver.settings import Settings
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError

REFERENCE_TOPIC, MOTION_TOPIC = PERTURBATION_REFERENCE.absolute, ANKLE_SAMPLES.absolute
POSITION, VELOCITY = "position[rad]", "velocity[rad/s]"
# Messages of one topic that are handed over together: fewer calls, same numbers.
MAX_GROUPED_BLOCKS = 16


@dataclass(frozen=True)
class OfflineResponses:
    """Holds the responses of a whole recording.

    Attributes
    ----------
    rows
        Shape (k, 10), columns `muscles.RESPONSE_COLUMNS`.
    ensemble
        Shape (L, 5), columns `muscles.ENSEMBLE_COLUMNS`, of the last onsets.
    notes
        Bad electrodes and missing samples, one sentence each with how often it was said, and the
        lag of the plate behind its command.
    lag
        Median time from a command to the plate's movement [s]; NaN where it was not measured.
    """

    rows: np.ndarray
    ensemble: np.ndarray
    notes: list[str]
    lag: float = math.nan


def feed(processor: EmgProcessor, topic: str, block: Block) -> Responses:
    """Hand a block of one of the three topics to the processor.

    Raises
    ------
    BlockError
        A column is missing or in a unit of another dimension.
    ValueError
        A sampling rate that the processor refuses.
    """
    if topic == SAMPLES_TOPIC:
        data = require_columns(block, SAMPLE_COLUMNS[1:], topic).data
        return processor.feed_emg(data[:, 0], data[:, 1:])
    if topic == REFERENCE_TOPIC:
        data = require_columns(block, (POSITION,), topic).data
        return processor.feed_reference(data[:, 0], data[:, 1])
    data = require_columns(block, (VELOCITY,), topic).data
    return processor.feed_motion(data[:, 0], data[:, 1])


def respond_bag(
    bag: Path | str,
    out: Path | str | None = None,
    settings: Settings | None = None,
    *,
    overwrite: bool = False,
    progress: Callable[[float], None] | None = None,
) -> OfflineResponses:
    """Compute background and reflex activity of every onset in a bag.

    The result is written as a new bag where `out` is given.

    Parameters
    ----------
    bag
        A bag with ``/emg/samples``.
    out
        The new bag; None writes none.
    settings
        Windows and filters; the defaults where None.
    overwrite
        Replace a bag at `out`.
    progress
        Called with the fraction of the bag that is read.

    Raises
    ------
    BagError
        No such bag, no EMG in it, neither a reference nor a measured velocity, or `out` cannot be
        written.
    ValueError
        A sampling rate that the processor refuses.
    """
    reader = BagReader(bag)
    reader.topic(SAMPLES_TOPIC)
    topics = [
        topic for topic in (REFERENCE_TOPIC, MOTION_TOPIC, SAMPLES_TOPIC) if topic in reader.topics
    ]
    if len(topics) < 2:
        raise BagError(
            f"{bag} has neither {REFERENCE_TOPIC} nor {MOTION_TOPIC}: no onset to look at"
        )
    processor = EmgProcessor(settings)
    rows: list[np.ndarray] = []
    notes: dict[str, int] = dict.fromkeys(reader.problems, 1)
    for topic, block in _grouped(reader, topics, notes, progress):
        try:
            due = feed(processor, topic, block)
        except BlockError as error:
            if topic == SAMPLES_TOPIC:
                raise
            notes[str(error)] = notes.get(str(error), 0) + 1
            continue
        rows.append(due.rows)
        for note in due.notes:
            notes[note] = notes.get(note, 0) + 1
    rows.append(processor.finish().rows)
    counted = [f"{n} x {note}" if n > 1 else note for note, n in notes.items()]
    result = OfflineResponses(
        np.concatenate(rows),
        processor.ensemble(),
        [*_lag_notes(processor), *counted],
        processor.lag,
    )
    if out is not None:
        _write(result, bag, out, overwrite)
    return result


def _lag_notes(processor: EmgProcessor) -> list[str]:
    stood = (
        f"{processor.motionless} commanded movements did not take place: the plate stood still, "
        "and there is no response to them"
    )
    still = [stood] if processor.motionless else []
    if math.isnan(processor.lag):
        return still
    sentence = f"the plate moves {1e3 * processor.lag:.1f} ms after its command; windows start then"
    if processor.unconfirmed:
        sentence += (
            f"; of {processor.onsets} onsets {processor.unconfirmed} have no measured movement and "
            "that lag"
        )
    return [sentence, *still]


def summary(found: OfflineResponses) -> list[list[str]]:
    """Return onsets, mean background and mean reflex of each muscle.

    Only onsets that stretch the muscle count; background is in uV and reflex in uV.s.
    """
    table = []
    for index, muscle in enumerate(MUSCLES):
        rows = found.rows[found.rows[:, 1] == STRETCHED_BY[muscle]]
        background, reflex = (
            rows[:, RESPONSE_COLUMNS.index(names[index])] for names in (BACKGROUND, REFLEX)
        )
        good = np.isfinite(background) & np.isfinite(reflex)
        means = (
            f"{1e6 * values[good].mean():.3g}" if good.any() else "-"
            for values in (background, reflex)
        )
        table.append([muscle, f"{np.count_nonzero(good)} of {len(rows)}", *means])
    return table


def _grouped(
    reader: BagReader,
    topics: list[str],
    notes: dict[str, int],
    progress: Callable[[float], None] | None,
) -> Iterator[tuple[str, Block]]:
    """Yield topic and block in the order of log time.

    Up to `MAX_GROUPED_BLOCKS` of a topic are joined.
    """
    waiting: dict[str, list[Block]] = {topic: [] for topic in topics}

    def joined(topic: str) -> tuple[str, Block]:
        blocks, waiting[topic] = waiting[topic], []
        return topic, Block(blocks[0].columns, np.concatenate([block.data for block in blocks]))

    for topic, log_time, message in reader.messages(topics, progress):
        try:
            block = unpack(message)
        except BlockError as error:
            sentence = f"{topic} at {log_time * 1e-9:.6f} s: {error}"
            notes[sentence] = notes.get(sentence, 0) + 1
            continue
        if waiting[topic] and waiting[topic][0].columns != block.columns:
            yield joined(topic)
        waiting[topic].append(block)
        if len(waiting[topic]) >= MAX_GROUPED_BLOCKS:
            yield joined(topic)
    for topic in topics:
        if waiting[topic]:
            yield joined(topic)


def _write(result: OfflineResponses, bag: Path | str, out: Path | str, overwrite: bool) -> None:
    with BagWriter(out, overwrite=overwrite) as writer:
        writer.custom_data = {"responses_from": str(bag)}
        writer.add_topic(RESPONSE_TOPIC)
        writer.add_topic(ENSEMBLE_TOPIC)
        for row in result.rows:
            writer.write_block(RESPONSE_TOPIC, Block(RESPONSE_COLUMNS, row[None]))
        if len(result.rows) and len(result.ensemble):
            stamp = round(float(result.rows[-1, 0]) * 1e9)
            writer.write_block(ENSEMBLE_TOPIC, Block(ENSEMBLE_COLUMNS, result.ensemble), stamp)
