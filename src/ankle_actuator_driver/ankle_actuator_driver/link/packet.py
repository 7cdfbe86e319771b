"""The packets between driver and rig controller: layout, checksum, and a parser that takes any
bytes.

Everything is little-endian and at fixed places; docs/rig_protocol.md is the specification. A packet
is header, body of its kind, n samples of three float64, and the CRC-32 of all bytes before it
(zlib's: reflected polynomial 0xEDB88320, start and final exclusive-or 0xFFFFFFFF).
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from enum import Enum, IntEnum, IntFlag
from typing import Union

import numpy as np

MAGIC = b"ANKL"
VERSION = 1
LARGEST_COUNT = 48
"""Samples in a packet: 1236 bytes then, below the 1472 that one Ethernet frame carries."""
SHORTEST_INTERVAL, LONGEST_INTERVAL = 5e-5, 0.02
"""[s] Between samples: 20 kHz to 50 Hz; anything else is a misunderstanding."""

_HEADER = struct.Struct("<4sBBHIIq")
_COMMAND = struct.Struct("<BBHI")
_SPACING = struct.Struct("<qd")
_STATE = struct.Struct("<BBHIIIqqqdd")
_CHECKSUM = struct.Struct("<I")
HEADER_SIZE, CHECKSUM_SIZE = _HEADER.size, _CHECKSUM.size
_SAMPLE_SIZE = 24
_HEARTBEAT, _REFERENCE, _STATE_KIND = 1, 2, 3
_BODY_SIZE = {
    _HEARTBEAT: _COMMAND.size,
    _REFERENCE: _COMMAND.size + _SPACING.size,
    _STATE_KIND: _STATE.size,
}


class Wanted(IntEnum):
    """What the driver wants the rig to do. OFF always means: a smooth stop first, if the plate
    moves.
    """

    OFF = 0
    HOLD = 1
    FOLLOW = 2


class DeviceState(IntEnum):
    """What the rig does."""

    OFF = 0
    HOLD = 1
    FOLLOW = 2
    STOPPING = 3
    FAULT = 4


class DeviceFault(IntEnum):
    """Why the rig is, or is about to be, in `DeviceState.FAULT`."""

    NONE = 0
    HEARTBEAT_LOST = 1
    REFERENCE_BEYOND_LIMIT = 2
    MOTION_BEYOND_LIMIT = 3
    TORQUE = 4
    ENCODER = 5
    FOLLOWING_ERROR = 6
    EMERGENCY_STOP = 7


class Status(IntFlag):
    """Bits that say more about the rig."""

    EMERGENCY_STOP_PRESSED = 1
    YIELDING = 2
    REFERENCE_BRIDGED = 4
    REFERENCE_LOST = 8


class Refusal(Enum):
    """Why bytes are no packet, or a packet is not obeyed."""

    TOO_SHORT = "shorter than a header and a checksum"
    MAGIC = "does not start with 'ANKL'"
    VERSION = f"not version {VERSION} of the protocol"
    KIND = "unknown kind"
    COUNT = f"0 samples where some are needed, some where none are, or more than {LARGEST_COUNT}"
    LENGTH = "length that does not fit kind and number of samples"
    CHECKSUM = "wrong checksum"
    CONTENT = "a field outside its range"
    NOT_FINITE = "a sample that is NaN or infinite"
    DIRECTION = "a packet that goes the other way"
    SESSION = "of a session that is not obeyed"
    OLD = "older than one that came before, or the same again"
    TIME = "samples that are over, or too far ahead"
    LIMIT = "a reference beyond a limit"


@dataclass(frozen=True)
class Heartbeat:
    """Driver to rig, at least every 20 ms.

    Attributes
    ----------
    session
        Drawn anew by the driver at each start, not 0.
    sequence
        Counts all packets of the driver, from 1.
    sent
        Driver's clock at sending [ns].
    wanted
        What the rig is to do.
    resets
        Rises by one, modulo 256, for each reset of a fault.
    heard
        Sequence of the newest packet from the rig, 0 before any.
    """

    session: int
    sequence: int
    sent: int
    wanted: Wanted
    resets: int
    heard: int


@dataclass(frozen=True)
class Reference(Heartbeat):
    """Driver to rig: where the plate is to be; a heartbeat as well.

    Attributes
    ----------
    first
        Rig's clock at which sample 0 is due [ns].
    interval
        Between samples on the rig's clock [s].
    motion
        Position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 3), 1 <= n <=
        LARGEST_COUNT.
    """

    first: int
    interval: float
    motion: np.ndarray


@dataclass(frozen=True)
class StateReport:
    """Rig to driver, at least every 20 ms.

    Attributes
    ----------
    session
        Drawn anew by the rig at each start, not 0.
    sequence
        Counts all packets of the rig, from 1.
    sent
        Rig's clock at sending [ns].
    state, fault, status
        Of the rig.
    heard
        Sequence of the newest packet from the driver that was obeyed, 0 before any.
    host
        Session of the driver that is obeyed, 0 for none.
    refused
        Packets refused since the rig's start, modulo 2^32.
    echo
        `sent` of the packet `heard`, as it came [ns].
    echo_received
        Rig's clock when it came [ns].
    first
        Rig's clock at sample 0 [ns].
    interval
        Between samples on the rig's clock [s].
    commanded
        Position that the servo is told now [rad].
    samples
        Position [rad], velocity [rad/s], torque [N.m], shape (n, 3), 0 <= n <= LARGEST_COUNT.
    """

    session: int
    sequence: int
    sent: int
    state: DeviceState
    fault: DeviceFault
    status: Status
    heard: int
    host: int
    refused: int
    echo: int
    echo_received: int
    first: int
    interval: float
    commanded: float
    samples: np.ndarray


Packet = Union[Heartbeat, Reference, StateReport]


def build(packet: Packet) -> bytes:
    """The bytes of a packet.

    Raises
    ------
    struct.error
        A field that its place cannot hold.
    """
    samples = b""
    if isinstance(packet, StateReport):
        kind, count = _STATE_KIND, len(packet.samples)
        body = _STATE.pack(
            packet.state,
            packet.fault,
            packet.status,
            packet.heard,
            packet.host,
            packet.refused,
            packet.echo,
            packet.echo_received,
            packet.first,
            packet.interval,
            packet.commanded,
        )
        samples = np.ascontiguousarray(packet.samples, dtype="<f8").tobytes()
    else:
        kind, count = _HEARTBEAT, 0
        body = _COMMAND.pack(packet.wanted, packet.resets, 0, packet.heard)
        if isinstance(packet, Reference):
            kind, count = _REFERENCE, len(packet.motion)
            body += _SPACING.pack(packet.first, packet.interval)
            samples = np.ascontiguousarray(packet.motion, dtype="<f8").tobytes()
    data = (
        _HEADER.pack(MAGIC, VERSION, kind, count, packet.session, packet.sequence, packet.sent)
        + body
        + samples
    )
    return data + _CHECKSUM.pack(zlib.crc32(data))


def parse(data: bytes) -> Union[Packet, Refusal]:
    """The packet in some bytes, or why they are none. Never raises, whatever the bytes are."""
    if len(data) < HEADER_SIZE + CHECKSUM_SIZE:
        return Refusal.TOO_SHORT
    magic, version, kind, count, session, sequence, sent = _HEADER.unpack_from(data)
    if magic != MAGIC:
        return Refusal.MAGIC
    if version != VERSION:
        return Refusal.VERSION
    if kind not in _BODY_SIZE:
        return Refusal.KIND
    if (
        count > LARGEST_COUNT
        or (kind == _HEARTBEAT and count)
        or (kind == _REFERENCE and not count)
    ):
        return Refusal.COUNT
    if len(data) != HEADER_SIZE + _BODY_SIZE[kind] + _SAMPLE_SIZE * count + CHECKSUM_SIZE:
        return Refusal.LENGTH
    if _CHECKSUM.unpack_from(data, len(data) - CHECKSUM_SIZE)[0] != zlib.crc32(
        data[:-CHECKSUM_SIZE]
    ):
        return Refusal.CHECKSUM
    if not session:
        return Refusal.CONTENT
    samples = np.frombuffer(
        data, dtype="<f8", count=3 * count, offset=HEADER_SIZE + _BODY_SIZE[kind]
    ).reshape(count, 3)
    if not np.isfinite(samples).all():
        return Refusal.NOT_FINITE
    if kind == _STATE_KIND:
        return _parse_state(data, session, sequence, sent, samples)
    wanted, resets, reserved, heard = _COMMAND.unpack_from(data, HEADER_SIZE)
    if wanted not in _WANTED or reserved:
        return Refusal.CONTENT
    if kind == _HEARTBEAT:
        return Heartbeat(session, sequence, sent, Wanted(wanted), resets, heard)
    first, interval = _SPACING.unpack_from(data, HEADER_SIZE + _COMMAND.size)
    if not SHORTEST_INTERVAL <= interval <= LONGEST_INTERVAL:
        return Refusal.CONTENT
    return Reference(
        session, sequence, sent, Wanted(wanted), resets, heard, first, interval, samples
    )


def _parse_state(
    data: bytes, session: int, sequence: int, sent: int, samples: np.ndarray
) -> Union[StateReport, Refusal]:
    state, fault, status, heard, host, refused, echo, received, first, interval, commanded = (
        _STATE.unpack_from(data, HEADER_SIZE)
    )
    known = state in _STATES and fault in _FAULTS and not status & ~_STATUS_BITS
    if (
        not known
        or not SHORTEST_INTERVAL <= interval <= LONGEST_INTERVAL
        or not abs(commanded) < np.pi
    ):
        return Refusal.CONTENT
    return StateReport(
        session,
        sequence,
        sent,
        DeviceState(state),
        DeviceFault(fault),
        Status(status),
        heard,
        host,
        refused,
        echo,
        received,
        first,
        interval,
        commanded,
        samples,
    )


_WANTED = frozenset(int(value) for value in Wanted)
_STATES = frozenset(int(value) for value in DeviceState)
_FAULTS = frozenset(int(value) for value in DeviceFault)
_STATUS_BITS = sum(int(bit) for bit in Status)


def newer(sequence: int, last: int) -> bool:
    """Whether a sequence number follows another one; they count modulo 2^32."""
    return 0 < (sequence - last) % 2**32 < 2**31
