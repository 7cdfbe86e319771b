"""Recording and replaying in a real graph of processes."""

import os
import signal
import time

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from session_recorder.bag_reader import BagReader
from session_recorder.recovery import recover

pytestmark = pytest.mark.live

# Sends blocks of 32 samples at 2048 Hz, a latched event and a best-effort text; says when it is
# done.
SOURCE = """
import sys, threading, time
import numpy as np
from rclpy.qos import QoSDurabilityPolicy, QoSProfile, QoSReliabilityPolicy
from sensor_msgs.msg import JointState
from std_msgs.msg import String
from ankle_interfaces.topics import ANKLE_SAMPLES
from ankle_node.node import AnkleNode, run
class Source(AnkleNode):
    def __init__(self):
        super().__init__("source", [])
        self.send = self.block_publisher(ANKLE_SAMPLES, ("t[s]", "position[rad]", "torque[N.m]"))
        self.event = self.create_publisher(String, "/session/event", QoSProfile(depth=5, durability=QoSDurabilityPolicy.TRANSIENT_LOCAL))
        self.text = self.create_publisher(String, "/text", QoSProfile(depth=5, reliability=QoSReliabilityPolicy.BEST_EFFORT))
        self.joint = self.create_publisher(JointState, "/joint_states", 10)
        self.event.publish(String(data="hold: started"))
        print("source is up", flush=True)
        self.when_read(ANKLE_SAMPLES, 1, lambda: threading.Thread(target=self.work, daemon=True).start())
    def work(self):
        began = time.time()
        print("sending", flush=True)
        for number in range(int(sys.argv[1])):
            t = began + (number * 32 + np.arange(32)) / 2048
            if number != int(sys.argv[2]):
                self.send(np.column_stack([t, np.sin(t), np.cos(t)]))
            self.text.publish(String(data=str(number)))
            self.joint.publish(JointState(name=["ankle"], position=[float(number)]))
            time.sleep(max(0.0, t[-1] - time.time()))
        print("all sent", flush=True)
sys.exit(run(Source, []))
"""  # noqa: E501

# Reads blocks slowly and sends something for each.
READER = """
import sys, time
from ankle_interfaces.topics import ANKLE_SAMPLES, IMPEDANCE_ESTIMATE
from ankle_node.node import AnkleNode, run
class Reader(AnkleNode):
    def __init__(self):
        super().__init__("reader", [])
        self.blocks = self.findings = 0
        self.first = self.last = None
        self.send = self.block_publisher(IMPEDANCE_ESTIMATE, ("t[s]", "K[N.m/rad]"))
        self.when_read(IMPEDANCE_ESTIMATE, int(sys.argv[2]), self.begin)
    def begin(self):
        self.stream = self.block_subscription(ANKLE_SAMPLES, self.take, ("position[rad]", "torque[N.m]"))
    def take(self, block, findings):
        self.blocks += 1
        self.findings += len(findings)
        time.sleep(float(sys.argv[1]))
        self.send(block.data[-1:, :2])
    def destroy_node(self):
        print("reader:", self.blocks, "blocks", self.findings, "findings", self.stream.missing, "missing", flush=True)
        super().destroy_node()
sys.exit(run(Reader, ["--ros-args", "-p", "use_sim_time:=true"]))
"""  # noqa: E501


def start_recording(graph, path, blocks, skipped=-1, **parameters):
    recorder = graph.node("record_node", {"out": path, **parameters})
    graph.wait_for_line(recorder, "ready: recording into")
    source = graph.start("-c", SOURCE, str(blocks), str(skipped))
    return recorder, source


def test_recorded_graph_is_complete_and_read_by_others(graph, tmp_path):
    path = tmp_path / "bag"
    recorder, source = start_recording(graph, path, 160, skipped=100)
    graph.wait_for_line(source, "all sent")
    time.sleep(0.5)
    summary = graph.stop(recorder)
    assert recorder.returncode == 0
    assert "32 samples missing (/ankle/samples 32), 0 messages lost" in summary
    reader = BagReader(path)
    assert reader.complete
    assert reader.custom_data["missing_samples /ankle/samples"] == "32"
    assert "32 samples (0.016 s) missing" in reader.custom_data["warnings"]
    counts = {name: topic.count for name, topic in reader.topics.items()}
    assert counts["/ankle/samples"] == 159
    assert counts["/joint_states"] == 160
    assert counts["/session/event"] == 1
    assert {"/diagnostics", "/rosout"} <= set(counts)
    assert not [name for name in counts if "_acknowledged" in name]
    latched = reader.topics["/session/event"].qos[0]
    assert latched.durability.name == "TRANSIENT_LOCAL"
    assert reader.topics["/text"].qos[0].reliability.name == "BEST_EFFORT"
    _, data = reader.signal("/ankle/samples")
    np.testing.assert_array_equal(data[:, 1], np.sin(data[:, 0]))
    with AnyReader([path]) as other:
        read = [(c.topic, stamp, bytes(message)) for c, stamp, message in other.messages()]
        assert sorted(read) == sorted(reader.messages())
        for connection, _, message in other.messages():
            other.deserialize(message, connection.msgtype)
    with next(path.glob("*.mcap")).open("rb") as stream:
        for _, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            assert (
                0 <= message.log_time - message.publish_time < 2_000_000_000
                or channel.topic == "/session/event"
            )


