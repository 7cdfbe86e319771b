"""Bags: what is written comes back, also from the readers of others."""

import os
import shutil

import numpy as np
import pytest
import yaml
from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory
from rosbags.highlevel import AnyReader
from rosbags.interfaces import QosDurability, QosReliability
from rosbags.typesys import Stores, get_typestore

from ankle_interfaces.block import Block, pack, unpack
from session_recorder.bag_metadata import qos
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError
from session_recorder.message_definitions import definition


def test_every_message_comes_back_from_three_readers(make_bag):
    bag = make_bag()
    own = list(BagReader(bag).messages())
    assert len(own) == 200
    with next(bag.glob("*.mcap")).open("rb") as stream:
        foreign = [
            (channel.topic, message.log_time, message.data, list(decoded.data))
            for _, channel, message, decoded in make_reader(
                stream, decoder_factories=[DecoderFactory()]
            ).iter_decoded_messages()
        ]
    assert [entry[:3] for entry in foreign] == own
    assert all(
        np.array_equal(unpack(data).data.ravel(), decoded) for _, _, data, decoded in foreign
    )
    with AnyReader([bag]) as reader:
        other = [
            (c.topic, time, bytes(data), reader.deserialize(data, c.msgtype))
            for c, time, data in reader.messages()
        ]
        assert {c.topic: c.msgcount for c in reader.connections} == {
            "/ankle/samples": 100,
            "/perturbation/reference": 100,
        }
    assert [entry[:3] for entry in other] == own
    assert all(
        message.layout.dim[1].label == ",".join(unpack(data).columns)
        for _, _, data, message in other
    )


def test_metadata_is_complete_and_says_what_the_reader_says(make_bag):
    bag = make_bag()
    info = yaml.safe_load((bag / "metadata.yaml").read_text())["rosbag2_bagfile_information"]
    reader = BagReader(bag)
    assert reader.complete
    assert info["version"] == 9
    assert info["storage_identifier"] == "mcap"
    assert info["message_count"] == reader.count == 200
    assert (
        info["duration"]["nanoseconds"]
        == reader.end_ns - reader.start_ns
        == round(99 * 32 / 2048 * 1e9)
    )
    assert (
        info["relative_file_paths"]
        == [next(bag.glob("*.mcap")).name]
        == [file["path"] for file in info["files"]]
    )
    about = info["topics_with_message_count"][0]["topic_metadata"]
    assert about["type_description_hash"] == get_typestore(Stores.ROS2_JAZZY).hash_rihs01(
        "std_msgs/msg/Float64MultiArray"
    )
    assert about["offered_qos_profiles"][0]["reliability"] == "reliable"
    assert about["offered_qos_profiles"][0]["depth"] == 64
    assert "MSG: std_msgs/MultiArrayDimension" in reader.topics["/ankle/samples"].definition


def test_signal_and_blocks_are_what_was_written(make_bag, block):
    reader = BagReader(make_bag(blocks=30))
    columns, data = reader.signal("/ankle/samples")
    assert columns == block(0).columns
    assert np.array_equal(data, np.concatenate([block(k).data for k in range(30)]))
    assert reader.duration == pytest.approx(29 * 32 / 2048)


def test_joined_blocks_hold_what_the_blocks_hold(tmp_path, block):
    """Also with other columns, of another length, and beside messages that are no blocks."""
    torque = ("t[s]", "torque[N.m]")
    blocks = [block(k) for k in range(7)] + [block(7, size=5), block(8), block(9, torque)]
    messages = [pack(entry) for entry in blocks]
    messages[2] = messages[2][:-9]
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/ankle/samples")
        for stamp, message in enumerate(messages):
            writer.write("/ankle/samples", stamp, message)
        writer.write("/ankle/samples", len(messages), b"")
    reader = BagReader(tmp_path / "bag")
    refused, refused_joined = [], []
    single = list(reader.blocks("/ankle/samples", refused.append))
    joined = list(reader.joined_blocks("/ankle/samples", 3, refused_joined.append))
    assert len(refused) == 2
    assert refused_joined == refused
    assert [len(entry.data) for entry in joined] == [96, 96, 37, 32]
    assert joined[-1].columns == torque
    for columns in (block(0).columns, torque):
        np.testing.assert_array_equal(
            np.concatenate([entry.data for entry in joined if entry.columns == columns]),
            np.concatenate([entry.data for entry in single if entry.columns == columns]),
        )


