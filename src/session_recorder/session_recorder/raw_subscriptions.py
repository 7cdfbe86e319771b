"""Subscriptions that take messages as they come, in their serialised form, many at a time."""

from __future__ import annotations

import importlib
import time
from collections.abc import Callable

from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from ankle_interfaces.block import MESSAGE_TYPE
from ankle_node.acknowledgement import Acknowledgement
from ankle_node.node import AnkleNode, MessageInfo
from session_recorder.errors import BagError
from session_recorder.message_definitions import definition

LOOK_PERIOD = 0.005
"""[s] Between two looks for messages. A wake-up costs rclpy about 0.4 ms with the topics of a
laboratory, whatever comes with it; without a rest there would be one for each message, 1000 a
second."""
LOOK_LIMIT = 512
"""Messages of one topic taken in one look, so that a flood leaves time for the other topics."""


class RawSubscriptions:
    """Takes the messages of many topics; blocks are acknowledged, so that a replay waits for them.

    Parameters
    ----------
    node
        The node that reads.
    store
        Called with topic, serialised message and its times.

    Attributes
    ----------
    types
        Message type of each connected topic by full name.
    """

    def __init__(self, node: AnkleNode, store: Callable[[str, bytes, MessageInfo], None]) -> None:
        self._node, self._store = node, store
        self.types: dict[str, str] = {}
        self._stores: list[tuple[Subscription, Callable[[bytes, MessageInfo], None]]] = []

    def connect(self, topic: str, message_type: str, qos: QoSProfile) -> None:
        """Take the messages of a topic from now on.

        Raises
        ------
        BagError
            A type that this installation does not have or whose definition is not known.
        """
        package, _, name = message_type.split("/")
        definition(message_type)
        try:
            message_class = getattr(importlib.import_module(f"{package}.msg"), name)
        except (ImportError, AttributeError) as error:
            raise BagError(str(error)) from None
        self.types[topic] = message_type
        blocks = message_type == MESSAGE_TYPE
        acknowledgement = Acknowledgement(self._node, topic) if blocks else None

        def store(message: bytes, info: MessageInfo) -> None:
            self._store(topic, message, info)
            if acknowledgement is not None:
                self._node.note_processed(acknowledgement, info)

        def receive(message: bytes, info: MessageInfo) -> None:
            store(message, info)
            self._store_waiting()

        # rclpy passes the message's times to a callback of two arguments; its annotation knows one.
        subscription = self._node.create_subscription(
            message_class,
            topic,
            receive,  # type: ignore[arg-type]
            qos,
            raw=True,
            event_callbacks=acknowledgement.events if acknowledgement is not None else None,
        )
        self._stores.append((subscription, store))

    def _store_waiting(self) -> None:
        """Store what waits on any topic, and rest: many messages for one wake-up of rclpy."""
        for subscription, store in self._stores:
            with subscription.handle:
                for _ in range(LOOK_LIMIT):
                    if (
                        taken := subscription.handle.take_message(subscription.msg_type, True)
                    ) is None:
                        break
                    store(*taken)
        time.sleep(LOOK_PERIOD)
