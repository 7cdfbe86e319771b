"""One account of loss: the recorder's numbers, the bag's and the truth are the same."""

import numpy as np
import pytest

from ankle_interfaces.block import Block, pack
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.loss import LossAccount, account_of_bag
from session_recorder.message_numbers import MessageNumbers
from session_recorder.recording import Recording
from session_recorder.sample_account import SampleAccount

TOPIC = "/ankle/samples"
DIAGNOSTICS = "/diagnostics"


def account(bag):
    return account_of_bag(BagReader(bag))


def counted(numbers, block):
    """The account of blocks that arrive in the order of `numbers`."""
    held = SampleAccount()
    for number in numbers:
        held.add(block(number))
    return held


@pytest.mark.parametrize(
    ("numbers", "missing", "late", "repeated"),
    [
        (range(10), 0, 0, 0),
        ([0, 1, 4, 5], 64, 0, 0),
        ([0, 1, 3, 2, 4, 5], 0, 32, 0),
        ([0, 1, 1, 2, 3], 0, 0, 32),
        ([0, 1, 4, 2, 2, 5, 7], 64, 32, 32),
        ([0, 3, 3, 2, 1, 4], 0, 64, 32),
    ],
)
def test_lost_late_and_repeated_blocks_are_told_apart(numbers, missing, late, repeated, block):
    held = counted(numbers, block)
    assert (held.missing, held.late, held.repeated) == (missing, late, repeated)
    assert held.samples == 32 * len(set(numbers))
    assert bool(held.sentences(TOPIC, 0.0)) == bool(missing or late or repeated)


def test_any_order_of_blocks_is_counted_as_it_was(block):
    random = np.random.default_rng(11)
    for _ in range(300):
        kept = np.array([0, *(np.flatnonzero(random.uniform(size=58) > 0.15) + 1), 59])
        # Each block is late by at most one second, as the queues allow.
        arrival = kept + random.integers(0, 20, size=len(kept)) * (
            random.uniform(size=len(kept)) < 0.1
        )
        arrival[0], arrival[-1] = -1, 100
        order = [int(kept[k]) for k in np.argsort(arrival, kind="stable")]
        for doubled in random.choice(order[1:-1], size=int(random.integers(0, 5))):
            order.insert(order.index(doubled) + 1, int(doubled))
        held = counted(order, block)
        assert held.missing == 32 * (60 - len(np.unique(kept)))
        assert held.repeated == 32 * (len(order) - len(set(order)))


def test_a_clock_that_is_set_back_is_no_repetition(block):
    held = counted([1000, 1001, 0, 1, 3], block)
    assert held.repeated == 0
    assert held.missing == 32
    assert "set back by 15." in " ".join(held.sentences(TOPIC, 1000.0))


def test_samples_of_two_sources_are_named(block):
    held = SampleAccount()
    for number in range(40):
        held.add(block(number))
        held.add(block(number, start=1000.0007))
    assert held.mixed
    assert "two nodes publish" in " ".join(held.sentences(TOPIC, 1000.0))


def test_what_the_recorder_says_is_what_the_bag_shows(tmp_path, block):
    random = np.random.default_rng(3)
    recording = Recording(tmp_path / "bag")
    recording.add_topic(TOPIC, "std_msgs/msg/Float64MultiArray", ())
    numbers = [0, *(np.flatnonzero(random.uniform(size=200) > 0.2) + 1), 201]
    numbers[20:22] = numbers[21:19:-1]
    live = []
    for at, number in enumerate(numbers):
        live += recording.write(TOPIC, at, pack(block(number)))
    missing = 32 * (202 - len(numbers))
    assert recording.account.missing == missing
    assert live
    recording.close()
    shown = account(tmp_path / "bag")
    assert shown.figures() == recording.account.figures()
    assert shown.sentences() == recording.account.sentences()
    assert BagReader(tmp_path / "bag").custom_data["missing_samples"] == str(missing)
    assert f"{missing} samples missing" in recording.summary()


def test_places_are_stated_in_seconds_of_the_recording(tmp_path, block):
    with BagWriter(tmp_path / "bag") as writer:
        writer.add_topic(TOPIC)
        for number in (*range(64), *range(188, 200)):
            writer.write_block(TOPIC, block(number))
    (sentence,) = account(tmp_path / "bag").sentences()
    assert sentence == (
        "/ankle/samples: 3968 samples (1.938 s) are missing in 1 gap: 3968 at 1.000 s"
    )


def test_a_measured_signal_that_ends_early_is_reported(tmp_path, block):
    with BagWriter(tmp_path / "bag") as writer:
        for topic, blocks in ((TOPIC, 64), ("/perturbation/reference", 400)):
            writer.add_topic(topic)
            for number in range(blocks):
                writer.write_block(topic, block(number))
    (sentence,) = account(tmp_path / "bag").sentences()
    assert "/ankle/samples: ends 5.2 s before" in sentence


