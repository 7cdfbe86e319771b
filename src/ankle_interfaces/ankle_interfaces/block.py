"""A block of samples: what every sampled topic carries.

On the wire a block is a `std_msgs/msg/Float64MultiArray`: ``layout.dim[0]`` = (``sample``, n, n*m),
``layout.dim[1]`` = (the column names with units, joined by commas, m, m), data row-major.
The first column is always ``t[s]``, the sample's own time in ROS time.

`pack` and `unpack` turn a block into the CDR bytes of that message and back. rclpy publishes and
delivers such bytes unchanged (``raw=True``) and MCAP stores them, so one pair of functions serves
the live graph, the recorder and every reader of a bag.
"""

from __future__ import annotations

import struct
from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ankle_interfaces.errors import BlockError, UnitError
from ankle_interfaces.units import split_column, to_si

MESSAGE_TYPE = "std_msgs/msg/Float64MultiArray"
TIME_COLUMN = "t[s]"

LARGEST_PADDING = 7
"""Largest number of bytes behind the samples: a serialiser may fill up to the next multiple of 8.
"""

_LITTLE_ENDIAN = b"\x00\x01\x00\x00"
_BIG_ENDIAN = b"\x00\x00\x00\x00"


@dataclass(frozen=True)
class Block:
    """Holds a block of n samples of m columns.

    Attributes
    ----------
    columns
        The m names with units, the first one ``t[s]``.
    data
        Float64, shape (n, m), C-contiguous, in the units that the names say.
    """

    columns: tuple[str, ...]
    data: np.ndarray

    def __post_init__(self) -> None:
        if self.data.ndim != 2 or self.data.shape[1] != len(self.columns):
            raise BlockError(
                f"data of shape {self.data.shape} does not fit {len(self.columns)} columns "
                f"{self.columns}"
            )

    @property
    def time(self) -> np.ndarray:
        """Return the sample times [s], shape (n,)."""
        return self.data[:, 0]

    def column(self, name: str) -> np.ndarray:
        """Return one column by its full name, as ``torque[N.m]``, shape (n,).

        Raises
        ------
        BlockError
            No such column.
        """
        try:
            return self.data[:, self.columns.index(name)]
        except ValueError:
            raise BlockError(
                f"no column '{name}'; the block has {', '.join(self.columns)}"
            ) from None

    def has(self, name: str) -> bool:
        """Return whether a column of that full name exists."""
        return name in self.columns

    def in_si(self) -> tuple[Block, list[str]]:
        """Return the same block in SI, and a sentence for each column that was converted.

        Raises
        ------
        UnitError
            A column without a unit, or with one that is not known.
        """
        names, factors, notes = _si_columns(self.columns)
        if not notes:
            return self, []
        return Block(names, np.ascontiguousarray(self.data * factors)), list(notes)


@lru_cache(maxsize=64)
def _si_columns(columns: tuple[str, ...]) -> tuple[tuple[str, ...], np.ndarray, tuple[str, ...]]:
    names, factors, notes = [], [], []
    for column in columns:
        quantity, unit = split_column(column)
        si, factor = to_si(unit)
        names.append(f"{quantity}[{si}]")
        factors.append(factor)
        if si != unit:
            notes.append(f"column '{column}' converted to '{quantity}[{si}]' (times {factor:g})")
    return tuple(names), np.array(factors), tuple(notes)


def require_columns(
    block: Block, columns: Sequence[str], topic: str, optional: Collection[str] = ()
) -> Block:
    """Return the wanted columns of a block in SI, preceded by time, in the order asked for.

    Parameters
    ----------
    block
        Any block.
    columns
        Full SI names without time, as ``("position[rad]", "torque[N.m]")``.
    topic
        Named in the error.
    optional
        Those of `columns` that are left out where the block does not have them.

    Raises
    ------
    UnitError
        A wanted quantity comes in a unit of another dimension, or in an unknown one.
    BlockError
        A quantity that is not optional is missing.
    """
    return select_columns(block, columns, topic, optional)[0]


def select_columns(
    block: Block, columns: Sequence[str], topic: str, optional: Collection[str] = ()
) -> tuple[Block, list[str]]:
    """Return what `require_columns` returns, and say which columns were converted.

    Columns that are not wanted may have any unit.

    Returns
    -------
    tuple
        The block, and a sentence for each column that was converted.
    """
    index = _find_columns(block.columns, tuple(columns), tuple(optional), topic)
    if index != tuple(range(len(block.columns))):
        names = tuple(block.columns[k] for k in index)
        block = Block(names, np.ascontiguousarray(block.data[:, index]))
    return block.in_si()


@lru_cache(maxsize=64)
def _find_columns(
    held: tuple[str, ...], columns: tuple[str, ...], optional: tuple[str, ...], topic: str
) -> tuple[int, ...]:
    if held[0] != TIME_COLUMN and _si_name(held[0]) != TIME_COLUMN:
        raise BlockError(f"{topic}: the first column is '{held[0]}', expected '{TIME_COLUMN}'")
    index = [0]
    for name in columns:
        found = _find_column(held, name, topic)
        if found is not None:
            index.append(found)
        elif name not in optional:
            raise BlockError(f"{topic}: no column '{name}'; the block has {', '.join(held)}")
    return tuple(index)