def test_a_killed_recorder_leaves_everything_but_the_last_second(graph, tmp_path):
    path = tmp_path / "bag"
    recorder, source = start_recording(graph, path, 100_000)
    graph.wait_for_line(source, "sending")
    time.sleep(3.0)
    killed_at = time.time()
    os.kill(recorder.pid, signal.SIGKILL)
    recorder.wait(timeout=10)
    graph.stop(source)
    reader = BagReader(path)
    assert any("metadata.yaml is missing" in problem for problem in reader.problems)
    assert any("without its index" in problem for problem in reader.problems)
    _, data = reader.signal("/ankle/samples")
    assert (
        killed_at - data[-1, 0] < 3.0
    )  # one second, and two for a machine that is busy with other tests
    assert np.all(np.abs(np.diff(data[:, 0]) - 1 / 2048) < 1e-5)
    assert recover(path).messages == reader.count
    assert BagReader(tmp_path / "bag_recovered").complete


def test_only_named_topics_and_stop_by_sigterm(graph, tmp_path):
    recorder = graph.node("record_node", {"out": tmp_path / "bag", "topics": "/ankle/samples"})
    source = graph.start("-c", SOURCE, "40", "-1")
    graph.wait_for_line(source, "all sent")
    time.sleep(0.3)
    graph.stop(recorder, signal.SIGTERM)
    assert recorder.returncode == 0
    assert {name: topic.count for name, topic in BagReader(tmp_path / "bag").topics.items()} == {
        "/ankle/samples": 40
    }


def test_a_named_topic_that_nobody_publishes_is_reported_and_fails_the_recording(graph, tmp_path):
    named = "/ankle/sampels,/ankle/samples"
    recorder = graph.node("record_node", {"out": tmp_path / "bag", "topics": named})
    graph.wait_for_line(recorder, "no publisher yet of /ankle/sampels, /ankle/samples")
    output = graph.stop(recorder)
    assert recorder.returncode == 1
    assert "error: nobody published /ankle/sampels, /ankle/samples" in output
    assert BagReader(tmp_path / "bag").complete


def test_a_disk_that_fills_up_ends_the_recording_in_good_order(graph, tmp_path):
    recorder = graph.node("record_node", {"out": tmp_path / "bag", "min_free_disk": 1e6})
    output, _ = recorder.communicate(timeout=30)
    assert recorder.returncode == 1
    assert "MB free on the disk" in output
    assert "below min_free_disk = 1e+06 MB" in output
    assert "Traceback" not in output
    reader = BagReader(tmp_path / "bag")
    assert reader.complete
    assert "recording ended" in reader.custom_data["warnings"]


def test_an_existing_bag_is_refused_by_the_recorder(graph, make_bag):
    recorder = graph.node("record_node", {"out": make_bag()})
    output, _ = recorder.communicate(timeout=30)
    assert recorder.returncode == 1
    assert "nothing is overwritten unasked" in output
    assert "Traceback" not in output


def replay_into(graph, tmp_path, bag, delay, rate):
    """Replays into a reader and a recorder; returns the replay's and the reader's output and the
    new bag.
    """
    recorder = graph.node("record_node", {"out": tmp_path / "new", "use_sim_time": "true"})
    graph.wait_for_line(recorder, "ready")
    reader = graph.start("-c", READER, str(delay), "1")
    replayer = graph.node("replay_node", {"bag": bag, "rate": rate, "wait_for_readers": 2})
    output, _ = replayer.communicate(timeout=120)
    assert replayer.returncode == 0, output
    time.sleep(0.5)
    heard = graph.stop(reader)
    graph.stop(recorder)
    return output, heard, BagReader(tmp_path / "new")


