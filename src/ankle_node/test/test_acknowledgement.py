"""A publisher begins once its readers have found it, and not when it has found them alone."""

import time

import pytest
import rclpy
from std_msgs.msg import Float64MultiArray

from ankle_interfaces.topics import IMPEDANCE_ESTIMATE
from ankle_node import node
from ankle_node.block_executor import BlockExecutor
from ankle_node.node import AnkleNode
from ankle_node.qos import BLOCK_QOS

pytestmark = [pytest.mark.live, pytest.mark.untimed]
PATIENCE = 10.0  # s
QUIET_TIME = 1.0  # s


class Bench:
    """A publisher that waits for one reader, and an executor for each node."""

    def __init__(self):
        self.publisher = AnkleNode("publisher", ())
        self.reader = AnkleNode("reader", ())
        self.executors = {}
        for member in (self.publisher, self.reader):
            self.executors[member] = BlockExecutor()
            self.executors[member].add_node(member)
        self.begun = False
        self.publisher.block_publisher(IMPEDANCE_ESTIMATE)
        self.publisher.when_read(IMPEDANCE_ESTIMATE, 1, self._begin)

    def _begin(self):
        self.begun = True

    def spin(self, members, seconds):
        deadline = time.monotonic() + seconds
        while time.monotonic() < deadline and not self.begun:
            for member in members:
                self.executors[member].spin_once(timeout_sec=0.02)


@pytest.fixture
def bench():
    rclpy.init()
    made = Bench()
    yield made
    for executor in made.executors.values():
        executor.shutdown()
    made.publisher.destroy_node()
    made.reader.destroy_node()
    rclpy.try_shutdown()


def test_publisher_waits_until_its_reader_has_found_it(bench):
    bench.reader.block_subscription(IMPEDANCE_ESTIMATE, lambda block, findings: None)
    # The reader's process does not run: it is connected, and does not say so.
    bench.spin([bench.publisher], QUIET_TIME)
    assert bench.publisher.count_subscribers("impedance/estimate") == 1
    assert not bench.begun
    bench.spin([bench.publisher, bench.reader], PATIENCE)
    assert bench.begun


def test_a_greeting_that_never_comes_is_not_waited_for_for_ever(bench, monkeypatch):
    monkeypatch.setattr(node, "GREETING_PATIENCE", 2.0 * QUIET_TIME)
    bench.reader.block_subscription(IMPEDANCE_ESTIMATE, lambda block, findings: None)
    bench.spin([bench.publisher], QUIET_TIME)
    assert not bench.begun
    bench.spin([bench.publisher], PATIENCE)
    assert bench.begun


def test_publisher_does_not_wait_for_a_greeting_of_others(bench):
    bench.reader.create_subscription(
        Float64MultiArray, "impedance/estimate", lambda message: None, BLOCK_QOS
    )
    bench.spin([bench.publisher], PATIENCE)
    assert bench.begun
