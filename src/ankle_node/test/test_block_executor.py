"""The executor of every node does what rclpy's own one does, with real publishers and services."""

import threading
import time

import pytest
import rclpy
from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ankle_node.block_executor import LARGEST_BATCH, BlockExecutor
from ankle_node.qos import BLOCK_QOS

pytestmark = [pytest.mark.live, pytest.mark.untimed]
PATIENCE = 10.0  # s


class Bench:
    """One node, spun by the executor under test."""

    def __init__(self):
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("bench", context=self.context)
        self.executor = BlockExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.heard = []

    def until(self, condition):
        deadline = time.monotonic() + PATIENCE
        while not condition():
            assert time.monotonic() < deadline, f"not reached; heard: {self.heard}"
            self.executor.spin_once(timeout_sec=0.05)

    def publisher(self):
        """A publisher of text that somebody hears."""
        publisher = self.node.create_publisher(String, "text", BLOCK_QOS)
        self.until(lambda: publisher.get_subscription_count())
        return publisher

    def hear(self, message):
        self.heard.append(message.data)


@pytest.fixture
def bench():
    made = Bench()
    yield made
    made.executor.shutdown()
    made.node.destroy_node()
    made.context.try_shutdown()


def test_messages_arrive_in_order_with_their_info_where_the_callback_takes_it(bench):
    numbers = []
    bench.node.create_subscription(String, "text", bench.hear, BLOCK_QOS)
    bench.node.create_subscription(
        String,
        "text",
        lambda data, info: numbers.append((len(data), info["source_timestamp"])),
        BLOCK_QOS,
        raw=True,
    )
    publisher = bench.publisher()
    for number in range(20):
        publisher.publish(String(data=f"{number}"))
    bench.until(lambda: len(bench.heard) == len(numbers) == 20)
    assert bench.heard == [f"{number}" for number in range(20)]
    assert [stamp for _, stamp in numbers] == sorted(stamp for _, stamp in numbers)


def test_a_backlog_leaves_the_others_their_turn(bench):
    """A timer that is due runs before the backlog of a subscription is through."""
    bench.node.create_subscription(String, "text", bench.hear, BLOCK_QOS)
    publisher = bench.publisher()
    for number in range(4 * LARGEST_BATCH):
        publisher.publish(String(data=f"{number}"))
    steady = Clock(clock_type=ClockType.STEADY_TIME)
    timer = bench.node.create_timer(1e-3, lambda: bench.heard.append("timer"), clock=steady)
    time.sleep(5e-3)  # the timer is due
    bench.until(lambda: len(bench.heard) - bench.heard.count("timer") == 4 * LARGEST_BATCH)
    timer.cancel()
    assert "timer" in bench.heard[: LARGEST_BATCH + 2]


def test_a_cancelled_or_destroyed_timer_is_not_called(bench):
    first = bench.node.create_timer(0.01, lambda: (bench.heard.append("first"), first.cancel()))
    second = bench.node.create_timer(0.01, lambda: bench.heard.append("second"))
    bench.until(lambda: bench.heard.count("second") > 5)
    assert bench.heard.count("first") == 1
    bench.node.destroy_timer(second)
    bench.heard.clear()
    for _ in range(5):
        bench.executor.spin_once(timeout_sec=0.02)
    assert bench.heard == []


def test_a_subscription_made_and_destroyed_in_another_thread_is_noticed_while_it_waits(bench):
    made = []

    def make():
        time.sleep(0.2)
        made.append(bench.node.create_subscription(String, "text", bench.hear, BLOCK_QOS))

    thread = threading.Thread(target=make)
    thread.start()
    publisher = bench.publisher()
    thread.join()
    publisher.publish(String(data="one"))
    bench.until(lambda: bench.heard == ["one"])
    thread = threading.Thread(target=lambda: bench.node.destroy_subscription(made[0]))
    thread.start()
    thread.join()
    bench.until(lambda: not publisher.get_subscription_count())
    publisher.publish(String(data="two"))
    for _ in range(5):
        bench.executor.spin_once(timeout_sec=0.02)
    assert bench.heard == ["one"]


def test_a_guard_condition_of_another_thread_ends_the_wait(bench):
    guard = bench.node.create_guard_condition(lambda: bench.heard.append("guard"))
    bench.executor.spin_once(timeout_sec=0.0)
    timer = threading.Timer(0.2, guard.trigger)
    began = time.monotonic()
    timer.start()
    while not bench.heard and time.monotonic() < began + PATIENCE:
        bench.executor.spin_once(timeout_sec=PATIENCE)
    assert time.monotonic() - began < PATIENCE / 2


def test_a_service_that_waits_holds_up_neither_messages_nor_another_service(bench):
    """An arming waits for the rig, and a stop comes meanwhile."""
    released = threading.Event()

    class Turn:
        def __await__(self):
            yield

    async def slow(request, response):
        while not released.is_set():
            await Turn()
        response.success = True
        return response

    def quick(request, response):
        response.success = True
        return response

    group = ReentrantCallbackGroup()
    bench.node.create_service(Trigger, "slow", slow, callback_group=group)
    bench.node.create_service(Trigger, "quick", quick, callback_group=group)
    bench.node.create_subscription(String, "text", bench.hear, BLOCK_QOS, callback_group=group)
    clients = [
        bench.node.create_client(Trigger, name, callback_group=group) for name in ("slow", "quick")
    ]
    bench.until(lambda: all(client.service_is_ready() for client in clients))
    first = clients[0].call_async(Trigger.Request())
    bench.executor.spin_once(timeout_sec=0.1)
    second = clients[1].call_async(Trigger.Request())
    bench.publisher().publish(String(data="meanwhile"))
    bench.until(lambda: second.done() and bench.heard)
    assert not first.done()
    released.set()
    bench.until(first.done)
    assert first.result().success


@pytest.mark.parametrize("kind", ["message", "timer", "guard", "service"])
def test_what_a_callback_raises_leaves_the_executor(bench, kind):
    def fail(*given):
        raise ValueError(kind)

    if kind == "message":
        bench.node.create_subscription(String, "text", fail, BLOCK_QOS)
        publisher = bench.node.create_publisher(String, "text", BLOCK_QOS)
        publisher.publish(String(data=""))
    elif kind == "timer":
        bench.node.create_timer(0.01, fail)
    elif kind == "guard":
        bench.node.create_guard_condition(fail).trigger()
    else:
        bench.node.create_service(Trigger, "fails", fail)
        client = bench.node.create_client(Trigger, "fails")
        bench.until(client.service_is_ready)
        client.call_async(Trigger.Request())
    with pytest.raises(ValueError, match=kind):
        bench.until(lambda: False)


def test_the_wait_has_an_end_and_a_context_that_is_shut_down_is_an_error(bench):
    bench.executor.spin_once(timeout_sec=0.0)
    began = time.monotonic()
    bench.executor.spin_once(timeout_sec=0.2)
    assert time.monotonic() - began < PATIENCE / 2
    threading.Timer(0.1, bench.context.shutdown).start()
    with pytest.raises(ExternalShutdownException):
        bench.until(lambda: False)


def test_nothing_is_called_after_a_callback_has_shut_the_context_down(bench):
    def end():
        bench.heard.append("end")
        bench.context.try_shutdown()

    for _ in range(2):  # both are due at once
        bench.node.create_timer(0.05, end)
    time.sleep(0.1)
    with pytest.raises(ExternalShutdownException):
        bench.until(lambda: False)
    assert bench.heard == ["end"]
