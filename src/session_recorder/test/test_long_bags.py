"""A bag that grows for hours takes hardly any memory, and every reader finds all of it."""

import tracemalloc

import numpy as np
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from ankle_interfaces.block import Block
from ankle_interfaces.topics import ANKLE_SAMPLES
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter

TOPICS = [f"/signal_{k}" for k in range(20)]
LARGEST_RECORD = 200.0  # bytes of memory for each chunk; the library's own index takes 2500


def write_chunks(bag, first, count):
    """Write so many chunks of one message on each topic."""
    values = np.zeros((1, len(ANKLE_SAMPLES.columns)))
    for number in range(first, first + count):
        values[0, 0] = 1.0 + number
        for topic in TOPICS:
            bag.write_block(topic, Block(ANKLE_SAMPLES.columns, values))
        bag.flush()


def test_a_chunk_leaves_little_in_memory_and_every_reader_finds_it(tmp_path):
    with BagWriter(tmp_path / "bag") as bag:
        for topic in TOPICS:
            bag.add_topic(topic, ANKLE_SAMPLES.message)
        write_chunks(bag, 0, 100)
        tracemalloc.start()
        before = tracemalloc.get_traced_memory()[0]
        write_chunks(bag, 100, 1000)
        grown = tracemalloc.get_traced_memory()[0] - before
        tracemalloc.stop()
    assert grown / 1000 < LARGEST_RECORD
    reader = BagReader(tmp_path / "bag")
    assert reader.complete
    assert len(list(reader.messages([TOPICS[7]]))) == 1100
    with next((tmp_path / "bag").glob("*.mcap")).open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert len(summary.chunk_indexes) == 1100
        assert all(len(one.message_index_offsets) == 20 for one in summary.chunk_indexes)
    with AnyReader([tmp_path / "bag"]) as other:
        assert {c.msgcount for c in other.connections} == {1100}
