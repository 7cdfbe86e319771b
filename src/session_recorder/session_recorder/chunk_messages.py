"""Messages in the content of a chunk of an MCAP file, all of them taken at once.

The head of a message is its opcode, the length of what follows, its channel, its number, and its
log and publish time [ns]. A message index tells where each message begins.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import NamedTuple

import numpy as np

Record = tuple[int, int, int, bytes]
"""(log time [ns], publish time [ns], channel, data)"""
_HEAD = np.dtype(
    [
        ("opcode", "u1"),
        ("length", "<u8"),
        ("channel", "<u2"),
        ("number", "<u4"),
        ("log_time", "<u8"),
        ("publish_time", "<u8"),
    ]
)
_FIELDS = 22
"""The length of a message counts so many bytes before its data."""


class ChunkMessages(NamedTuple):
    """Holds n messages as places in the bytes that they stand in.

    Attributes
    ----------
    content
        The bytes.
    log_times, publish_times
        Times [ns], shape (n,).
    channels
        Numbers of the channels, shape (n,).
    starts, ends
        The data of message k are ``content[starts[k] : ends[k]]``; shape (n,).
    """

    content: bytes
    log_times: np.ndarray
    publish_times: np.ndarray
    channels: np.ndarray
    starts: np.ndarray
    ends: np.ndarray

    @property
    def total(self) -> int:
        """Return the number of messages."""
        return len(self.starts)

    def records(self) -> Iterator[Record]:
        """Yield one message after the other."""
        content = self.content
        for log_time, publish_time, channel, start, end in zip(
            self.log_times.tolist(),
            self.publish_times.tolist(),
            self.channels.tolist(),
            self.starts.tolist(),
            self.ends.tolist(),
            strict=True,
        ):
            yield log_time, publish_time, channel, content[start:end]

    def chosen(self, which: slice | np.ndarray) -> ChunkMessages:
        """Return some of the messages, in the order of `which`."""
        return ChunkMessages(self.content, *(column[which] for column in self[1:]))

    def alike(self, head: bytes, size: int) -> bool:
        """Return whether all messages have this length [bytes] and begin with these bytes."""
        if not np.all(self.ends - self.starts == size) or len(head) > size:
            return False
        return self.cut(0, len(head)).tobytes() == head * self.total

    def cut(self, first: int, last: int) -> np.ndarray:
        """Return the bytes `first` to `last` - 1 of every message, which must have as many, behind
        each other; uint8, shape (n * (last - first),).
        """
        size = last - first
        if not size:
            return np.empty(0, np.uint8)
        # As many bytes from every byte of the content on.
        windows: np.ndarray = np.ndarray(
            len(self.content) - size + 1, np.dtype((np.void, size)), self.content, strides=(1,)
        )
        return windows[self.starts + first].view(np.uint8)

    def by_time(self) -> ChunkMessages:
        """Return the messages in the order of their log time; those of equal time keep theirs."""
        if np.all(self.log_times[:-1] <= self.log_times[1:]):
            return self
        return self.chosen(np.argsort(self.log_times, kind="stable"))

    def followed_by(self, other: ChunkMessages) -> ChunkMessages:
        """Return these messages, and then those of another chunk."""
        if not self.total:
            return other
        data = [content for *_, content in self.records()]
        ends = np.cumsum([len(content) for content in data])
        shift = int(ends[-1])
        return ChunkMessages(
            b"".join((*data, other.content)),
            np.concatenate([self.log_times, other.log_times]),
            np.concatenate([self.publish_times, other.publish_times]),
            np.concatenate([self.channels, other.channels]),
            np.concatenate([[0], ends[:-1], other.starts + shift]),
            np.concatenate([ends, other.ends + shift]),
        )


def from_records(records: Sequence[Record]) -> ChunkMessages:
    """Return messages that stand in no common bytes yet."""
    ends = np.cumsum([len(data) for *_, data in records], dtype=np.int64)
    return ChunkMessages(
        b"".join(data for *_, data in records),
        np.array([log_time for log_time, *_ in records], np.uint64),
        np.array([publish_time for _, publish_time, *_ in records], np.uint64),
        np.array([channel for _, _, channel, _ in records], np.uint16),
        np.concatenate([np.zeros(1, np.int64), ends[:-1]])[: len(records)],
        ends,
    )


def messages_at(content: bytes, places: np.ndarray, channels: Sequence[int]) -> ChunkMessages:
    """Return the messages at some places in the content of a chunk.

    Parameters
    ----------
    content
        The whole content.
    places
        Where each message begins, rising, unsigned, shape (n,).
    channels
        Numbers of the channels that the messages may be of.

    Raises
    ------
    EOFError
        A message lies behind the end of the content, or no message of these channels is there.
    """
    last = len(content) - _HEAD.itemsize
    if len(places) and int(places[-1]) > last:
        raise EOFError("a message lies behind the end of its chunk")
    begins = places.astype(np.int64)
    bytes_of_heads = begins[:, None] + np.arange(_HEAD.itemsize)
    heads = np.frombuffer(content, np.uint8)[bytes_of_heads].view(_HEAD)[:, 0]
    if not np.all(np.any(heads["channel"][:, None] == np.array(channels), axis=1)):
        raise EOFError("the index of a chunk names a place where no message of its channel is")
    starts = begins + _HEAD.itemsize
    # No length reaches beyond the content, however damaged it is.
    lengths = np.minimum(heads["length"], np.uint64(len(content) + _FIELDS)).astype(np.int64)
    ends = np.minimum(starts + lengths - _FIELDS, len(content))
    if np.any((ends <= starts) & (lengths != _FIELDS)):
        raise EOFError("a message lies behind the end of its chunk")
    return ChunkMessages(
        content, heads["log_time"], heads["publish_time"], heads["channel"], starts, ends
    )
