"""Readers tell the publisher of a block topic that they are connected, and how far they are.

DDS confirms that a message reached the reader's queue, not that the reader got to it: a replay at
full speed would overrun that queue. And a publisher may know a reader that does not know it
yet (each end finds the other by itself, on a busy computer seconds apart): what it sends until then
is lost. So a reader says on a topic of its own who it is, and when the message was sent that it got
to [ns]; 0 says that it has found the publisher.
"""

from __future__ import annotations

import os
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.node import Node
from rclpy.qos import QoSHistoryPolicy, QoSProfile
from std_msgs.msg import String

from ankle_node.qos import LATEST_QOS

ACKNOWLEDGEMENT_SUFFIX = "/_acknowledged"
"""Ending of the name of a topic's acknowledgements; the underscore hides it from ``ros2 topic
list``."""
GREETING = 0
"""[ns] Time in a greeting: no message was sent then."""
EVERY_READER_QOS = QoSProfile(
    history=QoSHistoryPolicy.KEEP_ALL,
    reliability=LATEST_QOS.reliability,
    durability=LATEST_QOS.durability,
)
"""Profile of who hears the acknowledgements: the last one of one reader must not drop another's."""


class Acknowledgement:
    """Publishes what a reader of a block topic has processed.

    Parameters
    ----------
    node
        The node that reads.
    topic
        The topic's full name.

    Attributes
    ----------
    events
        To be handed to the subscription: the reader greets each publisher that it finds.
    """

    def __init__(self, node: Node, topic: str) -> None:
        self._publisher = node.create_publisher(String, topic + ACKNOWLEDGEMENT_SUFFIX, LATEST_QOS)
        self._reader = f"{node.get_fully_qualified_name()} {os.getpid()}-{id(self)}"
        self.events = SubscriptionEventCallbacks(matched=self._greet)

    def processed(self, sent_ns: int) -> None:
        """Tell that the message which was sent at this time [ns], and all before it, is processed.

        Parameters
        ----------
        sent_ns
            The middleware's stamp of the message.
        """
        self._publisher.publish(String(data=f"{self._reader} {sent_ns}"))

    def _greet(self, status: Any) -> None:
        if status.current_count_change > 0:
            self.processed(GREETING)


class Greetings:
    """Counts the readers of a topic that have found its publisher.

    Parameters
    ----------
    node
        The node that publishes.
    topic
        The topic's full name.
    """

    def __init__(self, node: Node, topic: str) -> None:
        self._node, self._topic = node, topic + ACKNOWLEDGEMENT_SUFFIX
        self._readers: set[str] = set()
        self._subscription = node.create_subscription(
            String, self._topic, self._receive, EVERY_READER_QOS
        )

    def _receive(self, message: String) -> None:
        reader, stamp = read_acknowledgement(message)
        if stamp == GREETING:
            self._readers.add(reader)

    @property
    def missing(self) -> int:
        """Return how many of the readers that report have not found the publisher yet."""
        return max(self._node.count_publishers(self._topic) - len(self._readers), 0)

    def close(self) -> None:
        """Stop counting readers."""
        self._node.destroy_subscription(self._subscription)


def read_acknowledgement(message: String) -> tuple[str, int]:
    """Return who reads, and the time of the message that it got to [ns].

    Parameters
    ----------
    message
        From a topic of acknowledgements.
    """
    reader, _, stamp = message.data.rpartition(" ")
    return reader, int(stamp)
