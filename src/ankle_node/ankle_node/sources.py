"""Who publishes the topics that a node reads: a second publisher would mix its samples in."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.topic_endpoint_info import TopicEndpointInfo

LOOK_PERIOD = 1.0
"""[s] Time between two looks: a second publisher is named within two seconds; looking takes well
under a millisecond."""
NAME_UNKNOWN = "_NODE_NAME_UNKNOWN_"
"""Name that rclpy gives instead of a node that the discovery has not named yet."""


class Sources:
    """Looks once a second whether each topic that was named has one publisher only.

    Parameters
    ----------
    node
        The node that reads.
    report
        Called with topic and sentence at every look, as long as there are several publishers.
    """

    def __init__(self, node: Node, report: Callable[[str, str], None]) -> None:
        self._node, self._report = node, report
        self._topics: list[str] = []
        node.create_timer(LOOK_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def watch(self, topic: str) -> None:
        """Begin to look after a topic, given by its full name."""
        if topic not in self._topics:
            self._topics.append(topic)

    def _look(self) -> None:
        for topic in self._topics:
            names = publishers(self._node, topic)
            if len(names) > 1 and NAME_UNKNOWN not in "".join(names):
                self._report(
                    topic,
                    f"{len(names)} nodes publish {topic} ({', '.join(names)}): their samples mix; "
                    "stop one of them, or give it a namespace",
                )


def publishers(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that publish a topic, one for each publisher, sorted."""
    return sorted(full_names(node.get_publishers_info_by_topic(topic)))


def readers(node: Node, topic: str) -> list[str]:
    """Return the full names of the nodes that read a topic, one for each subscription, sorted."""
    return sorted(full_names(node.get_subscriptions_info_by_topic(topic)))


def full_names(ends: Sequence[TopicEndpointInfo]) -> list[str]:
    """Return the full name of the node at each end of a topic, in their order."""
    return [f"{end.node_namespace.rstrip('/')}/{end.node_name}" for end in ends]
