"""The protocol's bytes: what is written is read, everything else has a named reason, and nothing
makes the parser raise.
"""

import re
import struct
from collections import Counter
from dataclasses import replace
from hashlib import blake2s
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from ankle_actuator_driver.link.protocol.packet import (
    LARGEST_COUNT,
    LARGEST_SAMPLE,
    DeviceFault,
    DeviceState,
    Heartbeat,
    Reference,
    Refusal,
    StateReport,
    Status,
    Wanted,
    build,
    newer,
    parse,
    read_key,
    sealed,
)

HEARTBEAT = Heartbeat(4711, 9, 1_760_000_000_000_000_000, Wanted.HOLD, 3, 8, 77)
MOTION = np.array([[0.01, 0.5, -20.0], [0.0102, 0.49, -20.0]])
REFERENCE = Reference(
    4711,
    10,
    1_760_000_000_000_000_000,
    Wanted.FOLLOW,
    3,
    8,
    77,
    1_000_500_000_000,
    1 / 2048,
    MOTION,
)
REPORT = StateReport(
    session=77,
    sequence=12,
    sent=1_000_400_000_000,
    state=DeviceState.FOLLOW,
    fault=DeviceFault.NONE,
    status=Status.YIELDING,
    heard=10,
    host=4711,
    refused=5,
    echo=1_760_000_000_000_000_000,
    echo_received=1_000_399_000_000,
    first=1_000_384_000_000,
    interval=1 / 2048,
    commanded=0.0123,
    samples=np.array([[0.012, 0.4, 1.5]]),
)


def same(left, right):
    for name, value in vars(left).items():
        assert np.array_equal(value, getattr(right, name)), name
    return type(left) is type(right)


@pytest.mark.parametrize(
    "packet", [HEARTBEAT, REFERENCE, REPORT, replace(REPORT, samples=np.empty((0, 3)))]
)
def test_a_packet_comes_back_as_it_was(packet):
    assert same(packet, parse(build(packet)))


KEY = b"0123456789abcdef"


def test_only_whoever_has_the_key_is_understood():
    data = build(HEARTBEAT, KEY)
    assert same(HEARTBEAT, parse(data, KEY))
    assert parse(data) is Refusal.DIGEST
    assert parse(data, b"another key of 16") is Refusal.DIGEST
    assert parse(build(HEARTBEAT), KEY) is Refusal.DIGEST


def test_a_key_file_is_read_and_a_short_one_is_named(tmp_path):
    file = tmp_path / "rig.key"
    file.write_bytes(KEY + b"\n")
    assert read_key(str(file)) == KEY
    assert read_key("") == b""
    file.write_bytes(b"short")
    with pytest.raises(ValueError, match=r"rig\.key has 5 bytes; allowed: 16 to 32"):
        read_key(str(file))


def test_every_refusal_has_its_reason():
    good, reference = build(HEARTBEAT), build(REFERENCE)

    def changed(data, place, value):
        return sealed(data[:place] + bytes([value]) + data[place + 1 : -16])

    assert parse(b"") is Refusal.TOO_SHORT
    assert parse(good[:39]) is Refusal.TOO_SHORT
    assert parse(b"XNKL" + good[4:]) is Refusal.MAGIC
    assert parse(changed(good, 4, 1)) is Refusal.VERSION
    assert parse(changed(good, 5, 9)) is Refusal.KIND
    assert parse(changed(good, 6, 1)) is Refusal.COUNT
    assert parse(changed(reference, 6, 0)) is Refusal.COUNT
    assert parse(changed(reference, 6, LARGEST_COUNT + 1)) is Refusal.COUNT
    assert parse(changed(reference, 6, 3)) is Refusal.LENGTH
    assert parse(good[:-16] + b"\0\0" + good[-16:]) is Refusal.LENGTH
    assert parse(good[:-1] + bytes([good[-1] ^ 1])) is Refusal.DIGEST
    assert parse(changed(good, 24, 3)) is Refusal.CONTENT
    assert parse(changed(good, 26, 1)) is Refusal.CONTENT
    assert parse(build(replace(HEARTBEAT, session=0))) is Refusal.CONTENT
    assert parse(build(replace(REFERENCE, interval=float("nan")))) is Refusal.CONTENT
    assert parse(build(replace(REFERENCE, interval=0.5))) is Refusal.CONTENT
    assert parse(changed(build(REPORT), 24, 5)) is Refusal.CONTENT
    assert parse(build(replace(REPORT, commanded=float("inf")))) is Refusal.CONTENT
    assert parse(build(replace(REFERENCE, motion=MOTION * np.nan))) is Refusal.NOT_FINITE
    for column, largest in enumerate(LARGEST_SAMPLE):
        beyond = np.zeros((2, 3))
        beyond[1, column] = -1.01 * largest
        assert parse(build(replace(REFERENCE, motion=beyond))) is Refusal.CONTENT
        assert parse(build(replace(REPORT, samples=beyond))) is Refusal.CONTENT


