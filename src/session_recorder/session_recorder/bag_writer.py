"""Writing a bag that `ros2 bag`, Foxglove and PlotJuggler open as it is."""

from __future__ import annotations

import contextlib
import os
import time
from collections.abc import Collection, Mapping
from pathlib import Path
from types import TracebackType
from typing import BinaryIO

from mcap.writer import CompressionType, Writer
from rosbags.interfaces import Qos

from ankle_interfaces.block import MESSAGE_TYPE, Block, pack
from session_recorder.bag_metadata import (
    BLOCK_QOS,
    METADATA_FILE,
    NO_TIME,
    ROOT,
    Contents,
    Topic,
    information,
    metadata_text,
    qos_text,
)
from session_recorder.chunk_index import PackedIndex
from session_recorder.errors import BagError
from session_recorder.message_definitions import definition

# A killed recorder loses at most what is not yet in a chunk.
CHUNK_SECONDS = 1.0
# The size at which Foxglove's own writers end a chunk.
CHUNK_BYTES = 1024 * 1024
# The MCAP metadata record that carries the same pairs as custom_data of metadata.yaml.
CUSTOM_RECORD = "session_recorder"


class BagWriter:
    """Writes a new bag: a rosbag2 directory with one MCAP file of zstd chunks.

    Use it in a ``with`` statement; leaving it writes the index and ``metadata.yaml``, also after an
    error.

    Parameters
    ----------
    path
        The directory to create; its parents too.
    overwrite
        Replace a bag that is there. Anything else that is there is never touched.
    chunk_seconds
        Messages reach the disk at the latest this long after `write`, as long as more come or
        `flush` is called.

    Attributes
    ----------
    custom_data
        Pairs of texts that are stored with the bag on `close`.

    Raises
    ------
    BagError
        Something is there already, or the directory cannot be written.
    """

    def __init__(
        self, path: Path | str, *, overwrite: bool = False, chunk_seconds: float = CHUNK_SECONDS
    ) -> None:
        self.path = Path(path)
        self.custom_data: dict[str, str] = {}
        self._chunk_seconds = chunk_seconds
        self._schemas: dict[str, int] = {}
        self._channels: dict[str, int] = {}
        self._topics: dict[str, Topic] = {}
        self._start_ns = NO_TIME
        self._end_ns = 0
        self._file = self.path / f"{self.path.resolve().name}_0.mcap"
        try:
            self._make_room(overwrite)
            self._stream: BinaryIO | None = self._file.open("xb")
            self._writer = Writer(
                self._stream, chunk_size=CHUNK_BYTES, compression=CompressionType.ZSTD
            )
            # The library's own list grows for as long as a session lasts. It has no other way in.
            self._writer._Writer__chunk_indices = PackedIndex()  # type: ignore[attr-defined]
            self._writer.start(profile="ros2")
            self._writer.flush()
        except OSError as error:
            raise BagError(f"cannot write a bag at {self.path}: {error.strerror}") from None
        self._flushed = time.monotonic()

    def _make_room(self, overwrite: bool) -> None:
        if self.path.is_dir() and not any(self.path.iterdir()):
            return
        if self.path.exists():
            if not overwrite:
                raise BagError(f"{self.path} is there already; nothing is overwritten unasked")
            own = (
                {self.path / METADATA_FILE, *self.path.glob("*.mcap")}
                if self.path.is_dir()
                else set()
            )
            if not own or not set(self.path.iterdir()) <= own:
                raise BagError(
                    f"{self.path} is there and is not (only) a bag; it is not overwritten"
                )
            for file in own:
                file.unlink(missing_ok=True)
        self.path.mkdir(parents=True, exist_ok=True)

    @property
    def topics(self) -> Mapping[str, Topic]:
        """Return the topics so far, with their counts."""
        return self._topics

    @property
    def count(self) -> int:
        """Return the number of messages written so far."""
        return sum(topic.count for topic in self._topics.values())

    @property
    def start_ns(self) -> int:
        """Return the log time [ns] of the earliest message."""
        return self._start_ns

    @property
    def end_ns(self) -> int:
        """Return the log time [ns] of the latest message."""
        return self._end_ns

    def add_topic(
        self,
        topic: str,
        message_type: str = MESSAGE_TYPE,
        qos: Collection[Qos] = (BLOCK_QOS,),
        type_hash: str | None = None,
    ) -> None:
        """Announce a topic.

        Parameters
        ----------
        topic
            Absolute name of the topic.
        message_type
            Name of the type, such as ``std_msgs/msg/Float64MultiArray``.
        qos
            What its publishers offer.
        type_hash
            As the graph reports it; None computes it from the definition.

        Raises
        ------
        BagError
            The topic is there with another type, or the type is not known.
        """
        known = self._topics.get(topic)
        if known is not None:
            if known.type != message_type:
                raise BagError(
                    f"{topic} is recorded as '{known.type}'; '{message_type}' does not fit into "
                    "the same topic"
                )
            return
        meaning = definition(message_type)
        about = Topic(topic, message_type, tuple(qos), type_hash or meaning.type_hash, meaning.text)
        if message_type not in self._schemas:
            self._schemas[message_type] = self._writer.register_schema(
                message_type, "ros2msg", meaning.text.encode()
            )
        self._channels[topic] = self._writer.register_channel(
            topic,
            "cdr",
            self._schemas[message_type],
            {"offered_qos_profiles": qos_text(qos), "topic_type_hash": about.type_hash},
        )
        self._topics[topic] = about

    def add_qos(self, topic: str, profile: Qos) -> None:
        """Note that a further publisher of a known topic offers this QoS, for ``metadata.yaml``."""
        about = self._topics[topic]
        if profile not in about.qos:
            about.qos = (*about.qos, profile)

    def write(self, topic: str, stamp_ns: int, cdr: bytes, publish_ns: int | None = None) -> None:
        """Write one message.

        Parameters
        ----------
        topic
            A topic that was announced.
        stamp_ns
            Log time [ns since the epoch], not negative.
        cdr
            The serialised message.
        publish_ns
            Time of publication [ns]; None takes the log time.

        Raises
        ------
        BagError
            An unknown topic, a negative time, or the disk refuses; what was flushed before stays
            readable.
        """
        if self._stream is None:
            raise BagError(f"{self.path} is closed")
        try:
            channel = self._channels[topic]
        except KeyError:
            raise BagError(f"topic '{topic}' was not announced with add_topic") from None
        if stamp_ns < 0:
            raise BagError(
                f"{topic}: log time {stamp_ns} ns is before the epoch; bags cannot hold it"
            )
        about = self._topics[topic]
        try:
            self._writer.add_message(
                channel,
                stamp_ns,
                cdr,
                stamp_ns if publish_ns is None else publish_ns,
                about.count & 0xFFFFFFFF,
            )
            if time.monotonic() - self._flushed >= self._chunk_seconds:
                self._flush()
        except OSError as error:
            self._abandon(error)
        about.count += 1
        self._start_ns = min(self._start_ns, stamp_ns)
        self._end_ns = max(self._end_ns, stamp_ns)

    def write_block(self, topic: str, block: Block, stamp_ns: int | None = None) -> None:
        """Write one block; without a stamp its log time is that of its last sample."""
        stamp = round(float(block.time[-1]) * 1e9) if stamp_ns is None else stamp_ns
        self.write(topic, stamp, pack(block))

    def flush(self) -> None:
        """Bring everything written so far to the disk, as one chunk.

        Raises
        ------
        BagError
            The disk refuses.
        """
        if self._stream is not None:
            try:
                self._flush()
            except OSError as error:
                self._abandon(error)

    def sync(self) -> None:
        """Wait until what was flushed is on the medium itself, where a power cut leaves it.

        It may be called from any thread; a bag that is closed meanwhile is left alone.
        """
        stream = self._stream
        if stream is not None:
            with contextlib.suppress(OSError, ValueError):
                os.fdatasync(stream.fileno())

    def _flush(self) -> None:
        self._writer.flush()
        self._flushed = time.monotonic()

    def _abandon(self, error: OSError) -> None:
        """Let go of a file that cannot be continued: an index behind a half-written chunk would be
        wrong.
        """
        stream, self._stream = self._stream, None
        if stream is not None:
            with contextlib.suppress(OSError, ValueError):
                stream.raw.close()  # type: ignore[attr-defined]
        raise BagError(
            f"cannot write {self._file}: {error.strerror}; what was written before is readable, "
            "`recover` repairs the bag"
        ) from None

    def close(self) -> None:
        """Write the index and ``metadata.yaml``.

        Nothing happens the second time, or after the disk refused.

        Raises
        ------
        BagError
            The disk refuses.
        """
        if self._stream is None:
            return
        contents = Contents(
            [self._file.name],
            list(self._topics.values()),
            self._start_ns,
            self._end_ns,
            dict(self.custom_data),
        )
        info = information(contents)
        try:
            if self.custom_data:
                self._writer.add_metadata(CUSTOM_RECORD, self.custom_data)
            self._writer.add_metadata("rosbag2", {"serialized_metadata": metadata_text(info)})
            self._writer.finish()
            self._stream.close()
            self._stream = None
            (self.path / METADATA_FILE).write_text(metadata_text({ROOT: info}), encoding="utf-8")
        except OSError as error:
            self._abandon(error)

    def __enter__(self) -> BagWriter:
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        value: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        try:
            self.close()
        except BagError:
            if kind is None:
                raise
