"""Damaged bags: the damage is reported, and everything before it is read."""

import os
import subprocess
import sys

import numpy as np
import pytest
from mcap.reader import make_reader

from ankle_interfaces.block import pack
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError
from session_recorder.recovery import recover


def test_truncated_at_any_byte_everything_before_is_read(make_bag, tmp_path):
    bag = make_bag(blocks=40, chunk_blocks=4)
    whole = next(bag.glob("*.mcap")).read_bytes()
    messages = list(BagReader(bag).messages())
    cut = tmp_path / "cut"
    cut.mkdir()
    with next(bag.glob("*.mcap")).open("rb") as stream:
        chunks = make_reader(stream).get_summary().chunk_indexes
    ends = [chunk.chunk_start_offset + chunk.chunk_length for chunk in chunks]
    positions = {*range(0, 60), *range(0, len(whole), 211), *range(len(whole) - 60, len(whole))}
    positions |= {end + k for end in ends for k in (-1, 0, 1)}
    read_some = 0
    for position in sorted(positions):
        (cut / "cut_0.mcap").write_bytes(whole[:position])
        expected = 8 * sum(end <= position for end in ends)
        if position < 8:
            with pytest.raises(BagError, match="is not an MCAP file"):
                BagReader(cut)
            continue
        reader = BagReader(cut)
        assert reader.problems
        assert list(reader.messages()) == messages[:expected], position
        assert reader.count == expected
        if expected:
            columns, data = reader.signal("/ankle/samples")
            assert data.shape == (expected // 2 * 32, len(columns))
            read_some += 1
    assert read_some > 60


def test_truncated_bag_with_metadata_says_how_much_is_missing_and_recovers(make_bag):
    bag = make_bag(blocks=40, chunk_blocks=4)
    messages = list(BagReader(bag).messages())
    content = next(bag.glob("*.mcap")).read_bytes()
    next(bag.glob("*.mcap")).write_bytes(content[: len(content) // 2])
    reader = BagReader(bag)
    assert any("counts 80 messages" in problem for problem in reader.problems)
    assert any("cut off or damaged at byte" in problem for problem in reader.problems)
    result = recover(bag)
    assert 0 < result.messages < 80
    repaired = BagReader(result.path)
    assert repaired.complete
    assert list(repaired.messages()) == messages[: result.messages]
    assert "cut off" in repaired.custom_data["recovered"]
    with pytest.raises(BagError, match="is there already"):
        recover(bag)


def test_a_damaged_chunk_in_the_middle_is_reported_and_the_rest_recovered(make_bag):
    bag = make_bag(blocks=40, chunk_blocks=4)
    messages = list(BagReader(bag).messages())
    content = bytearray(next(bag.glob("*.mcap")).read_bytes())
    with next(bag.glob("*.mcap")).open("rb") as stream:
        chunk = make_reader(stream).get_summary().chunk_indexes[3]
    content[chunk.chunk_start_offset + chunk.chunk_length - 20] ^= 0xFF
    next(bag.glob("*.mcap")).write_bytes(content)
    with pytest.raises(BagError, match=f"chunk at byte {chunk.chunk_start_offset}.*is damaged"):
        list(BagReader(bag).messages())
    result = recover(bag)
    assert list(BagReader(result.path).messages()) == messages[:24] + messages[32:]
    assert any("is damaged" in problem for problem in result.problems)


def test_random_damage_never_raises_anything_else_nor_invents_a_message(make_bag, tmp_path):
    bag = make_bag(blocks=24, chunk_blocks=4)
    true = {data for _, _, data in BagReader(bag).messages()}
    whole = next(bag.glob("*.mcap")).read_bytes()
    random = np.random.default_rng(11)
    hit = tmp_path / "hit"
    hit.mkdir()
    outcomes = {"read": 0, "refused": 0}
    for _ in range(200):
        content = bytearray(whole)
        for place in random.integers(0, len(whole), 3):
            content[place] = random.integers(256)
        (hit / "hit_0.mcap").write_bytes(content)
        try:
            assert {data for _, _, data in BagReader(hit).messages()} <= true
            outcomes["read"] += 1
        except BagError:
            outcomes["refused"] += 1
    assert min(outcomes.values()) > 0


def test_what_is_no_bag_is_named(tmp_path, make_bag):
    with pytest.raises(BagError, match="no such file or directory"):
        BagReader(tmp_path / "nowhere")
    (tmp_path / "empty").mkdir()
    with pytest.raises(BagError, match=r"holds neither metadata\.yaml nor an \.mcap file"):
        BagReader(tmp_path / "empty")
    (tmp_path / "text.mcap").write_text("this is a text file, and a long one")
    with pytest.raises(BagError, match="not an MCAP file"):
        BagReader(tmp_path / "text.mcap")
    (tmp_path / "empty" / "metadata.yaml").write_text(
        "rosbag2_bagfile_information: {storage_identifier: sqlite3}"
    )
    with pytest.raises(BagError, match="storage 'sqlite3' is not read here"):
        BagReader(tmp_path / "empty")
    with pytest.raises(
        BagError,
        match="has no topic '/emg/samples'; it holds /ankle/samples, /perturbation/reference",
    ):
        next(BagReader(make_bag()).blocks("/emg/samples"))


@pytest.mark.parametrize(
    "text", ["{", "- 1", "", "rosbag2_bagfile_information: {storage_identifier: mcap}", "a: \x00"]
)
def test_damaged_metadata_is_reported_and_the_data_read(make_bag, text):
    bag = make_bag()
    (bag / "metadata.yaml").write_text(text)
    reader = BagReader(bag)
    assert len(reader.problems) == 1
    assert str(bag / "metadata.yaml") in reader.problems[0]
    assert len(list(reader.messages())) == 200


def test_missing_data_file_is_named(make_bag):
    bag = make_bag()
    next(bag.glob("*.mcap")).unlink()
    with pytest.raises(BagError, match=r"is missing, though metadata\.yaml names it"):
        BagReader(bag)


def test_a_block_that_contradicts_itself_is_named_and_can_be_left_out(tmp_path, block):
    good = pack(block(0))
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/ankle/samples")
        writer.write("/ankle/samples", 1, good)
        writer.write("/ankle/samples", 2_000_000_000, good[:-8])
        writer.write("/ankle/samples", 3_000_000_000, pack(block(1)))
    reader = BagReader(tmp_path / "bag")
    with pytest.raises(BagError, match=r"/ankle/samples at 2\.000000 s: the message is cut off"):
        list(reader.blocks("/ankle/samples"))
    refused = []
    assert len(list(reader.blocks("/ankle/samples", refused.append))) == 2
    assert len(refused) == 1


FULL_DISK = """
import resource, signal, sys
import numpy as np
from ankle_interfaces.block import Block
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (200_000, 200_000))
random = np.random.default_rng(0)
with BagWriter(sys.argv[1]) as writer:
    writer.add_topic("/x")
    try:
        for number in range(10_000):
            writer.write_block("/x", Block(("t[s]", "v[1]"), np.column_stack([np.full(32, float(number)), random.normal(size=32)])))
            writer.flush()
    except BagError as error:
        print(number, error)
"""  # noqa: E501


def test_a_full_disk_is_one_clear_error_and_the_rest_is_readable(tmp_path):
    result = subprocess.run(
        [sys.executable, "-c", FULL_DISK, str(tmp_path / "bag")],
        capture_output=True,
        text=True,
        timeout=60,
        env=os.environ,
        check=True,
    )
    number, words = result.stdout.split(" ", 1)
    assert "cannot write" in words
    assert "File too large" in words
    reader = BagReader(tmp_path / "bag")
    assert reader.problems
    _, data = reader.signal("/x")
    assert len(data) == 32 * int(number)
    assert recover(tmp_path / "bag").messages == int(number)
