"""Export of topics that are not blocks, and refusal of what cannot be exported."""

import csv
import json

import numpy as np
import pytest

from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError
from session_recorder.exporting import export_bag
from session_recorder.message_definitions import typestore


def test_other_messages_become_json(tmp_path):
    store = typestore()
    make = store.types
    stamp = make["builtin_interfaces/msg/Time"](sec=3, nanosec=7)
    header = make["std_msgs/msg/Header"](stamp=stamp, frame_id="foot")
    state = make["sensor_msgs/msg/JointState"](
        header=header,
        name=["ankle"],
        position=np.array([0.125]),
        velocity=np.array([]),
        effort=np.array([-3.5]),
    )
    event = make["std_msgs/msg/String"](data='hold: "started", 5 N·m')
    with BagWriter(tmp_path / "bag") as writer:
        for topic, message in (("/ankle/joint_states", state), ("/session/event", event)):
            writer.add_topic(topic, message.__msgtype__)
            writer.write(
                topic, 1_500_000_001, bytes(store.serialize_cdr(message, message.__msgtype__))
            )
    joint, session = export_bag(tmp_path / "bag", tmp_path / "out", "csv")
    assert (joint.name, session.name) == ("ankle_joint_states.csv", "session_event.csv")
    with joint.open(newline="") as file:
        head, row = list(csv.reader(file))
    assert head == ["log_time[s]", "sensor_msgs/msg/JointState"]
    assert row[0] == "1.500000001"
    assert json.loads(row[1]) == {
        "header": {"stamp": {"sec": 3, "nanosec": 7}, "frame_id": "foot"},
        "name": ["ankle"],
        "position": [0.125],
        "velocity": [],
        "effort": [-3.5],
    }
    with session.open(newline="", encoding="utf-8") as file:
        assert json.loads(list(csv.reader(file))[1][1]) == {"data": 'hold: "started", 5 N·m'}
    with pytest.raises(BagError, match="holds nothing that can be written as npz"):
        export_bag(tmp_path / "bag", tmp_path / "out.npz", "npz")


def test_wrong_requests_are_refused(make_bag, tmp_path):
    bag = make_bag()
    with pytest.raises(BagError, match="format 'xls' is not written; expected csv or npz"):
        export_bag(bag, tmp_path / "out", "xls")
    with pytest.raises(BagError, match="has no topic '/emg/samples'"):
        export_bag(bag, tmp_path / "out", "csv", topics=["/emg/samples"])
    (tmp_path / "file").write_text("")
    with pytest.raises(BagError, match="cannot write"):
        export_bag(bag, tmp_path / "file" / "out", "csv")
    assert [
        path.name for path in export_bag(bag, tmp_path / "some", "csv", topics=["/ankle/samples"])
    ] == ["ankle_samples.csv"]