def test_every_single_flipped_bit_is_refused():
    data = build(REFERENCE)
    for place in range(8 * len(data)):
        damaged = bytearray(data)
        damaged[place // 8] ^= 1 << (place % 8)
        assert isinstance(parse(bytes(damaged)), Refusal)


def test_sequence_numbers_go_round():
    assert newer(5, 4)
    assert newer(0, 2**32 - 1)
    assert not newer(4, 4)
    assert not newer(3, 4)
    assert not newer(2**32 - 1, 0)


def noise(random, count):
    """Random bytes, packets cut, lengthened, with flipped bits, and with random fields under a
    right checksum.
    """
    good = [
        build(HEARTBEAT),
        build(REFERENCE),
        build(REPORT),
        build(replace(REPORT, samples=np.zeros((LARGEST_COUNT, 3)))),
    ]
    for kind, pick, cut in zip(
        random.integers(5, size=count),
        random.integers(4, size=count),
        random.random(count),
        strict=True,
    ):
        data = good[pick]
        if kind == 0:
            yield random.bytes(int(cut * 1500))
        elif kind == 1:
            yield data[: int(cut * len(data))]
        elif kind == 2:
            yield data + random.bytes(1 + int(cut * 20))
        elif kind == 3:
            damaged = bytearray(data)
            damaged[int(cut * len(data))] ^= 1 + int(cut * 1e6) % 255
            yield bytes(damaged)
        else:
            place = 4 + int(cut * (len(data) - 24))
            yield sealed(data[:place] + random.bytes(4) + data[place + 4 : -16])


def fuzz(laboratory, count):
    """So many bad packets to a rig that holds the plate, from the driver's own address; what became
    of them.
    """
    lab = laboratory().armed()
    device, found = lab.device, Counter()
    before = lab.commands()[-1, 1]
    for index, data in enumerate(noise(np.random.default_rng(7), count)):
        parsed, obeyed = parse(data), device.receive(data, lab.rig_time)
        found[parsed if isinstance(parsed, Refusal) else "packet"] += 1
        # Whoever knows the session, a newer number and the checksum is the driver, as far as a
        # device can tell.
        assert (
            isinstance(obeyed, Refusal)
            or obeyed.session == 4711
            or device.state.name in ("OFF", "FAULT")
        )
        if not index % 1000:
            lab.run(0.02)
    lab.run(0.3)
    commands = lab.commands()
    assert np.all(commands[:, 1] == before)
    assert np.all(commands[:, 2:] == 0.0)
    return found


def test_random_and_mutated_packets_raise_nothing_and_move_nothing(laboratory):
    found = fuzz(laboratory, 20_000)
    assert {
        Refusal.TOO_SHORT,
        Refusal.MAGIC,
        Refusal.LENGTH,
        Refusal.DIGEST,
        Refusal.CONTENT,
    } <= set(found)


@pytest.mark.slow
@pytest.mark.timeout(3000)
def test_a_million_random_and_mutated_packets(laboratory):
    found = fuzz(laboratory, 1_000_000)
    assert sum(found.values()) == 1_000_000


@settings(max_examples=200, deadline=None)
@given(st.binary(max_size=1400), st.integers(1, 3), st.integers(0, 60))
def test_no_content_under_a_right_header_and_checksum_raises(body, kind, count):
    data = sealed(struct.pack("<4sBBHIIq", b"ANKL", 2, kind, count, 1, 1, 0) + body)
    assert parse(data) is not None


DOCUMENT = Path(__file__).resolve().parents[3] / "docs" / "rig_protocol.md"


@pytest.mark.parametrize(
    ("name", "packet"),
    [
        ("heartbeat", Heartbeat(0x1234, 7, 1_760_000_000_000_000_000, Wanted.HOLD, 2, 41, 77)),
        (
            "reference",
            Reference(
                0x1234,
                8,
                1_760_000_000_000_000_000,
                Wanted.FOLLOW,
                2,
                41,
                77,
                1_000_500_000_000,
                1 / 2048,
                MOTION,
            ),
        ),
        ("state", replace(REPORT, sequence=42, heard=8, host=0x1234)),
    ],
)
def test_the_examples_of_the_specification_are_the_packets_that_it_says(name, packet):
    (written,) = re.findall(rf"```text {name}\n(.*?)```", DOCUMENT.read_text(), re.DOTALL)
    assert bytes.fromhex(written) == build(packet)
    assert same(packet, parse(bytes.fromhex(written)))


def test_the_digest_is_the_one_of_the_specification():
    assert blake2s(b"abc", digest_size=16).hexdigest() in DOCUMENT.read_text()
    assert blake2s(b"abc", key=KEY, digest_size=16).hexdigest() in DOCUMENT.read_text()


def test_a_second_implementation_from_the_tables_reads_our_packets():
    """Every field of the tables, at the offset and in the type that they say."""
    types = {"u8": "<B", "u16": "<H", "u32": "<I", "i64": "<q", "f64": "<d"}
    kinds = {"Header": REPORT, "Kind 1": HEARTBEAT, "Kind 2": REFERENCE, "Kind 3": REPORT}
    fixed = {"version": 2, "kind": 3, "n": 1, "reserved": 0}
    read = 0
    for section in DOCUMENT.read_text().split("\n### ")[1:]:
        packet = next(
            (packet for title, packet in kinds.items() if section.startswith(title)), None
        )
        if packet is None:
            continue
        data = build(packet)
        for offset, form, field in re.findall(
            r"^\| (\d+) \| (u8|u16|u32|i64|f64) \| (\w+) \|", section, re.MULTILINE
        ):
            (value,) = struct.unpack_from(types[form], data, int(offset))
            assert value == fixed.get(field, getattr(packet, field, None)), field
            read += 1
    assert read == 6 + 5 + 2 + 11  # header, heartbeat, reference beyond it, state