def test_values_that_are_not_finite_are_counted_by_column(block):
    one = block(0)
    data = one.data.copy()
    data[3:7, 2] = np.nan
    held = SampleAccount()
    held.add(Block(one.columns, data))
    assert held.not_finite == {"torque[N.m]": 4}


def test_a_killed_and_a_damaged_recording_say_so(make_bag):
    path = make_bag()
    file = next(path.glob("*.mcap"))
    content = bytearray(file.read_bytes())
    content[len(content) // 3] ^= 0xFF
    file.write_bytes(content[: len(content) // 2])
    (path / "metadata.yaml").unlink()
    sentences = " ".join(account(path).sentences())
    assert "metadata.yaml is missing" in sentences
    assert "after a killed recorder" in sentences


def numbers_of(*given, publishers=("a",)):
    held = MessageNumbers()
    held.set_publishers(publishers)
    for at, number in enumerate(given):
        held.add(number, 0.1 * at)
    return held


def test_messages_of_one_publisher_are_counted_once_the_graph_has_settled():
    held = numbers_of(5, 6, 9, 10)
    assert held.settle(0.5) == 0
    assert held.settle(5.0) == 2
    assert held.settle(9.0) == 0
    assert held.lost == 2
    # A publisher that starts anew begins with 1.
    assert numbers_of(5, 6, 1, 2).settle(9.0) == 0


def test_several_publishers_of_diagnostics_are_no_loss():
    # A second node counts for itself; the graph shows it a moment after its first message.
    held = numbers_of(5, 90, 6, 91, 7, 92)
    held.set_publishers(("a", "b"))
    assert held.settle(9.0) == 0
    assert held.lost == 0
    # One that takes the other's place.
    held = numbers_of(5, 6, 90)
    held.set_publishers(("c",))
    assert held.settle(9.0) == 0


def test_lost_messages_are_stored_with_the_bag(tmp_path):
    recording = Recording(tmp_path / "bag")
    recording.add_topic(DIAGNOSTICS, "std_msgs/msg/String", ())
    recording.set_publishers(DIAGNOSTICS, {"1": "/a"})
    for number in (5, 6, 9):
        recording.write(DIAGNOSTICS, number, b"\x00\x01\x00\x00\x00\x00\x00\x00", None, number)
    recording.close()
    assert "0 samples missing, 2 messages lost" in recording.summary()
    assert account(tmp_path / "bag").lost_messages == {DIAGNOSTICS: 2}
    assert "2 message(s) were lost" in account(tmp_path / "bag").sentences()[0]


def test_two_publishers_of_a_signal_are_named(tmp_path, block):
    recording = Recording(tmp_path / "bag")
    recording.add_topic(TOPIC, "std_msgs/msg/Float64MultiArray", ())
    recording.write(TOPIC, 1, pack(block(0)))
    assert recording.set_publishers(TOPIC, {"1": "/rig"}) is None
    # A graph may know a node before its name.
    assert "/?, /rig" in recording.set_publishers(TOPIC, {"1": "/rig", "2": "/?"})
    for _ in range(2):
        assert "/rig, /sim" in recording.set_publishers(TOPIC, {"1": "/rig", "2": "/sim"})
    assert len([sentence for sentence in recording.warnings if "/sim" in sentence]) == 1
    assert recording.set_publishers(TOPIC, {"1": "/rig"}) is None
    recording.close()


def test_topics_that_are_written_one_after_the_other_lose_nothing(tmp_path):
    time = np.arange(60 * 2048) / 2048.0
    noise = np.random.default_rng(1).normal(size=(len(time), 3))  # does not compress: many chunks
    whole = np.column_stack([time, noise])
    columns = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")
    with BagWriter(tmp_path / "bag") as writer:
        for topic in ("/perturbation/reference", TOPIC):
            writer.add_topic(topic)
            for first in range(0, len(time), 512):
                writer.write_block(topic, Block(columns, whole[first : first + 512]))
    found = account(tmp_path / "bag")
    assert found.missing == 0
    assert found.sentences() == []


def test_an_empty_account_says_nothing():
    assert LossAccount().sentences() == []


def test_irregular_sampling_is_named_and_no_loss():
    time = 1000 + np.cumsum(np.random.default_rng(1).uniform(0.3e-3, 1.7e-3, 200_000))
    time[100_000:] += 1.0
    held = SampleAccount()
    for first in range(0, len(time), 32):
        held.add(Block(("t[s]",), time[first : first + 32, None]))
    assert held.irregular
    assert held.repeated == 0
    assert held.missing == pytest.approx(1000, rel=0.25)
    assert "the sampling is irregular" in " ".join(held.sentences(TOPIC, 1000.0))