def _find_column(held: tuple[str, ...], name: str, topic: str) -> int | None:
    if name in held:
        return held.index(name)
    quantity, unit = split_column(name)
    for index, other in enumerate(held):
        if split_column(other)[0] != quantity:
            continue
        if _si_name(other) == name:
            return index
        raise UnitError(
            f"{topic}: {quantity} comes in '{split_column(other)[1]}', expected {unit} or a "
            "multiple of it"
        )
    return None


def _si_name(column: str) -> str:
    quantity, unit = split_column(column)
    return f"{quantity}[{to_si(unit)[0]}]"


@lru_cache(maxsize=256)
def _head(columns: tuple[str, ...], n: int) -> bytes:
    """Return CDR bytes of everything before the samples."""
    m = len(columns)
    out = bytearray()

    def number(value: int) -> None:
        out.extend(b"\0" * (-len(out) % 4))
        out.extend(struct.pack("<I", value))

    def text(value: str) -> None:
        raw = value.encode() + b"\0"
        number(len(raw))
        out.extend(raw)

    number(2)
    text("sample")
    number(n)
    number(n * m)
    text(",".join(columns))
    number(m)
    number(m)
    number(0)
    number(n * m)
    if n * m:
        out.extend(b"\0" * (-len(out) % 8))
    return _LITTLE_ENDIAN + bytes(out)


def pack(block: Block) -> bytes:
    """Return the CDR bytes of the block's message (little endian).

    Parameters
    ----------
    block
        Its samples, shape (n, m), become float64.
    """
    return (
        _head(block.columns, block.data.shape[0])
        + np.ascontiguousarray(block.data, dtype="<f8").tobytes()
    )


@lru_cache(maxsize=256)
def _layout(head: bytes, total: int) -> tuple[tuple[str, ...], int, int]:
    """Return columns, n and offset of the samples, read from the bytes before the samples."""
    order = {_LITTLE_ENDIAN: "<", _BIG_ENDIAN: ">"}.get(head[:4])
    if order is None:
        raise BlockError(f"not a CDR message: it starts with {head[:4].hex(' ')}")
    position = 4

    def number() -> int:
        nonlocal position
        position += -(position - 4) % 4
        (value,) = struct.unpack_from(order + "I", head, position)
        position += 4
        return value

    def text() -> str:
        nonlocal position
        length = number()
        raw = head[position : position + max(length - 1, 0)]
        position += length
        return raw.decode()

    try:
        dimensions = []
        count = number()
        if count != 2:
            raise BlockError(f"the layout has {count} dimensions, expected 2 (sample, columns)")
        for _ in range(count):
            label = text()
            dimensions.append((label, number(), number()))
        offset = number()
        length = number()
    except (struct.error, UnicodeDecodeError) as error:
        raise BlockError(f"the message is cut off or damaged in its layout ({error})") from None
    (label, n, stride), (names, m, _) = dimensions
    columns = tuple(names.split(","))
    if label != "sample" or len(columns) != m or stride != n * m:
        raise BlockError(
            f"the layout contradicts itself: dimensions ('{label}', {n}, {stride}) and "
            f"('{names}', {m}); "
            "expected ('sample', n, n*m) and (m names joined by commas, m)"
        )
    if offset + n * m != length:
        raise BlockError(
            f"the layout says {n} samples of {m} columns from offset {offset}, the data holds "
            f"{length} numbers"
        )
    if length:
        position += -(position - 4) % 8
    start = position + 8 * offset
    end = start + 8 * n * m
    if end > total:
        raise BlockError(f"the message is cut off: {total} bytes, {end} expected")
    if total - end > LARGEST_PADDING:
        raise BlockError(
            f"the message has {total - end} bytes behind its samples: its layout is damaged, or "
            "bytes were put in"
        )
    return columns, n, start


def unpack(message: bytes | bytearray | memoryview) -> Block:
    """Return the block in the CDR bytes of a Float64MultiArray.

    The data is a read-only view of the bytes where that is possible.

    Parameters
    ----------
    message
        The whole message, as a bag or a raw subscription gives it.

    Raises
    ------
    BlockError
        No such message, cut off, or a layout that contradicts its data.
    """
    view = memoryview(message)
    columns, n, start = find_layout(view)
    m = len(columns)
    order = "<f8" if view[1] == 1 else ">f8"
    data = np.frombuffer(view, dtype=order, count=n * m, offset=start).reshape(n, m)
    return Block(columns, data if order == "<f8" else data.astype(float))


def find_layout(message: bytes | memoryview) -> tuple[tuple[str, ...], int, int]:
    """Return the m column names, the number n of samples, and where in the message they start.

    It depends on the length of the message and on the bytes before the samples alone, which repeat
    from block to block.

    Parameters
    ----------
    message
        The CDR bytes of a Float64MultiArray.

    Raises
    ------
    BlockError
        As `unpack`.
    """
    view = memoryview(message)
    size = len(view)
    if size < 40:
        raise BlockError(f"the message is cut off: {size} bytes")
    order = "<I" if view[1] == 1 else ">I"
    # The names' length stands behind ('sample', n, stride): 4 head + 4 count + 4 + 7 text + 1 pad +
    # 8.
    (names,) = struct.unpack_from(order, view, 28)
    end = 32 + names + (-names % 4) + 16
    # Not one byte of the samples: they differ from block to block.
    return _layout(bytes(view[:end]), size)