def test_replay_as_fast_as_possible_loses_nothing_with_a_slow_reader(graph, make_bag, tmp_path):
    bag = make_bag(blocks=250)
    output, heard, new = replay_into(graph, tmp_path, bag, 0.008, 0.0)
    assert "replayed 500 messages" in output
    assert "reader: 250 blocks 0 findings 0 missing" in heard
    old = BagReader(bag)
    for topic in old.topics:
        assert [data for _, _, data in new.messages([topic])] == [
            data for _, _, data in old.messages([topic])
        ]
    assert np.array_equal(
        new.signal("/impedance/estimate")[1], old.signal("/ankle/samples")[1][31::32, :2]
    )
    times = [
        int.from_bytes(data[4:8], "little") * 10**9 + int.from_bytes(data[8:12], "little")
        for _, _, data in new.messages(["/clock"])
    ]
    assert len(times) > 100
    assert times == sorted(times)
    assert old.start_ns <= times[0]
    assert times[-1] <= old.end_ns


@pytest.mark.slow
def test_replay_in_real_time_twice_into_the_same_reader(graph, make_bag, tmp_path):
    bag = make_bag(blocks=40)
    reader = graph.start("-c", READER, "0.0", "0")
    for _ in range(2):
        began = time.monotonic()
        replayer = graph.node("replay_node", {"bag": bag, "rate": 1.0, "topics": "/ankle/samples"})
        output, _ = replayer.communicate(timeout=60)
        assert replayer.returncode == 0, output
        assert time.monotonic() - began > BagReader(bag).duration
    assert "reader: 80 blocks 1 findings 0 missing" in graph.stop(reader)


@pytest.mark.slow
def test_a_reader_that_stands_still_is_named(graph, make_bag):
    reader = graph.start("-c", READER, "60.0", "0")
    replayer = graph.node("replay_node", {"bag": make_bag(), "rate": 0.0, "reader_timeout": 1.0})
    output, _ = replayer.communicate(timeout=60)
    reader.kill()
    assert replayer.returncode == 1
    assert "/ankle/samples: a reader made no progress for 1 s" in output
    assert "Traceback" not in output


@pytest.mark.parametrize(
    ("parameters", "words"),
    [
        ({"bag": "BAG", "topics": "/emg/samples"}, "has no topic '/emg/samples'; it holds"),
        (
            {"bag": "BAG", "wait_timeout": 0.5},
            r"0 of 1 readers (wait_for_readers) connected within 0.5 s: none",
        ),
        ({"bag": "BAG", "rate": -1.0}, "'rate' = -1.0 is refused; allowed: 0 to 1e+06"),
    ],
)
def test_replay_that_cannot_start_says_why(graph, make_bag, parameters, words):
    bag = make_bag(blocks=3)
    replayer = graph.node(
        "replay_node",
        {name: bag if value == "BAG" else value for name, value in parameters.items()},
    )
    output, _ = replayer.communicate(timeout=40)
    assert replayer.returncode == 1
    assert words in output
    assert "Traceback" not in output


def test_replay_beside_another_source_is_refused(graph, make_bag):
    source = graph.start("-c", SOURCE, "1000", "-1")
    graph.wait_for_line(source, "source is up")
    replayer = graph.node("replay_node", {"bag": make_bag(blocks=1000), "wait_for_readers": 0})
    output, _ = replayer.communicate(timeout=40)
    graph.stop(source)
    assert replayer.returncode == 1
    assert "/ankle/samples has 2 publishers" in output


def test_recorded_type_hashes_are_those_of_the_graph(graph, tmp_path):
    """What rosbags computes is what ROS tells, so the bag need not ask."""
    program = """
import rclpy, sys
from session_recorder.message_definitions import definition
from std_msgs.msg import Float64MultiArray, String
from sensor_msgs.msg import JointState
from diagnostic_msgs.msg import DiagnosticArray
from rosgraph_msgs.msg import Clock
rclpy.init()
node = rclpy.create_node("probe")
for number, kind in enumerate((Float64MultiArray, String, JointState, DiagnosticArray, Clock)):
    node.create_publisher(kind, f"/t{number}", 1)
for topic, types in node.get_topic_names_and_types():
    stated = str(node.get_publishers_info_by_topic(topic)[0].topic_type_hash)
    print(topic, stated == definition(types[0]).type_hash)
"""
    process = graph.start("-c", program)
    output, _ = process.communicate(timeout=30)
    lines = output.split("\n")[:-1]
    assert len(lines) >= 7
    assert all(line.endswith(" True") for line in lines), output
