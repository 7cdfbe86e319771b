"""One MCAP file, complete or cut off, read with the `mcap` library.

A complete file is read through its index: only chunks and messages of the wanted topics are
touched. A file without an index (its writer was killed) is scanned once, and everything before
the damage is read.
"""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import BinaryIO

import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, DataEnd, Footer, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk, get_chunk_data_stream

from session_recorder.chunk_messages import (
    ChunkMessages,
    Record,
    from_records,
    messages_at,
)
from session_recorder.errors import BagError

Progress = Callable[[float], None]
# What the mcap library and its decompressors raise on bytes that are not what they should be;
# OSError is a seek to where a damaged offset points.
DAMAGE = (
    McapError,
    zstandard.ZstdError,
    struct.error,
    ValueError,
    KeyError,
    IndexError,
    RuntimeError,
    EOFError,
    OSError,
    MemoryError,
    OverflowError,
)
RECORD_HEAD = 9  # bytes: opcode and length
FOOTER_AND_MARK = 9 + 20 + 8  # bytes at the end of a complete file
CRC_AND_MARK = 4 + 8  # bytes at the end that the footer's checksum leaves out
INDEX_HEAD = struct.Struct("<HI")
"""A message index begins with its channel and the length of its entries [bytes]."""
INDEX_ENTRY = np.dtype([("log_time", "<u8"), ("place", "<u8")])
"""An entry is the log time of a message [ns] and its place in the chunk."""


@dataclass(frozen=True)
class _Piece:
    """Describes a chunk, or a message outside chunks: its place, its times [ns], and its message
    index by channel.
    """

    offset: int
    start_ns: int
    end_ns: int
    index: dict[int, int] = field(default_factory=dict)


