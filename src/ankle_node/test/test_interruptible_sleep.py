"""A sleep by a node's clock leaves nothing behind, and ends when it is interrupted."""

import threading
import time

import pytest
import rclpy
from rclpy.context import Context

from ankle_node.interruptible_sleep import InterruptibleSleep

pytestmark = [pytest.mark.live, pytest.mark.untimed]

SLEEPS = 50
SLEEP_DURATION = 60.0  # s


@pytest.fixture
def node():
    context = Context()
    rclpy.init(context=context)
    node = rclpy.create_node("sleeper", context=context)
    yield node
    node.destroy_node()
    context.try_shutdown()


def now(node):
    return node.get_clock().now().nanoseconds * 1e-9


def test_a_sleep_lasts_until_its_time_and_leaves_no_callback(node):
    sleep = InterruptibleSleep(node)
    before = len(node.context._callbacks)
    begun = now(node)
    for number in range(SLEEPS):
        sleep.until(begun + 0.002 * (number + 1))
    assert now(node) >= begun + 0.002 * SLEEPS
    assert len(node.context._callbacks) == before


@pytest.mark.parametrize("end", ["interruption", "shutdown"])
def test_a_long_sleep_ends_at_once(node, end):
    sleep = InterruptibleSleep(node)
    thread = threading.Thread(target=sleep.until, args=(now(node) + SLEEP_DURATION,))
    thread.start()
    time.sleep(0.2)
    assert thread.is_alive()
    if end == "interruption":
        sleep.interrupt()
    else:
        node.context.shutdown()
    thread.join(timeout=5.0)
    assert not thread.is_alive()
    begun = time.monotonic()
    sleep.until(SLEEP_DURATION + time.time())
    assert time.monotonic() - begun < 1.0
