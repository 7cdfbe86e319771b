"""Finds the topics of the graph that are to be recorded, and connects them."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

from rclpy.qos import QoSProfile
from rclpy.topic_endpoint_info import TopicEndpointInfo

from ankle_node.acknowledgement import ACKNOWLEDGEMENT_SUFFIX
from ankle_node.node import AnkleNode
from ankle_node.sources import full_names
from session_recorder import bag_metadata
from session_recorder.errors import BagError
from session_recorder.raw_subscriptions import RawSubscriptions
from session_recorder.recording import Recording
from session_recorder.ros_qos import from_ros, to_record
from session_recorder.topic_choice import TopicChoice

SETTLED_LOOKS = 3
"""Number of looks at the graph without a new topic before everything counts as connected."""
NAMED_TOPIC_PATIENCE = 5.0
"""[s] Time before a named topic without publisher is reported."""


class TopicDiscovery:
    """Connects topics when they appear, and notes who publishes them.

    Parameters
    ----------
    node
        The node that records.
    choice
        Which topics are wanted, and their names in the bag.
    inputs
        The subscriptions.
    warn
        Receives a topic and a sentence about it.
    """

    def __init__(
        self,
        node: AnkleNode,
        choice: TopicChoice,
        inputs: RawSubscriptions,
        warn: Callable[[str, str], None],
    ) -> None:
        self._node, self._choice, self._inputs, self._warn = node, choice, inputs, warn
        self._refused: set[str] = set()
        self._published: set[str] = set()
        self._quiet_looks = 0
        self._began = time.monotonic()

    @property
    def settled(self) -> bool:
        """Return whether every wanted topic that is known is connected."""
        return self._quiet_looks >= SETTLED_LOOKS and not self._choice.missing(self._inputs.types)

    @property
    def late(self) -> list[str]:
        """Return the named topics that have had no publisher for long."""
        waiting = time.monotonic() - self._began
        return self.never_published if waiting > NAMED_TOPIC_PATIENCE else []

    @property
    def never_published(self) -> list[str]:
        """Return the named topics that have had no publisher so far."""
        return self._choice.missing(self._published)

    def connect(self, topic: str, message_type: str, qos: QoSProfile) -> None:
        """Subscribe to a topic; one that cannot be recorded is reported once."""
        try:
            self._inputs.connect(topic, message_type, qos)
        except BagError as error:
            self._refused.add(topic)
            self._warn(topic, f"not recorded: {error}")

    def look(self, recording: Recording) -> None:
        """Look at the graph for new topics and publishers."""
        self._quiet_looks += 1
        for topic, types in self._node.get_topic_names_and_types():
            refused = topic.endswith(ACKNOWLEDGEMENT_SUFFIX) or topic in self._refused
            if refused or not self._choice.wants(topic):
                continue
            offers = self._node.get_publishers_info_by_topic(topic)
            self._set_publishers(recording, topic, offers)
            if not offers:
                continue
            self._published.add(topic)
            if topic not in self._inputs.types:
                self._quiet_looks = 0
                self.connect(topic, types[0], to_record([offer.qos_profile for offer in offers]))
            name = self._choice.name_in_bag(topic)
            if name in recording.bag.topics:
                for offer in offers:
                    recording.bag.add_qos(name, from_ros(offer.qos_profile))

    def add_to(self, recording: Recording, topic: str) -> None:
        """Add a topic to the bag with the QoS that its publishers offer."""
        self._published.add(topic)
        offers = self._node.get_publishers_info_by_topic(topic)
        self._set_publishers(recording, topic, offers)
        profiles = dict.fromkeys(from_ros(offer.qos_profile) for offer in offers)
        recording.add_topic(
            self._choice.name_in_bag(topic),
            self._inputs.types[topic],
            tuple(profiles) or (bag_metadata.BLOCK_QOS,),
        )

    def _set_publishers(
        self, recording: Recording, topic: str, offers: Sequence[TopicEndpointInfo]
    ) -> None:
        identities = (str(offer.endpoint_gid) for offer in offers)
        publishers = dict(zip(identities, full_names(offers), strict=True))
        sentence = recording.set_publishers(self._choice.name_in_bag(topic), publishers)
        if sentence is not None:
            # Apart from what is said of the samples, which changes more often.
            self._warn(f"{topic} publishers", sentence)
