"""A reader of blocks keeps what comes at once after a publisher was held up."""

import time

import numpy as np
import pytest
import rclpy
from std_msgs.msg import Float64MultiArray

from ankle_interfaces.block import Block, pack, unpack
from ankle_interfaces.topics import ANKLE_SAMPLES
from ankle_node.block_executor import BlockExecutor
from ankle_node.qos import publisher_qos, reader_qos

pytestmark = [pytest.mark.live, pytest.mark.untimed]
LONGEST_HOLD_UP = (
    3.0  # s; the longest for which the faults of `make faults` hold a process up, and more
)
BLOCK, RATE = 32, 2048.0


@pytest.fixture
def node():
    context = rclpy.Context()
    rclpy.init(context=context)
    made = rclpy.create_node("reader", context=context)
    yield made
    made.destroy_node()
    context.try_shutdown()


def test_a_reader_that_did_not_get_to_run_has_all_blocks_of_a_publisher_that_was_held_up(node):
    received = []
    name = ANKLE_SAMPLES.name
    node.create_subscription(
        Float64MultiArray,
        name,
        lambda data: received.append(unpack(data).data[0, 0]),
        reader_qos(ANKLE_SAMPLES),
        raw=True,
    )
    publisher = node.create_publisher(Float64MultiArray, name, publisher_qos(ANKLE_SAMPLES))
    deadline = time.monotonic() + 10.0
    while not publisher.get_subscription_count():
        assert time.monotonic() < deadline
        time.sleep(0.01)
    first = np.arange(round(LONGEST_HOLD_UP * RATE / BLOCK)) * BLOCK / RATE
    for begin in first:
        time_of_samples = begin + np.arange(BLOCK) / RATE
        data = np.column_stack([time_of_samples, np.zeros((BLOCK, 3))])
        publisher.publish(pack(Block(ANKLE_SAMPLES.columns, data)))
    time.sleep(0.5)  # a computer that gives its cores to others
    executor = BlockExecutor(context=node.context)
    executor.add_node(node)
    while len(received) < len(first) and time.monotonic() < deadline:
        executor.spin_once(timeout_sec=0.1)
    executor.shutdown()
    assert received == first.tolist()
