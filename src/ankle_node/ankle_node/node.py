"""The base of every node: declared parameters, blocks in and out, health, start and stop."""

from __future__ import annotations

import math
import socket
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.executors import SingleThreadedExecutor
from rclpy.publisher import Publisher
from std_msgs.msg import Float64MultiArray

from ankle_interfaces.block import Block, pack
from ankle_interfaces.continuity import Continuity, Finding
from ankle_interfaces.quantity import Quantity
from ankle_interfaces.topics import DIAGNOSTICS, RIG_STATE, Topic
from ankle_node import derived_topics
from ankle_node.acknowledgement import Acknowledgement, Greetings
from ankle_node.block_reader import BlockReader, Defect
from ankle_node.health import ERROR, OK, WARN, Health
from ankle_node.node_with_parameters import NodeWithParameters
from ankle_node.qos import BLOCK_QOS, LATEST_QOS, publisher_qos, reader_qos
from ankle_node.real_time import take_priority
from ankle_node.running import STOP_POLL_PERIOD, run
from ankle_node.sources import Sources

__all__ = ["BLOCK_QOS", "ERROR", "LATEST_QOS", "OK", "WARN", "AnkleNode", "run"]

DIAGNOSTICS_PERIOD = 1.0
"""[s] Time between two messages on ``/diagnostics``."""
READERS_POLL_PERIOD = 0.05
"""[s] Time between two looks for readers: short against the start of a process, long against its
cost."""
READERS_PATIENCE = 5.0
"""[s] Time after which a node says that it still waits for readers."""
GREETING_PATIENCE = 5.0
"""[s] Longest wait for the greetings of connected readers: Fast DDS announces again, after 3 s,
what was lost on the way."""
SIMULATION = "ankle_sim"
"""Name of the node that simulates rig and subject."""
RIG_POLL_PERIOD = 0.5
"""[s] Time between two looks for a rig's driver, which needs a second to know the rig's clock."""
QUIET_TIME = 1.0
"""[s] Time without a block after which none is on its way; a crowded machine holds a process off
for half a second."""
HAND_OVER_TIME = 3.0
"""[s] Longest wait for readers to confirm the last blocks; Fast DDS asks after lost blocks at least
that often."""
MessageInfo = dict[str, Any]
"""What rclpy hands to a callback of two arguments."""


