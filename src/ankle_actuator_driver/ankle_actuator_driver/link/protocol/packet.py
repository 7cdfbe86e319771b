"""The packets between driver and rig controller: layout, digest, and a parser that takes any bytes.

Everything is little-endian and at fixed places; docs/rig_protocol.md is the specification. A packet
is header, body of its kind, n samples of three float64, and the digest of all bytes before it:
BLAKE2s of 16 bytes (RFC 7693), keyed where both ends have the same key.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from enum import Enum
from hashlib import blake2s
from hmac import compare_digest
from pathlib import Path
from typing import Union

import numpy as np

from ankle_actuator_driver.safety.rig import DeviceFault, DeviceState, Status, Wanted
from ankle_interfaces.errors import QuantityError

MAGIC = b"ANKL"
VERSION = 2
LARGEST_COUNT = 48
"""Largest number of samples in a packet: 1248 bytes then, below the 1472 that one Ethernet frame
carries."""
SHORTEST_INTERVAL, LONGEST_INTERVAL = 5e-5, 0.02
"""[s] Allowed time between samples: 20 kHz to 50 Hz; anything else is a misunderstanding."""
DIGEST_SIZE = 16
"""[bytes] Size of the digest, 128 bits: nobody guesses one while a rig runs."""
LARGEST_KEY = 32
"""[bytes] Largest key that BLAKE2s takes."""
SHORTEST_KEY = 16
"""[bytes] Shortest key that a key file may hold: 128 bits."""
LARGEST_SAMPLE = (np.pi, 1e3, 1e6)
"""[rad, rad/s, rad/s^2 or N.m] Largest value of a sample: no plate and no sensor gives more;
squares and sums of it are finite."""
LARGEST_TIME = 2**62
"""[ns] Largest time, 146 years: differences of two times fit into 64 bits."""

_HEADER = struct.Struct("<4sBBHIIq")
_COMMAND = struct.Struct("<BBHII")
_SPACING = struct.Struct("<qd")
_STATE = struct.Struct("<BBHIIIqqqdd")
HEADER_SIZE = _HEADER.size
SEQUENCE_OFFSET = 12
"""[bytes] Offset of a packet's sequence; its time of sending follows."""
_SAMPLE_SIZE = 24
_HEARTBEAT, _REFERENCE, _STATE_KIND = 1, 2, 3
_BODY_SIZE = {
    _HEARTBEAT: _COMMAND.size,
    _REFERENCE: _COMMAND.size + _SPACING.size,
    _STATE_KIND: _STATE.size,
}


class Refusal(Enum):
    """Names the reason why bytes are no packet, or why a packet is not obeyed."""

    TOO_SHORT = "shorter than a header and a digest"
    MAGIC = "does not start with 'ANKL'"
    VERSION = f"not version {VERSION} of the protocol"
    KIND = "unknown kind"
    COUNT = f"0 samples where some are needed, some where none are, or more than {LARGEST_COUNT}"
    LENGTH = "length that does not fit kind and number of samples"
    DIGEST = "wrong digest: damaged, or from somebody without the key"
    CONTENT = "a field outside its range"
    NOT_FINITE = "a sample that is NaN or infinite"
    DIRECTION = "a packet that goes the other way"
    SESSION = "of a session that is not obeyed"
    OLD = "older than one that came before, or the same again"
    TIME = "samples that are over, or too far ahead"
    LIMIT = "a reference beyond a limit"
    START = "meant for another start of the rig"
    PEER = "from another address than the one that is obeyed"


@dataclass(frozen=True)
class Heartbeat:
    """Tells the rig that the driver lives; sent by the driver at least every 20 ms.

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
    rig
        Session of the rig that is addressed, 0 before any was heard; then `wanted` is OFF.
    """

    session: int
    sequence: int
    sent: int
    wanted: Wanted
    resets: int
    heard: int
    rig: int


@dataclass(frozen=True)
class Reference(Heartbeat):
    """Carries the motion that the plate is to follow from driver to rig; counts as a heartbeat.

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
    """Carries the rig's state and samples from rig to driver; sent at least every 20 ms.

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
        Position that the servo was given at the last sample [rad].
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


def read_key(path: str) -> bytes:
    """Read the key that both ends share from its file, without white space at its ends.

    Parameters
    ----------
    path
        Of the file; empty for no key.

    Raises
    ------
    QuantityError
        A key that is too short or too long; names the file.
    OSError
        A file that cannot be read.
    """
    if not path:
        return b""
    key = Path(path).expanduser().read_bytes().strip()
    if not SHORTEST_KEY <= len(key) <= LARGEST_KEY:
        raise QuantityError(
            f"the key in {path} has {len(key)} bytes; allowed: {SHORTEST_KEY} to {LARGEST_KEY}, "
            "as `openssl rand -hex 16` makes them"
        )
    return key


def sealed(data: bytes, key: bytes = b"") -> bytes:
    """Return header, body and samples with their digest."""
    return data + blake2s(data, key=key, digest_size=DIGEST_SIZE).digest()