@pytest.mark.parametrize("kept_bytes", [0, 20_000, 10**9])
def test_topics_are_read_one_after_the_other_whatever_stays_decompressed(make_bag, kept_bytes):
    bag = make_bag()
    reader = BagReader(bag, kept_bytes=kept_bytes)
    for topic in ("/perturbation/reference", "/ankle/samples"):
        expected = np.concatenate([entry.data for entry in BagReader(bag).blocks(topic)])
        for count in (7, 256):
            joined = list(reader.joined_blocks(topic, count))
            np.testing.assert_array_equal(np.concatenate([b.data for b in joined]), expected)
            assert {len(entry.data) for entry in joined[:-1]} <= {count * 32}


def test_an_index_that_names_a_message_of_another_channel_is_damage(make_bag):
    bag = make_bag(blocks=20, chunk_blocks=20)
    file = next(bag.glob("*.mcap"))
    with file.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
    chunk = next(c for c in summary.chunk_indexes if len(c.message_index_offsets) == 2)
    content = bytearray(file.read_bytes())
    first, second = (offset + 9 + 6 for offset in chunk.message_index_offsets.values())
    content[first : first + 16] = content[second : second + 16]
    file.write_bytes(content)
    with pytest.raises(BagError, match="is damaged: the index of a chunk names a place"):
        list(BagReader(bag).messages(["/ankle/samples"]))


def test_messages_written_out_of_order_are_read_in_order(tmp_path):
    times = np.random.default_rng(3).permutation(500) * 1_000_000
    with BagWriter(tmp_path / "bag") as writer:
        for topic in ("/a", "/b"):
            writer.add_topic(topic, "std_msgs/msg/String")
        for number, time in enumerate(times):
            writer.write("/a" if number % 3 else "/b", int(time), f"{time}".encode())
            if number % 50 == 49:
                writer.flush()
    read = list(BagReader(tmp_path / "bag").messages())
    assert [time for _, time, _ in read] == sorted(times.tolist())
    assert all(data == f"{time}".encode() for _, time, data in read)