class McapFile:
    """Reads the channels, counts and messages of one MCAP file.

    Parameters
    ----------
    path
        Path of the file.
    kept_bytes
        Decompressed chunks of up to so many bytes in all are kept, for another pass over them.

    Attributes
    ----------
    channels, schemas
        By the file's ids.
    counts
        Messages of each channel.
    metadata
        The file's own metadata records by name.
    problems
        What is damaged or missing, one sentence each; empty for a complete file.
    start_ns, end_ns
        Log times [ns] of the first and last message; None without messages.

    Raises
    ------
    BagError
        The file cannot be opened or is no MCAP file.
    """

    def __init__(self, path: Path, kept_bytes: int = 0) -> None:
        self.path = path
        self._room = kept_bytes
        self._kept: dict[int, bytes] = {}
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self.counts: Counter[int] = Counter()
        self.problems: list[str] = []
        self.start_ns: int | None = None
        self.end_ns: int | None = None
        self._pieces: list[_Piece] = []
        try:
            with path.open("rb") as stream:
                self.size = stream.seek(0, 2)
                stream.seek(0)
                if self.size < 8 or stream.read(8) != b"\x89MCAP0\r\n":
                    other = f"; is it of another system? Then: ankle import {path}"
                    raise BagError(
                        f"{path} is not an MCAP file ({self.size} bytes, the start is not the "
                        f"MCAP mark){'' if path.suffix == '.mcap' else other}"
                    )
                if not self._read_index(stream):
                    self._scan(stream)
        except OSError as error:
            raise BagError(f"{path}: {error.strerror}") from None
        self._pieces.sort(key=lambda piece: (piece.start_ns, piece.offset))

    def _read_index(self, stream: BinaryIO) -> bool:
        """Take everything from the summary at the file's end; False where there is none that tells
        all.
        """
        try:
            stream.seek(0)
            reader = make_reader(stream)
            summary = reader.get_summary()
            if summary is None or summary.statistics is None or not self._index_is_intact(stream):
                return False
            statistics = summary.statistics
            if statistics.message_count and not all(
                chunk.message_index_offsets for chunk in summary.chunk_indexes
            ):
                return False
            if len(summary.chunk_indexes) != statistics.chunk_count or (
                statistics.message_count and not summary.chunk_indexes
            ):
                return False
            # Where the index is damaged, its records of metadata cannot be read either.
            for _ in reader.iter_metadata():
                pass
        except DAMAGE:
            return False
        self.channels, self.schemas = summary.channels, summary.schemas
        self.counts.update(statistics.channel_message_counts)
        if statistics.message_count:
            self.start_ns, self.end_ns = statistics.message_start_time, statistics.message_end_time
        self._pieces = [
            _Piece(
                c.chunk_start_offset,
                c.message_start_time,
                c.message_end_time,
                c.message_index_offsets,
            )
            for c in summary.chunk_indexes
        ]
        return True

    def _index_is_intact(self, stream: BinaryIO) -> bool:
        """Return whether the summary has the checksum that the footer states; the library's reader
        does not look.
        """
        stream.seek(self.size - FOOTER_AND_MARK)
        footer = next(StreamReader(stream, skip_magic=True).records)
        if not isinstance(footer, Footer) or footer.summary_crc == 0:
            return isinstance(footer, Footer)
        stream.seek(footer.summary_start)
        checked = stream.read(self.size - CRC_AND_MARK - footer.summary_start)
        return zlib.crc32(checked) == footer.summary_crc

    def _scan(self, stream: BinaryIO) -> None:
        stream.seek(0)
        records = StreamReader(
            stream, emit_chunks=True, validate_crcs=True, record_size_limit=self.size
        ).records
        finished = False
        while True:
            offset = stream.tell()
            try:
                record = next(records)
            except StopIteration:
                break
            except DAMAGE as error:
                self._report_end(offset, finished, error)
                break
            if isinstance(record, Chunk):
                try:
                    inner = breakup_chunk(record, validate_crc=True)
                except DAMAGE as error:
                    self._report_chunk(
                        offset, record.message_start_time, record.message_end_time, error
                    )
                    continue
                self._collect(inner, offset)
            elif isinstance(record, DataEnd):
                finished = True
            elif isinstance(record, Footer):
                break
            else:
                self._collect([record], offset)

    def _report_chunk(self, offset: int, start_ns: int, end_ns: int, error: BaseException) -> None:
        span = f"{(end_ns - start_ns) * 1e-9:.3f} s from {start_ns * 1e-9:.3f} s"
        self.problems.append(
            f"{self.path.name}: the chunk at byte {offset} is damaged ({_reason(error)}); its "
            f"{span} are lost"
        )

    def _report_end(self, offset: int, finished: bool, error: BaseException) -> None:
        if finished:
            self.problems.append(
                f"{self.path.name}: the index at the file's end is damaged; every message is there"
            )
            return
        lost = "after the last whole chunk" if self._pieces else "after that"
        self.problems.append(
            f"{self.path.name}: the file ends without its index, as after a killed recorder: it "
            f"is cut off or damaged at byte {offset}"
            f" of {self.size} ({_reason(error)}); messages {lost} are lost"
        )

    def _collect(self, records: list, offset: int) -> None:
        times = []
        for record in records:
            if isinstance(record, Schema):
                self.schemas[record.id] = record
            elif isinstance(record, Channel):
                self.channels[record.id] = record
            elif isinstance(record, Message):
                self.counts[record.channel_id] += 1
                times.append(record.log_time)
        if times:
            first, last = min(times), max(times)
            self._pieces.append(_Piece(offset, first, last))
            self.start_ns = first if self.start_ns is None else min(self.start_ns, first)
            self.end_ns = last if self.end_ns is None else max(self.end_ns, last)

    def messages(
        self, channels: Collection[int], progress: Progress | None = None
    ) -> Iterator[ChunkMessages]:
        """Yield messages of some channels in the order of their log time, many at a time.

        Parameters
        ----------
        channels
            Numbers of the channels.
        progress
            Called with the fraction that is read.

        Yields
        ------
        Iterator[ChunkMessages]
            Messages of equal time are in the file's order.

        Raises
        ------
        BagError
            A chunk is damaged; the message says where.
        """
        wanted = frozenset(channels)
        pieces = [
            piece for piece in self._pieces if not piece.index or not wanted.isdisjoint(piece.index)
        ]
        held = from_records([])
        with self.path.open("rb") as stream:
            for number, piece in enumerate(pieces):
                try:
                    read = self._read(stream, piece, wanted)
                except DAMAGE as error:
                    raise BagError(
                        f"{self.path}: the chunk at byte {piece.offset} "
                        f"({piece.start_ns * 1e-9:.3f} to {piece.end_ns * 1e-9:.3f} s)"
                        f" is damaged: {_reason(error)}; `recover` saves the rest"
                    ) from None
                held = held.followed_by(read).by_time()
                ready = held.total
                if number + 1 < len(pieces):
                    # Later pieces start at or after the next one: everything before it is in its
                    # place.
                    following = np.uint64(pieces[number + 1].start_ns)
                    ready = int(np.searchsorted(held.log_times, following))
                if ready:
                    yield held.chosen(slice(ready))
                held = held.chosen(slice(ready, None))
                if progress:
                    progress((number + 1) / len(pieces))

    def _read(self, stream: BinaryIO, piece: _Piece, wanted: frozenset[int]) -> ChunkMessages:
        """Return the wanted messages of a piece in the file's order."""
        if not piece.index:
            stream.seek(piece.offset)
            record = next(
                StreamReader(
                    stream, skip_magic=True, emit_chunks=True, record_size_limit=self.size
                ).records
            )
            inner = (
                breakup_chunk(record, validate_crc=True) if isinstance(record, Chunk) else [record]
            )
            return from_records(
                [
                    (m.log_time, m.publish_time, m.channel_id, m.data)
                    for m in inner
                    if isinstance(m, Message) and m.channel_id in wanted
                ]
            )
        content = self._content(stream, piece.offset)
        channels = sorted(wanted.intersection(piece.index))
        places = [self._message_places(stream, piece.index[channel]) for channel in channels]
        return messages_at(content, np.sort(np.concatenate(places)), channels)

    def _content(self, stream: BinaryIO, offset: int) -> bytes:
        """Return the decompressed content of the chunk at a byte of the file."""
        if offset in self._kept:
            return self._kept[offset]
        stream.seek(offset + RECORD_HEAD)
        data, size = get_chunk_data_stream(Chunk.read(ReadDataStream(stream)), validate_crc=True)
        content = data.read(size)
        if size <= self._room:
            self._room -= size
            self._kept[offset] = content
        return content

    def _message_places(self, stream: BinaryIO, offset: int) -> np.ndarray:
        """Return where in a chunk the messages of a channel are, from its message index, shape
        (n,).
        """
        stream.seek(offset + RECORD_HEAD)
        _, length = INDEX_HEAD.unpack(stream.read(INDEX_HEAD.size))
        entries = stream.read(length) if length <= self.size else b""
        if len(entries) != length:
            raise EOFError("a message index is cut off")
        return np.frombuffer(entries, INDEX_ENTRY)["place"]

    def without_damage(self, channels: Collection[int]) -> Iterator[Record]:
        """Yield messages in the order of the file, without those in damaged chunks.

        Each damaged chunk becomes one of `problems`.
        """
        wanted = frozenset(channels)
        with self.path.open("rb") as stream:
            # By time, the chunks of topics that were written one after the other would interleave.
            for piece in sorted(self._pieces, key=lambda piece: piece.offset):
                if piece.index and wanted.isdisjoint(piece.index):
                    continue
                try:
                    records = self._read(stream, piece, wanted)
                except DAMAGE as error:
                    self._report_chunk(piece.offset, piece.start_ns, piece.end_ns, error)
                    continue
                yield from records.by_time().records()


def _reason(error: BaseException) -> str:
    return str(error) or type(error).__name__