def build(packet: Packet, key: bytes = b"") -> bytes:
    """Return the bytes of a packet.

    Raises
    ------
    struct.error
        A field that its place cannot hold.
    """
    return sealed(unsealed(packet), key)


def unsealed(packet: Packet) -> bytes:
    """Return the bytes of a packet without its digest."""
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
        body = _COMMAND.pack(packet.wanted, packet.resets, 0, packet.heard, packet.rig)
        if isinstance(packet, Reference):
            kind, count = _REFERENCE, len(packet.motion)
            body += _SPACING.pack(packet.first, packet.interval)
            samples = np.ascontiguousarray(packet.motion, dtype="<f8").tobytes()
    head = _HEADER.pack(MAGIC, VERSION, kind, count, packet.session, packet.sequence, packet.sent)
    return head + body + samples


def as_heartbeat(data: bytes) -> bytes:
    """Return the heartbeat that a driver's packet, without its digest, is as well."""
    kind_and_count = struct.pack("<BH", _HEARTBEAT, 0)
    return data[:5] + kind_and_count + data[8 : HEADER_SIZE + _COMMAND.size]


def numbers_of(data: bytes) -> tuple[int, int]:
    """Return sequence and time of sending [ns] of a packet."""
    sequence, sent = struct.unpack_from("<Iq", data, SEQUENCE_OFFSET)
    return int(sequence), int(sent)


def renumbered(data: bytes, sequence: int, sent: int) -> bytes:
    """Return a packet without its digest, with another sequence and time of sending [ns]."""
    return data[:SEQUENCE_OFFSET] + struct.pack("<Iq", sequence, sent) + data[HEADER_SIZE:]


def parse(data: bytes, key: bytes = b"") -> Union[Packet, Refusal]:
    """Return the packet in some bytes, or why they are none; it never raises."""
    if reason := _misshapen(data, key):
        return reason
    _, _, kind, count, session, sequence, sent = _HEADER.unpack_from(data)
    samples = np.frombuffer(
        data, dtype="<f8", count=3 * count, offset=HEADER_SIZE + _BODY_SIZE[kind]
    ).reshape(count, 3)
    if not np.isfinite(samples).all():
        return Refusal.NOT_FINITE
    if not session or abs(sent) > LARGEST_TIME or (np.abs(samples) > LARGEST_SAMPLE).any():
        return Refusal.CONTENT
    if kind == _STATE_KIND:
        return _parse_state(data, session, sequence, sent, samples)
    return _parse_command(data, kind, session, sequence, sent, samples)


def _misshapen(data: bytes, key: bytes) -> Refusal | None:
    """Return what is wrong with a packet before its content is looked at."""
    if len(data) < HEADER_SIZE + DIGEST_SIZE:
        return Refusal.TOO_SHORT
    magic, version, kind, count, *_ = _HEADER.unpack_from(data)
    if magic != MAGIC:
        return Refusal.MAGIC
    if version != VERSION:
        return Refusal.VERSION
    if kind not in _BODY_SIZE:
        return Refusal.KIND
    none, some = kind == _HEARTBEAT and count, kind == _REFERENCE and not count
    if count > LARGEST_COUNT or none or some:
        return Refusal.COUNT
    if len(data) != HEADER_SIZE + _BODY_SIZE[kind] + _SAMPLE_SIZE * count + DIGEST_SIZE:
        return Refusal.LENGTH
    expected = blake2s(data[:-DIGEST_SIZE], key=key, digest_size=DIGEST_SIZE).digest()
    return None if compare_digest(data[-DIGEST_SIZE:], expected) else Refusal.DIGEST


def _parse_command(
    data: bytes, kind: int, session: int, sequence: int, sent: int, samples: np.ndarray
) -> Union[Heartbeat, Refusal]:
    wanted, resets, reserved, heard, rig = _COMMAND.unpack_from(data, HEADER_SIZE)
    if wanted not in _WANTED or reserved or (not rig and wanted):
        return Refusal.CONTENT
    head = (session, sequence, sent, Wanted(wanted), resets, heard, rig)
    if kind == _HEARTBEAT:
        return Heartbeat(*head)
    first, interval = _SPACING.unpack_from(data, HEADER_SIZE + _COMMAND.size)
    if not SHORTEST_INTERVAL <= interval <= LONGEST_INTERVAL or abs(first) > LARGEST_TIME:
        return Refusal.CONTENT
    return Reference(*head, first, interval, samples)


def _parse_state(
    data: bytes, session: int, sequence: int, sent: int, samples: np.ndarray
) -> Union[StateReport, Refusal]:
    state, fault, status, heard, host, refused, echo, received, first, interval, commanded = (
        _STATE.unpack_from(data, HEADER_SIZE)
    )
    known = state in _STATES and fault in _FAULTS and not status & ~_STATUS_BITS
    times = max(abs(echo), abs(received), abs(first)) <= LARGEST_TIME
    spaced = SHORTEST_INTERVAL <= interval <= LONGEST_INTERVAL
    if not (known and times and spaced and abs(commanded) < np.pi):
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
    """Return whether a sequence number follows another one; they count modulo 2^32."""
    return 0 < (sequence - last) % 2**32 < 2**31
