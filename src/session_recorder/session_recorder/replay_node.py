"""Replays a bag to the graph.

| topic | direction | type | what |
| --- | --- | --- | --- |
| the recorded inputs, or those of `topics` | out | as recorded | as recorded, with the recorded QoS |
| /clock | out | Clock | the log time of what is sent, never backwards |
| TOPIC/_acknowledged | in | String | how far each reader of blocks has got |
| /diagnostics | out | DiagnosticArray | messages sent, delay |

Parameters: `session_recorder.parameters`. Rename topics with ROS's own remapping (``-r
/ankle/samples:=/old/samples``). At any `rate` at most `flow_control.WINDOW` blocks of a topic are
ahead of the slowest reader made by `AnkleNode.block_subscription`, so that nothing is lost; of
other readers DDS reports only that their queue has the message, so give them a rate that they follow.
Ends with 0 when every reader acknowledged everything.
"""  # noqa: E501

from __future__ import annotations

import importlib
import sys
import threading
import time
from collections.abc import Sequence

from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException
from rclpy.publisher import Publisher
from rclpy.qos import QoSHistoryPolicy, QoSProfile
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage
from std_msgs.msg import String

from ankle_interfaces.block import MESSAGE_TYPE
from ankle_interfaces.topics import CLOCK
from ankle_node.node import ACKNOWLEDGED, LATEST_QOS, WARN, AnkleNode, run
from ankle_node.qos import publisher_qos
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError
from session_recorder.flow_control import Flow
from session_recorder.parameters import REPLAYER
from session_recorder.replaying import OWN_OF_ROS, Replay, choose_topics
from session_recorder.ros_qos import to_replay

PROGRESS_PERIOD = 2.0  # s
# s in which both ends of a connection find each other (localhost: a few ms; longer on a busy
# machine)
SETTLING = 1.0
POLL = 0.05  # s
LATE = 0.5  # s behind the asked rate before it is reported


PARAMETERS = REPLAYER