def test_qos_and_custom_data_come_back(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic(
            "/session/event", "std_msgs/msg/String", [qos(7, reliable=False, latched=True)]
        )
        writer.add_qos("/session/event", qos(3))
        writer.custom_data["subject"] = "3: the 'odd' one\nsecond line"
    reader = BagReader(tmp_path / "bag")
    first, second = reader.topics["/session/event"].qos
    assert (first.depth, first.reliability, first.durability) == (
        7,
        QosReliability.BEST_EFFORT,
        QosDurability.TRANSIENT_LOCAL,
    )
    assert (second.depth, second.reliability) == (3, QosReliability.RELIABLE)
    assert reader.custom_data == {"subject": "3: the 'odd' one\nsecond line"}
    (file,) = (tmp_path / "bag").glob("*.mcap")
    with file.open("rb") as stream:
        records = {record.name: record.metadata for record in make_reader(stream).iter_metadata()}
    assert records["session_recorder"] == reader.custom_data
    (tmp_path / "bag" / "metadata.yaml").unlink()
    (alone,) = BagReader(tmp_path / "bag").topics["/session/event"].qos
    assert alone == first


@pytest.mark.parametrize(
    ("message_type", "nested"),
    [
        ("std_msgs/msg/Float64MultiArray", "std_msgs/MultiArrayLayout"),
        ("sensor_msgs/msg/JointState", "std_msgs/Header"),
        ("diagnostic_msgs/msg/DiagnosticArray", "diagnostic_msgs/KeyValue"),
        ("rosgraph_msgs/msg/Clock", "builtin_interfaces/Time"),
        ("rcl_interfaces/msg/ParameterEvent", "rcl_interfaces/ParameterValue"),
        ("rcl_interfaces/msg/Log", "builtin_interfaces/Time"),
        ("tf2_msgs/msg/TFMessage", "geometry_msgs/Quaternion"),
    ],
)
def test_definitions_are_full_and_hashed(message_type, nested):
    known = definition(message_type)
    assert f"MSG: {nested}\n" in known.text
    assert known.type_hash.startswith("RIHS01_")
    assert len(known.type_hash) == 7 + 64


def test_a_type_that_is_not_of_jazzy_is_read_from_its_installation(tmp_path, monkeypatch):
    folder = tmp_path / "share" / "lab_msgs" / "msg"
    folder.mkdir(parents=True)
    (folder / "Grip.msg").write_text(
        "# a grip\nstd_msgs/Header header\nlab_msgs/Finger[3] fingers\nfloat64[<=8] force\n"
    )
    (folder / "Finger.msg").write_text("string<=10 name\nfloat32 angle\n")
    monkeypatch.setenv("AMENT_PREFIX_PATH", str(tmp_path))
    known = definition("lab_msgs/msg/Grip")
    assert "MSG: lab_msgs/Finger\nstring<=10 name" in known.text
    with pytest.raises(BagError, match="no definition of message type 'lab_msgs/msg/Thumb'"):
        definition("lab_msgs/msg/Thumb")


def test_nothing_is_overwritten_unasked(make_bag, tmp_path, block):
    bag = make_bag()
    before = next(bag.glob("*.mcap")).read_bytes()
    with pytest.raises(BagError, match="nothing is overwritten unasked"):
        BagWriter(bag)
    (bag / "notes.txt").write_text("mine")
    with pytest.raises(BagError, match="not \\(only\\) a bag"):
        BagWriter(bag, overwrite=True)
    assert next(bag.glob("*.mcap")).read_bytes() == before
    (bag / "notes.txt").unlink()
    with BagWriter(bag, overwrite=True) as writer:
        writer.add_topic("/x")
        writer.write_block("/x", block(0))
    assert list(BagReader(bag).topics) == ["/x"]


def test_bag_is_finished_when_the_body_fails(tmp_path, block):
    def body():
        with BagWriter(tmp_path / "bag") as writer:
            writer.add_topic("/x")
            writer.write_block("/x", block(0))
            raise RuntimeError("elsewhere")

    with pytest.raises(RuntimeError, match="elsewhere"):
        body()
    assert BagReader(tmp_path / "bag").complete


def test_columns_that_change_and_time_that_runs_back_are_not_hidden(tmp_path, block):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/ankle/samples")
        for stamp, number in enumerate((0, 1, 0)):
            writer.write_block("/ankle/samples", block(number), stamp)
    _, data = BagReader(tmp_path / "bag").signal("/ankle/samples")
    assert data[64, 0] < data[63, 0]
    with BagWriter(tmp_path / "other") as writer:
        writer.add_topic("/ankle/samples")
        writer.write_block("/ankle/samples", block(0))
        writer.write_block("/ankle/samples", block(1, ("t[s]", "torque[N.m]")))
    with pytest.raises(BagError, match=r"changes its columns at t = 1000\.015625 s"):
        BagReader(tmp_path / "other").signal("/ankle/samples")


def test_wrong_use_of_the_writer_is_refused(tmp_path, block):
    with BagWriter(tmp_path / "bag") as writer:
        with pytest.raises(BagError, match="was not announced"):
            writer.write_block("/x", block(0))
        writer.add_topic("/x")
        with pytest.raises(BagError, match="does not fit into the same topic"):
            writer.add_topic("/x", "std_msgs/msg/String")
        with pytest.raises(BagError, match="before the epoch"):
            writer.write_block("/x", block(0), -5)
    with pytest.raises(BagError, match="is closed"):
        writer.write_block("/x", block(0))
    (tmp_path / "file").write_text("")
    with pytest.raises(BagError, match="cannot write a bag at"):
        BagWriter(tmp_path / "file" / "bag")


def test_single_file_and_split_bag_are_read(make_bag, tmp_path):
    first, second = make_bag("first", blocks=10), make_bag("second", blocks=20)
    assert BagReader(next(first.glob("*.mcap"))).count == 20
    split = tmp_path / "split"
    split.mkdir()
    shutil.copy(next(first.glob("*.mcap")), split / "split_0.mcap")
    shutil.copy(next(second.glob("*.mcap")), split / "split_1.mcap")
    assert len(list(BagReader(split).messages())) == 60


def test_progress_ends_at_one(make_bag):
    seen = []
    list(BagReader(make_bag()).messages(progress=seen.append))
    assert seen == sorted(seen)
    assert seen[-1] == 1.0
    assert len(seen) >= 5


def test_empty_blocks_and_empty_bags(tmp_path):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic("/x")
    reader = BagReader(tmp_path / "bag")
    assert reader.complete
    assert (reader.count, reader.duration) == (0, 0.0)
    with pytest.raises(BagError, match="holds no message"):
        reader.signal("/x")
    with BagWriter(tmp_path / "second") as writer:
        writer.add_topic("/x")
        writer.write_block("/x", Block(("t[s]", "v[1]"), np.zeros((0, 2))), 5)
    assert BagReader(tmp_path / "second").signal("/x")[1].shape == (0, 2)


def test_a_bag_is_brought_to_the_medium_while_it_is_open_and_left_alone_afterwards(
    tmp_path, monkeypatch
):
    synced = []
    monkeypatch.setattr(
        "os.fdatasync", lambda number: synced.append(os.readlink(f"/proc/self/fd/{number}"))
    )
    with BagWriter(tmp_path / "bag") as bag:
        bag.sync()
    bag.sync()
    assert synced == [str(tmp_path / "bag" / "bag_0.mcap")]
