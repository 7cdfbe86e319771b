"""The index of an MCAP file's chunks, kept small while the file is written.

The `mcap` library keeps an object of 2.5 kB for each chunk until the file is closed. With a chunk a
second that is 9 MB an hour, a tenth of what a recorder uses. Here the records are kept as they will
be written, and compressed.
"""

from __future__ import annotations

import zlib
from collections.abc import Iterator
from typing import Protocol

from mcap.data_stream import RecordBuilder

_PIECE_SIZE = 16384
"""[bytes] Records are compressed by so many: a minute of chunks of 20 topics, in 1 ms."""


class Record(Protocol):
    """Describes a record of an MCAP file."""

    def write(self, stream: RecordBuilder) -> None:
        """Write the record."""


class WrittenRecords:
    """Holds records as they stand in the file.

    Parameters
    ----------
    content
        Of all of them.
    """

    def __init__(self, content: bytes) -> None:
        self._content = content

    def write(self, stream: RecordBuilder) -> None:
        """Write the held records."""
        stream.write(self._content)


class PackedIndex:
    """Takes the records of chunks one by one and gives them back as they will be written."""

    def __init__(self) -> None:
        self._packed: list[bytes] = []
        self._last = bytearray()

    def append(self, index: Record) -> None:
        """Take in the record of a chunk."""
        builder = RecordBuilder()
        index.write(builder)
        self._last += builder.end()
        if len(self._last) >= _PIECE_SIZE:
            self._packed.append(zlib.compress(self._last))
            self._last.clear()

    def __iter__(self) -> Iterator[Record]:
        """Yield all records, some at a time."""
        for piece in self._packed:
            yield WrittenRecords(zlib.decompress(piece))
        yield WrittenRecords(bytes(self._last))