class AnkleNode(NodeWithParameters):
    """Publishes and reads blocks, and publishes health on ``/diagnostics``: once a second, and at
    once when something goes wrong.

    Parameters
    ----------
    name
        Name of the node.
    parameters
        Every parameter of the node; a refused start value raises `QuantityError`.
    """

    def __init__(self, name: str, parameters: Sequence[Quantity]) -> None:
        super().__init__(name, parameters)
        self.hardware_id = socket.gethostname()
        self._last_block = (0, 0.0)  # when it was sent [ns], and when it was received [s]
        self._health = Health()
        self._block_publishers: dict[str, Publisher] = {}
        self._diagnostics = self.create_publisher(
            DiagnosticArray, DIAGNOSTICS.name, publisher_qos(DIAGNOSTICS)
        )
        self._sources = Sources(self, self._report_sources)
        self.create_timer(DIAGNOSTICS_PERIOD, self._publish_health)
        for sentence in self.ignored:
            self.get_logger().warning(sentence)
            self.health("parameters", WARN, sentence)

    def block_publisher(
        self, topic: Topic, columns: Sequence[str] | None = None
    ) -> Callable[[np.ndarray], None]:
        """Make a publisher of blocks, and of the single numbers that go with them (`Topic.plots`).

        Parameters
        ----------
        topic
            One of `ankle_interfaces.topics`.
        columns
            Columns that this node has; the topic's first ones, as many as the data have, where
            None.

        Returns
        -------
        Callable
            To be called with data of shape (n, m), one column for each of `columns`.
        """
        publisher = self.create_publisher(Float64MultiArray, topic.name, publisher_qos(topic))
        self._block_publishers[topic.name] = publisher
        plot = derived_topics.plots(self, topic, columns or topic.columns)

        def publish(data: np.ndarray) -> None:
            names = topic.columns_of(data.shape[1]) if columns is None else tuple(columns)
            publisher.publish(pack(Block(names, data)))
            plot(data)

        return publish

    def block_subscription(
        self,
        topic: Topic,
        callback: Callable[[Block, list[Finding]], None],
        required: Sequence[str] | None = None,
        optional: Sequence[str] = (),
    ) -> Continuity:
        """Call back with each block of a topic, and with what is wrong in the stream.

        A block arrives in SI, with the columns that were asked for and no others. A block without
        a required column is refused: reported on ``/diagnostics`` and in the log, and dropped.
        A second publisher of the topic is reported in the same way.

        Parameters
        ----------
        topic
            One of `ankle_interfaces.topics`.
        callback
            Called with a block and its findings.
        required, optional
            SI names of the columns that this reader wants, without time, in the order in which it
            wants them; where `required` is None, all that the topic declares.

        Returns
        -------
        Continuity
            What is known of the stream: its rate, its missing samples.
        """
        if required is None:
            wanted, optional = topic.columns[1:], topic.optional
        else:
            wanted = (*required, *optional)
        name = self.resolve_topic_name(topic.name)
        acknowledgement = Acknowledgement(self, name)
        reader = BlockReader(
            name,
            wanted,
            optional,
            callback,
            partial(self._report_block, topic.name),
            topic.sparse,
        )

        def receive(message: bytes, info: MessageInfo) -> None:
            reader.take(message)
            self.count(f"{topic.name} missing samples", reader.continuity.missing)
            self.note_processed(acknowledgement, info)

        # rclpy passes the info to a callback of two arguments; its annotation knows one.
        with_info: Any = receive
        qos = reader_qos(topic)
        self.create_subscription(
            Float64MultiArray,
            topic.name,
            with_info,
            qos,
            raw=True,
            event_callbacks=acknowledgement.events,
        )
        self.watch_publishers(topic.name)
        return reader.continuity

    def _report_block(self, topic: str, defect: Defect, sentence: str, first: bool) -> None:
        level = ERROR if defect is Defect.BLOCK else WARN
        log = self.get_logger()
        if defect is Defect.STREAM:
            name = self.resolve_topic_name(topic)
            log.warning(f"{name}: {sentence}", throttle_duration_sec=1.0)
        elif first:
            log.error(sentence) if level == ERROR else log.warning(sentence)
        self.health(f"{topic} {defect.value}".rstrip(), level, sentence)

    def watch_publishers(self, topic: str) -> None:
        """Report from now on when several nodes publish a topic that this node reads."""
        self._sources.watch(self.resolve_topic_name(topic))

    def _report_sources(self, topic: str, sentence: str) -> None:
        self.get_logger().error(sentence, throttle_duration_sec=10.0)
        self.health(f"{topic} publishers", ERROR, sentence)

    def note_processed(self, acknowledgement: Acknowledgement, info: MessageInfo) -> None:
        """Tell the publisher that a message, with this info of rclpy's, is processed."""
        self._last_block = (info["source_timestamp"], time.monotonic())
        acknowledgement.processed(info["source_timestamp"])

    def when_read(self, topic: Topic, readers: int, begin: Callable[[], None]) -> None:
        """Call `begin` once as many readers are connected to a block topic of this node, and those
        that greet have found it, too; at once for 0.

        A graph whose nodes start in any order loses no block at its beginning when each node takes
        its input only after its own output is read. A greeting may be lost where a reader still
        has blocks of a former publisher to acknowledge: connected readers are not waited for longer
        than `GREETING_PATIENCE`.

        Parameters
        ----------
        topic
            One that this node publishes by `block_publisher`.
        readers
            How many are needed.
        begin
            Called once, from the node's executor.
        """
        if readers <= 0:
            begin()
            return
        publisher = self._block_publishers[topic.name]
        greetings = Greetings(self, self.resolve_topic_name(topic.name))
        asked_at = time.monotonic()
        connected_at = math.inf
        reported = False

        def look() -> None:
            nonlocal reported, connected_at
            now, connected = time.monotonic(), publisher.get_subscription_count()
            connected_at = min(connected_at, now) if connected >= readers else math.inf
            if connected - greetings.missing >= readers or now - connected_at > GREETING_PATIENCE:
                timer.cancel()
                greetings.close()
                begin()
            elif now - asked_at > READERS_PATIENCE:
                waiting = f"waiting for {readers} readers, {connected} connected"
                self.health(topic.name, WARN, waiting)
                if not reported:
                    reported = True
                    self.get_logger().info(f"{topic.name}: {waiting}")

        timer = self.create_timer(
            READERS_POLL_PERIOD, look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def take_priority_beside_a_rig(self, priority: int) -> None:
        """Take real-time priority once a rig's driver is in the graph.

        A graph that only simulates shares the computer like any other program.

        Parameters
        ----------
        priority
            See `ankle_node.real_time.take_priority`.
        """
        topic = self.resolve_topic_name(RIG_STATE.name)

        def look() -> None:
            # A simulation answers like a driver, so that a stop on a page stops it, too.
            publishers = self.get_publishers_info_by_topic(topic)
            if any(publisher.node_name != SIMULATION for publisher in publishers):
                timer.cancel()
                if refusal := take_priority(priority):
                    self.get_logger().warning(refusal)

        steady = Clock(clock_type=ClockType.STEADY_TIME)
        timer = self.create_timer(RIG_POLL_PERIOD, look, clock=steady)

    def process_waiting(self, executor: SingleThreadedExecutor) -> None:
        """Process the blocks that were sent before now and still wait in this node's queues."""
        asked, begin = time.time_ns(), time.monotonic()
        while rclpy.ok() and time.monotonic() < begin + HAND_OVER_TIME:
            executor.spin_once(timeout_sec=STOP_POLL_PERIOD)
            sent, received = self._last_block
            if sent > asked or time.monotonic() > max(received, begin) + QUIET_TIME:
                return
        self.get_logger().warning(f"stopped with blocks still waiting after {HAND_OVER_TIME:g} s")

    def hand_over(self) -> None:
        """Wait until the readers have the last blocks; log where they do not confirm."""
        deadline = time.monotonic() + HAND_OVER_TIME
        for topic, publisher in self._block_publishers.items():
            left = max(deadline - time.monotonic(), 0.0)
            if rclpy.ok() and not publisher.wait_for_all_acked(Duration(seconds=left)):
                self.get_logger().warning(
                    f"{topic}: readers did not confirm the last blocks within {HAND_OVER_TIME:g} s"
                )

    def now(self) -> float:
        """Return ROS time [s]."""
        return self.get_clock().now().nanoseconds * 1e-9

    def health(self, what: str, level: bytes, message: str) -> None:
        """State the health of one thing, from any thread; a warning or error is shown
        for at least ten seconds.
        """
        if self._health.state(what, level, message):
            self._publish_health()

    def count(self, what: str, value: object) -> None:
        """Set a figure that is shown with the node's health, from any thread."""
        self._health.count(what, value)

    def _publish_health(self) -> None:
        status = self._health.status(self.get_fully_qualified_name(), self.hardware_id)
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)
