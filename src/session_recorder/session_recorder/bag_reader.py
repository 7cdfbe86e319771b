"""Reading a bag: topics, times, messages, blocks, whole signals."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator
from pathlib import Path

import numpy as np

from ankle_interfaces.block import MESSAGE_TYPE, Block, find_layout, unpack
from ankle_interfaces.errors import BlockError
from session_recorder.bag_metadata import (
    METADATA_FILE,
    Contents,
    Topic,
    parse_qos_text,
    read_metadata,
)
from session_recorder.chunk_messages import ChunkMessages
from session_recorder.errors import BagError
from session_recorder.mcap_file import McapFile, Progress

JOINED_BLOCKS = 256
"""Blocks of a signal are joined by so many: 4 s of samples as a rig sends them."""


class BagReader:
    """Reads a bag: a rosbag2 directory, or a single ``.mcap`` file.

    A bag whose writer was killed opens as well: `problems` says what is missing.

    Parameters
    ----------
    path
        The directory or the file.
    kept_bytes
        Decompressed data of each file of up to so many bytes are kept, so that another pass over
        the bag, for another topic, does not decompress them again.

    Attributes
    ----------
    path
        What was opened.
    topics
        By name, with type, QoS, type hash, definition and count.
    start_ns, end_ns
        Log times [ns] of the first and the last message; equal to 0 without messages.
    custom_data
        Free key-value pairs of ``metadata.yaml``.
    problems
        One sentence for each thing that is missing or damaged; empty for a complete bag.

    Raises
    ------
    BagError
        Nothing is there, it is not a bag, or it cannot be read.
    """

    def __init__(self, path: Path | str, *, kept_bytes: int = 0) -> None:
        self.path = Path(path)
        self.problems: list[str] = []
        stated = self._find_files()
        self._files = [McapFile(file, kept_bytes) for file in self._paths]
        self.custom_data = stated.custom_data if stated else {}
        self.topics = self._topics(stated)
        for file in self._files:
            self.problems += file.problems
        spans = [
            (f.start_ns, f.end_ns)
            for f in self._files
            if f.start_ns is not None and f.end_ns is not None
        ]
        self.start_ns = min((start for start, _ in spans), default=0)
        self.end_ns = max((end for _, end in spans), default=0)
        if stated and stated.count > self.count:
            self.problems.append(
                f"{self.path}: {METADATA_FILE} counts {stated.count} messages, {self.count} are "
                "there"
            )

    def _find_files(self) -> Contents | None:
        if not self.path.exists():
            raise BagError(f"no bag at {self.path}: no such file or directory")
        if self.path.is_file():
            self._paths = [self.path]
            return None
        try:
            present = sorted(self.path.glob("*.mcap"))
        except OSError as error:
            raise BagError(f"{self.path}: {error.strerror}") from None
        if not (self.path / METADATA_FILE).exists():
            if not present:
                raise BagError(
                    f"{self.path} is not a bag: it holds neither {METADATA_FILE} nor an .mcap file"
                )
            self._paths = present
            self.problems.append(
                f"{self.path}: {METADATA_FILE} is missing, as after a killed recorder; topics are "
                "read from the data"
            )
            return None
        try:
            stated = read_metadata(self.path)
        except BagError as error:
            if not present:
                raise
            self._paths = present
            self.problems.append(str(error))
            return None
        self._paths = [self.path / name for name in stated.files]
        lost = [path for path in self._paths if not path.is_file()]
        self.problems += [f"{path} is missing, though {METADATA_FILE} names it" for path in lost]
        self._paths = [path for path in self._paths if path not in lost]
        if not self._paths:
            raise BagError(
                "; ".join(self.problems) or f"{self.path}: {METADATA_FILE} names no data file"
            )
        return stated

    def _topics(self, stated: Contents | None) -> dict[str, Topic]:
        topics = (
            {t.name: Topic(t.name, t.type, t.qos, t.type_hash) for t in stated.topics}
            if stated
            else {}
        )
        for file in self._files:
            for channel_id, channel in file.channels.items():
                schema = file.schemas.get(channel.schema_id)
                topic = topics.setdefault(
                    channel.topic, Topic(channel.topic, schema.name if schema else "")
                )
                if schema is not None and topic.type != schema.name:
                    self.problems.append(
                        f"{channel.topic} is of type '{topic.type}' by {METADATA_FILE} and of "
                        f"'{schema.name}' by {file.path.name}, which counts"
                    )
                    topic.type = schema.name
                topic.count += file.counts[channel_id]
                if schema is not None and not topic.definition:
                    topic.definition = schema.data.decode(errors="replace")
                topic.type_hash = topic.type_hash or channel.metadata.get("topic_type_hash", "")
                if not topic.qos:
                    try:
                        topic.qos = parse_qos_text(channel.metadata.get("offered_qos_profiles", ""))
                    except ValueError as error:
                        self.problems.append(
                            f"{channel.topic}: the stored QoS is not readable ({error})"
                        )
        return topics

    @property
    def count(self) -> int:
        """Return the number of messages of all topics that can be read."""
        return sum(topic.count for topic in self.topics.values())

    @property
    def duration(self) -> float:
        """Return the time from the first to the last message [s]."""
        return (self.end_ns - self.start_ns) * 1e-9

    @property
    def complete(self) -> bool:
        """Tell whether nothing is missing or damaged."""
        return not self.problems

    def topic(self, name: str, message_type: str | None = None) -> Topic:
        """Return one topic.

        Raises
        ------
        BagError
            No such topic, or it is of another type; the message names what the bag holds.
        """
        try:
            topic = self.topics[name]
        except KeyError:
            held = ", ".join(sorted(self.topics)) or "no topic at all"
            raise BagError(f"{self.path} has no topic '{name}'; it holds {held}") from None
        if message_type is not None and topic.type != message_type:
            raise BagError(
                f"{self.path}: {name} is of type '{topic.type}', expected '{message_type}'"
            )
        return topic

    def messages(
        self, topics: Collection[str] | None = None, progress: Progress | None = None
    ) -> Iterator[tuple[str, int, bytes]]:
        """Yield messages in the order of their log time.

        Parameters
        ----------
        topics
            Names; None for all.
        progress
            Called with the fraction that is read.

        Yields
        ------
        Iterator[tuple[str, int, bytes]]
            (topic, log time [ns], CDR bytes)

        Raises
        ------
        BagError
            A topic that is not there; a damaged chunk.
        """
        names = set(self.topics if topics is None else topics)
        for name in names:
            self.topic(name)
        for file, messages in self._messages(names, progress):
            for log_time, _, channel_id, data in messages.records():
                yield file.channels[channel_id].topic, log_time, data

    def _messages(
        self, names: Collection[str], progress: Progress | None
    ) -> Iterator[tuple[McapFile, ChunkMessages]]:
        """Yield the messages of some topics, many at a time, with the file that they are in."""
        for number, file in enumerate(self._files):
            channels = [key for key, channel in file.channels.items() if channel.topic in names]
            share = _share(progress, number, len(self._files))
            for messages in file.messages(channels, share):
                yield file, messages

    def readable_messages(
        self, topics: Collection[str] | None = None
    ) -> Iterator[tuple[str, int, int, bytes]]:
        """Yield every message outside damaged chunks, in the order of the file.

        `problems` grows on the way.

        Parameters
        ----------
        topics
            Names; None for all.

        Yields
        ------
        Iterator[tuple[str, int, int, bytes]]
            (topic, log time [ns], publish time [ns], CDR bytes)
        """
        for file in self._files:
            known = len(file.problems)
            wanted = [
                key
                for key, channel in file.channels.items()
                if topics is None or channel.topic in topics
            ]
            for log_time, publish_time, channel_id, data in file.without_damage(wanted):
                yield file.channels[channel_id].topic, log_time, publish_time, data
            self.problems += file.problems[known:]

    def blocks(
        self,
        topic: str,
        refused: Callable[[str], None] | None = None,
        progress: Progress | None = None,
    ) -> Iterator[Block]:
        """Yield blocks of one topic in the order of their log time, in their recorded units.

        Parameters
        ----------
        topic
            Absolute name of the topic.
        refused
            Called with a sentence for each message that is no valid block, which is then left out.
        progress
            Called with the fraction that is read.

        Raises
        ------
        BagError
            No such topic or of another type; a message that is no valid block, when `refused` is
            not given.
        """
        self.topic(topic, MESSAGE_TYPE)
        for _, log_time, message in self.messages((topic,), progress):
            try:
                block = unpack(message)
            except BlockError as error:
                self._refuse(topic, log_time, error, refused)
                continue
            yield block

    def _refuse(
        self,
        topic: str,
        log_time: int,
        error: BlockError,
        refused: Callable[[str], None] | None,
    ) -> None:
        sentence = f"{self.path}: {topic} at {log_time * 1e-9:.6f} s: {error}"
        if refused is None:
            raise BagError(sentence) from None
        refused(sentence)

    def joined_blocks(
        self,
        topic: str,
        count: int,
        refused: Callable[[str], None] | None = None,
        progress: Progress | None = None,
    ) -> Iterator[Block]:
        """Yield the samples of `blocks`, several recorded blocks in one.

        Messages that all begin alike have one layout, and are taken at once.

        Parameters
        ----------
        topic, refused, progress
            As for `blocks`.
        count
            So many recorded blocks are joined at most; those of other columns are not.

        Raises
        ------
        BagError
            As `blocks`.
        """
        self.topic(topic, MESSAGE_TYPE)
        columns: tuple[str, ...] = ()
        head, size, end = b"", -1, 0
        waiting: list[np.ndarray] = []
        joined = 0
        for _, messages in self._messages((topic,), progress):
            place = 0
            while place < messages.total:
                group = messages.chosen(slice(place, place + count - joined))
                place += group.total
                if group.alike(head, size):
                    waiting.append(group.cut(len(head), end).view("<f8"))
                    joined += group.total
                else:
                    for log_time, _, _, message in group.records():
                        try:
                            block = unpack(message)
                        except BlockError as error:
                            self._refuse(topic, log_time, error, refused)
                            continue
                        if joined and block.columns != columns:
                            yield _joined(columns, waiting)
                            waiting, joined = [], 0
                        columns, samples, start = find_layout(message)
                        head, end = message[:start], start + 8 * samples * len(columns)
                        # Those of a big-endian message have to be turned around.
                        size = len(message) if message[1] == 1 else -1
                        waiting.append(block.data.ravel())
                        joined += 1
                if joined == count:
                    yield _joined(columns, waiting)
                    waiting, joined = [], 0
        if joined:
            yield _joined(columns, waiting)

    def signal(
        self, topic: str, progress: Progress | None = None
    ) -> tuple[tuple[str, ...], np.ndarray]:
        """Return all blocks of one topic in one piece.

        Returns
        -------
        tuple[tuple[str, ...], np.ndarray]
            The m column names, and the data of shape (n, m).

        Raises
        ------
        BagError
            As `blocks`; also where the columns change on the way, or the topic is empty.
        """
        columns: tuple[str, ...] | None = None
        parts = []
        for block in self.joined_blocks(topic, JOINED_BLOCKS, progress=progress):
            if columns is None:
                columns = block.columns
            elif block.columns != columns:
                at = f"t = {block.time[0]:.6f} s" if len(block.time) else "an empty block"
                raise BagError(
                    f"{self.path}: {topic} changes its columns at {at} from {', '.join(columns)} "
                    f"to {', '.join(block.columns)}"
                )
            parts.append(block.data)
        if columns is None:
            raise BagError(f"{self.path}: {topic} holds no message")
        return columns, np.concatenate(parts)


def _joined(columns: tuple[str, ...], samples: list[np.ndarray]) -> Block:
    data = samples[0] if len(samples) == 1 else np.concatenate(samples)
    return Block(columns, data.reshape(-1, len(columns)))


def _share(progress: Progress | None, number: int, files: int) -> Progress | None:
    if progress is None or files == 1:
        return progress
    return lambda fraction: progress((number + fraction) / files)
