"""The graph as a replay sees it: publishers of the recorded topics, and how far the readers are."""

from __future__ import annotations

import importlib
import time
from collections.abc import Collection
from dataclasses import dataclass

from rclpy.duration import Duration
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.time import Time
from rosgraph_msgs.msg import Clock as ClockMessage
from std_msgs.msg import String

from ankle_interfaces.block import MESSAGE_TYPE
from ankle_interfaces.topics import CLOCK
from ankle_node.acknowledgement import (
    ACKNOWLEDGEMENT_SUFFIX,
    EVERY_READER_QOS,
    read_acknowledgement,
)
from ankle_node.qos import publisher_qos
from ankle_node.sources import publishers, readers
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError
from session_recorder.flow_control import Flow
from session_recorder.replaying import ROS_TOPICS
from session_recorder.ros_qos import to_replay

POLL_PERIOD = 0.05
"""[s] Between two looks at what the readers have acknowledged."""


@dataclass(frozen=True)
class Connections:
    """Holds who reads the replayed topics.

    Attributes
    ----------
    nodes
        Full names of the nodes that read.
    open_links
        Links that are not up yet.
    silent
        Readers that are not known to report how far they are.
    """

    nodes: frozenset[str]
    open_links: int
    silent: int


class GraphOutlet:
    """Publishes recorded messages as they were recorded, and hears the readers; an `Outlet`.

    Parameters
    ----------
    node
        The node that publishes.
    bag
        The bag that is replayed.
    chosen
        Its topics that are sent.

    Attributes
    ----------
    flows
        Of the topics of blocks, by name.
    """

    def __init__(self, node: Node, bag: BagReader, chosen: Collection[str]) -> None:
        self._node, self._bag = node, bag
        self._senders = {name: self._sender(name) for name in chosen}
        self._clock_sender = node.create_publisher(ClockMessage, CLOCK.name, publisher_qos(CLOCK))
        self.flows = {name: Flow(0) for name in chosen if bag.topics[name].type == MESSAGE_TYPE}
        for name in self.flows:
            self._listen(name)

    def _sender(self, name: str) -> Publisher:
        package, _, kind = self._bag.topics[name].type.split("/")
        try:
            message_class = getattr(importlib.import_module(f"{package}.msg"), kind)
        except (ImportError, AttributeError) as error:
            raise BagError(
                f"{name}: this installation cannot send '{package}/msg/{kind}': {error}"
            ) from None
        # In a namespace the laboratory's topics are those of the namespace.
        in_graph = name if name in ROS_TOPICS else name.lstrip("/")
        return self._node.create_publisher(
            message_class, in_graph, to_replay(self._bag.topics[name].qos)
        )

    def _acknowledged_topic(self, name: str) -> str:
        return str(self._senders[name].topic_name) + ACKNOWLEDGEMENT_SUFFIX

    def _listen(self, name: str) -> None:
        def receive(message: String) -> None:
            self.flows[name].acknowledged(*read_acknowledgement(message))

        self._node.create_subscription(
            String, self._acknowledged_topic(name), receive, EVERY_READER_QOS
        )

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
            self.flows[topic].readers if topic in self.flows else 0
        ):
            return True
        deadline = time.monotonic() + patience
        while not self._senders[topic].wait_for_all_acked(Duration(seconds=POLL_PERIOD)):
            if time.monotonic() > deadline or not self._node.context.ok():
                return False
        return True

    def connections(self) -> Connections:
        """Return who reads the topics now."""
        nodes: set[str] = set()
        missing = silent = 0
        for name, sender in self._senders.items():
            names = readers(self._node, sender.topic_name)
            nodes.update(names)
            missing += max(0, len(names) - sender.get_subscription_count())
            if name in self.flows:
                reporting = self._node.count_publishers(self._acknowledged_topic(name))
                silent += max(0, len(names) - reporting)
        return Connections(frozenset(nodes), missing, silent)

    def settle(self) -> list[str]:
        """Wait from now on for the readers that report how far they are.

        Returns
        -------
        list[str]
            A sentence for each topic with readers that do not.
        """
        sentences = []
        for name, flow in self.flows.items():
            sender = self._senders[name]
            flow.readers = self._node.count_publishers(self._acknowledged_topic(name))
            silent = sender.get_subscription_count() - flow.readers
            if silent > 0:
                sentences.append(
                    f"{silent} reader(s) of {sender.topic_name} do not tell how far they are and "
                    "may lose blocks at this rate"
                )
        return sentences

    def refuse_second_source(self) -> None:
        """Check that nobody else publishes the topics.

        Raises
        ------
        BagError
            Somebody does.
        """
        for sender in self._senders.values():
            names = publishers(self._node, sender.topic_name)
            if len(names) > 1:
                raise BagError(
                    f"{sender.topic_name} has {len(names)} publishers ({', '.join(names)}); two "
                    "sources would mix in its readers"
                )
