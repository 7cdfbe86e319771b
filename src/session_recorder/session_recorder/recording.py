"""A recording in progress: the bag, what each topic brought, what is missing. No ROS."""

from __future__ import annotations

import shutil
import time
from collections.abc import Collection
from pathlib import Path

from rosbags.interfaces import Qos

from ankle_interfaces.block import MESSAGE_TYPE, TIME_COLUMN, unpack
from ankle_interfaces.continuity import Continuity
from ankle_interfaces.errors import BlockError
from session_recorder.bag_writer import BagWriter

# Fewer samples in a block are an event or a result (an onset, an estimate), which has no sampling
# rate to keep.
SAMPLED_BLOCK = 4


class Recording:
    """Messages on their way into a bag.

    Parameters
    ----------
    path
        The new bag.

    Attributes
    ----------
    bag
        Its writer.
    lost
        Messages that the middleware lost, by topic.
    warnings
        What went wrong, with the time [s since the start].
    """

    def __init__(self, path: Path | str) -> None:
        self.bag = BagWriter(path)
        self.lost: dict[str, int] = {}
        self.warnings: list[str] = []
        self._streams: dict[str, Continuity] = {}
        self._sequences: dict[str, int] = {}
        self._began = time.monotonic()

    @property
    def missing(self) -> dict[str, int]:
        """Samples missing so far in each sampled topic."""
        return {topic: stream.missing for topic, stream in self._streams.items() if stream.blocks}

    @property
    def duration(self) -> float:
        """Time since the start [s]."""
        return time.monotonic() - self._began

    def add_topic(self, topic: str, message_type: str, qos: Collection[Qos]) -> None:
        """Announce a topic.

        Raises
        ------
        BagError
            See `BagWriter.add_topic`.
        """
        self.bag.add_topic(topic, message_type, qos)
        if message_type == MESSAGE_TYPE:
            self._streams.setdefault(topic, Continuity())

    def write(
        self,
        topic: str,
        stamp_ns: int,
        message: bytes,
        publish_ns: int | None = None,
        sequence: int | None = None,
    ) -> list[str]:
        """Write a message, and say what is wrong in its stream.

        Parameters
        ----------
        stamp_ns, publish_ns
            Times of reception and publication [ns].
        sequence
            The message's number at its publisher, None where it is not known.

        Returns
        -------
        list[str]
            A sentence for each gap, step back in time or damaged value; mostly empty.

        Raises
        ------
        BagError
            See `BagWriter.write`.
        """
        self.bag.write(topic, stamp_ns, message, publish_ns)
        found = self._check_sequence(topic, sequence) + self._check_samples(topic, message)
        for sentence in found:
            self.note(f"{topic}: {sentence}")
        return found

    def _check_sequence(self, topic: str, sequence: int | None) -> list[str]:
        if sequence is None:
            return []
        lost = sequence - self._sequences.get(topic, sequence) - 1
        self._sequences[topic] = sequence
        if (
            lost <= 0
        ):  # the first message, the next one, or the first of a publisher that started again
            return []
        self.lost[topic] = self.lost.get(topic, 0) + lost
        return [f"{lost} message(s) lost on the way before number {sequence}"]

    def _check_samples(self, topic: str, message: bytes) -> list[str]:
        stream = self._streams.get(topic)
        if stream is None:
            return []
        try:
            block = unpack(message)
        except BlockError as error:
            return [str(error)] if stream.blocks else []
        if len(block.data) < SAMPLED_BLOCK or block.columns[0] != TIME_COLUMN:
            return []
        return [finding.message for finding in stream.check(block.data)]

    def note(self, sentence: str) -> None:
        """Store a sentence with the bag."""
        self.warnings.append(f"{self.duration:.1f} s: {sentence}")

    def free_space(self) -> float:
        """Free space on the bag's disk [MB]."""
        return shutil.disk_usage(self.bag.path).free / 1e6

    def summary(self) -> str:
        """One line: messages, topics, duration, missing samples, path."""
        where = ", ".join(f"{topic} {count}" for topic, count in self.missing.items() if count)
        return (
            f"recorded {self.bag.count} messages of {len(self.bag.topics)} topics in "
            f"{self.duration:.1f} s, "
            f"{sum(self.missing.values())} samples missing{f' ({where})' if where else ''}, "
            f"{sum(self.lost.values())} messages lost: {self.bag.path}"
        )

    def close(self) -> None:
        """Finish the bag; what is missing is stored in it.

        Raises
        ------
        BagError
            The disk refuses.
        """
        self.bag.custom_data["missing_samples"] = str(sum(self.missing.values()))
        self.bag.custom_data["lost_messages"] = str(sum(self.lost.values()))
        for topic, count in self.missing.items():
            self.bag.custom_data[f"missing_samples {topic}"] = str(count)
        if self.warnings:
            self.bag.custom_data["warnings"] = "\n".join(self.warnings)
        self.bag.close()