class ReplayNode(AnkleNode):
    """Sends a bag from a thread of its own, while the executor hears how far the readers are."""

    def __init__(self) -> None:
        super().__init__("replayer", PARAMETERS)
        if not self.text("bag"):
            raise BagError("parameter 'bag' is missing: the bag to replay")
        self._reader = BagReader(self.text("bag"))
        for problem in self._reader.problems:
            self._warn(problem)
        self._chosen = choose_topics(self._reader, self.text("topics"))
        self._senders = {name: self._sender(name) for name in self._chosen}
        self._clock_sender = self.create_publisher(ClockMessage, CLOCK.name, publisher_qos(CLOCK))
        self._flows = {
            name: Flow(0) for name in self._chosen if self._reader.topics[name].type == MESSAGE_TYPE
        }
        for name in self._flows:
            self._listen(name)
        self._replay = Replay(
            self._reader,
            self._chosen,
            self.number("rate"),
            self._flows,
            self,
            self.number("reader_timeout"),
            self.context.ok,
        )
        self.error: str | None = None
        self.finished = False
        self._shown = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="replay", daemon=True)
        self._thread.start()
        self.create_timer(POLL, self._watch, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _sender(self, name: str) -> Publisher:
        package, _, kind = self._reader.topics[name].type.split("/")
        try:
            message_class = getattr(importlib.import_module(f"{package}.msg"), kind)
        except (ImportError, AttributeError) as error:
            raise BagError(
                f"{name}: this installation cannot send '{package}/msg/{kind}': {error}"
            ) from None
        # In a namespace the laboratory's topics are those of the namespace.
        in_graph = name if name in OWN_OF_ROS else name.lstrip("/")
        return self.create_publisher(
            message_class, in_graph, to_replay(self._reader.topics[name].qos)
        )

    def _acknowledged_topic(self, name: str) -> str:
        return str(self._senders[name].topic_name) + ACKNOWLEDGED

    def _listen(self, name: str) -> None:
        def receive(message: String) -> None:
            reader, _, stamp = message.data.rpartition(" ")
            self._flows[name].acknowledged(reader, int(stamp))

        qos = QoSProfile(
            history=QoSHistoryPolicy.KEEP_ALL,
            reliability=LATEST_QOS.reliability,
            durability=LATEST_QOS.durability,
        )
        self.create_subscription(String, self._acknowledged_topic(name), receive, qos)

    def send(self, topic: str, message: bytes) -> None:
        """Publish a recorded message."""
        self._senders[topic].publish(message)

    def clock(self, now_ns: int) -> None:
        """Publish the bag's time on /clock."""
        self._clock_sender.publish(ClockMessage(clock=Time(nanoseconds=now_ns).to_msg()))

    def delivered(self, topic: str, patience: float) -> bool:
        """Return whether the readers' queues take everything within `patience` [s].

        The queues are not asked where every reader reports what it has processed.
        """
        if self._senders[topic].get_subscription_count() <= (
            self._flows[topic].readers if topic in self._flows else 0
        ):
            return True
        deadline = time.monotonic() + patience
        while not self._senders[topic].wait_for_all_acked(Duration(seconds=POLL)):
            if time.monotonic() > deadline or not self.context.ok():
                return False
        return True

    def _run(self) -> None:
        try:
            self._wait_for_readers()
            self.finished = self._replay.run()
        except Exception as error:  # the thread must not end unheard
            if self.context.ok():
                self.error = (
                    str(error)
                    if isinstance(error, BagError)
                    else f"{type(error).__name__}: {error}"
                )

    def _wait_for_readers(self) -> None:
        needed, patience = int(self.number("wait_for_readers")), self.number("wait_timeout")
        deadline = time.monotonic() + patience
        before, since = None, time.monotonic()
        while self.context.ok():
            state = self._connections()
            nodes, open_links = state[0], state[1]
            if state != before or open_links or len(nodes) < needed:
                before, since = state, time.monotonic()
            elif time.monotonic() - since > SETTLING:
                break
            if time.monotonic() > deadline:
                names = ", ".join(sorted(nodes)) or "none"
                raise BagError(
                    f"{len(nodes)} of {needed} readers (wait_for_readers) connected within "
                    f"{patience:g} s: {names}"
                )
            time.sleep(POLL)
        self._refuse_second_source()
        for name, sender in self._senders.items():
            if name in self._flows:
                self._flows[name].readers = self.count_publishers(self._acknowledged_topic(name))
                silent = sender.get_subscription_count() - self._flows[name].readers
                if silent > 0:
                    self._warn(
                        f"{silent} reader(s) of {sender.topic_name} do not tell how far they are "
                        "and may lose blocks at this rate"
                    )

    def _refuse_second_source(self) -> None:
        for sender in self._senders.values():
            sources = self.get_publishers_info_by_topic(sender.topic_name)
            if len(sources) > 1:
                names = ", ".join(sorted(info.node_name for info in sources))
                raise BagError(
                    f"{sender.topic_name} has {len(sources)} publishers ({names}); two sources "
                    "would mix in its readers"
                )

    def _warn(self, sentence: str) -> None:
        self.get_logger().warning(sentence)
        self.health("replay", WARN, sentence)

    def _connections(self) -> tuple[frozenset[str], int, int]:
        """Return names of the nodes that read, links that are not up yet, and readers that tell how
        far they are.
        """
        nodes: set[str] = set()
        missing = telling = 0
        for name, sender in self._senders.items():
            readers = self.get_subscriptions_info_by_topic(sender.topic_name)
            nodes |= {f"{info.node_namespace.rstrip('/')}/{info.node_name}" for info in readers}
            missing += max(0, len(readers) - sender.get_subscription_count())
            if name in self._flows:
                telling += self.count_publishers(self._acknowledged_topic(name))
        return frozenset(nodes), missing, telling

    def _watch(self) -> None:
        self.count("messages sent", self._replay.sent)
        if self._replay.behind > LATE:
            self.health(
                "pace",
                WARN,
                f"up to {self._replay.behind:.1f} s late: the readers do not follow at this rate",
            )
        self._refuse_second_source()
        if time.monotonic() - self._shown > PROGRESS_PERIOD:
            self._shown = time.monotonic()
            self.get_logger().info(
                f"replayed {self._replay.elapsed:.1f} of {self._reader.duration:.1f} s"
            )
        if not self._thread.is_alive():
            if self.error is not None:
                raise BagError(self.error)
            if self.finished:
                print(
                    f"replayed {self._replay.sent} messages of {self._reader.path}, every one "
                    "acknowledged",
                    flush=True,
                )
            raise ExternalShutdownException

    def destroy_node(self) -> None:
        """Let the sending thread end first."""
        self.context.try_shutdown()
        self._thread.join(timeout=PROGRESS_PERIOD)
        super().destroy_node()


def main(arguments: Sequence[str] | None = None) -> int:
    """Start the node: the entry point of ``ros2 run session_recorder replay``.

    It returns 0 only when everything was delivered.
    """
    made: list[ReplayNode] = []

    def make() -> ReplayNode:
        made.append(ReplayNode())
        return made[0]

    return run(make, arguments) or int(not all(node.finished for node in made))


if __name__ == "__main__":
    sys.exit(main())
