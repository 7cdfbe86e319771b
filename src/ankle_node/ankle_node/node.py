"""The base of every node: declared parameters, blocks in and out, health, start and stop."""

from __future__ import annotations

import os
import signal
import socket
import sys
import threading
import time
from collections.abc import Callable, Sequence
from types import FrameType
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import ParameterDescriptor, SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray, String

from ankle_interfaces.block import Block, pack, select_columns, unpack
from ankle_interfaces.continuity import Continuity, Finding
from ankle_interfaces.errors import BlockError, QuantityError
from ankle_interfaces.quantity import Quantity, Value
from ankle_interfaces.topics import DIAGNOSTICS, RIG_STATE, Topic
from ankle_node import declared_parameters, derived_topics
from ankle_node.health import ERROR, OK, WARN, Health
from ankle_node.qos import BLOCK_QOS, LATEST_QOS, publisher_qos, reader_qos
from ankle_node.real_time import take_priority
from ankle_node.sources import Sources
from ankle_node.unblocked_output import NO_LOG_FILES, unblocked_output

__all__ = ["ACKNOWLEDGED", "BLOCK_QOS", "ERROR", "LATEST_QOS", "OK", "WARN", "AnkleNode", "run"]

ACKNOWLEDGED = "/_acknowledged"
"""Ending of the name of a topic's acknowledgements; the underscore hides it from ``ros2 topic
list``."""
DIAGNOSTICS_PERIOD = 1.0
"""[s] Time between two messages on ``/diagnostics``."""
READERS_POLL_PERIOD = 0.05
"""[s] Time between two looks for readers: short against the start of a process, long against its
cost."""
SIMULATION = "ankle_sim"
"""Name of the node that simulates rig and subject."""
RIG_POLL_PERIOD = 0.5
"""[s] Time between two looks for a rig's driver, which needs a second to know the rig's clock."""
STOP_POLL_PERIOD = 0.1
"""[s] Longest time from a signal to the stop of a node that nothing else wakes."""
QUIET_TIME = 1.0
"""[s] Time without a block after which none is on its way; a crowded machine holds a process off
for half a second."""
HAND_OVER_TIME = 3.0
"""[s] Longest wait for readers to confirm the last blocks; Fast DDS asks after lost blocks at least
that often."""
MessageInfo = dict[str, Any]
"""What rclpy hands to a callback of two arguments."""


class AnkleNode(Node):
    """Declares parameters and publishes health on ``/diagnostics``, once a second and at once when
    something goes wrong.

    Parameters
    ----------
    name
        Node name.
    parameters
        Every parameter of the node; a refused start value raises `QuantityError`.
    """

    def __init__(self, name: str, parameters: Sequence[Quantity]) -> None:
        self._declared = {parameter.name: parameter for parameter in parameters}
        super().__init__(name)
        ignored = declared_parameters.check_overrides(self._parameter_overrides, self._declared)
        for parameter in parameters:
            self.declare_parameter(
                parameter.name, parameter.default, declared_parameters.declaration(parameter)
            )
            parameter.check(self.get_parameter(parameter.name).value)
        self.add_on_set_parameters_callback(self._check_parameters)
        self.hardware_id = socket.gethostname()
        self._last_block = (0, 0.0)  # when it was sent [ns], and when it was received [s]
        self._health = Health()
        self._block_publishers: dict[str, Publisher] = {}
        self._diagnostics = self.create_publisher(
            DiagnosticArray, DIAGNOSTICS.name, publisher_qos(DIAGNOSTICS)
        )
        self._sources = Sources(self, self._report_sources)
        self.create_timer(DIAGNOSTICS_PERIOD, self._publish_health)
        for sentence in ignored:
            self.get_logger().warning(sentence)
            self.health("parameters", WARN, sentence)

    def describe_parameter(self, name: str) -> ParameterDescriptor:
        """Return what ``ros2 param describe`` shows, range and ``read_only`` included."""
        descriptor = super().describe_parameter(name)
        declared = self._declared.get(name)
        return declared_parameters.describe(descriptor, declared) if declared else descriptor

    def set_parameters(self, parameter_list: list[rclpy.Parameter]) -> list[SetParametersResult]:
        """Set each parameter; see `rclpy.node.Node.set_parameters`.

        An unknown one is refused with the name that may be meant. A value that is already there is
        accepted for every parameter, so that a node loads what it has dumped.
        """
        return [self.set_parameters_atomically([parameter]) for parameter in parameter_list]

    def set_parameters_atomically(
        self, parameter_list: list[rclpy.Parameter]
    ) -> SetParametersResult:
        """Set all of the parameters or none; see `set_parameters`."""
        changes = []
        for parameter in parameter_list:
            if not self.has_parameter(parameter.name):
                reason = declared_parameters.unknown(parameter.name, self._declared)
                self.get_logger().error(reason)
                return SetParametersResult(successful=False, reason=reason)
            present = self.get_parameter(parameter.name).value
            fixed = parameter.name in declared_parameters.RCLPY_PARAMETERS
            if not fixed or parameter.value != present:
                changes.append(parameter)
        if not changes:
            return SetParametersResult(successful=True)
        return super().set_parameters_atomically(changes)

    def value(self, name: str) -> Value:
        """Return the present value of a declared parameter, in its declared type."""
        return self._declared[name].check(self.get_parameter(name).value)

    def number(self, name: str) -> float:
        """Return the present value of a float or int parameter."""
        return float(self.value(name))

    def text(self, name: str) -> str:
        """Return the present value of a text parameter."""
        return str(self.value(name))

    def parameters_changed(self, values: dict[str, Value]) -> None:
        """React to accepted new values before they are stored.

        A subclass raises `QuantityError` to refuse them.
        """

    def _check_parameters(self, changes: list[rclpy.Parameter]) -> SetParametersResult:
        accepted: dict[str, Value] = {}
        try:
            for change in changes:
                declared = self._declared.get(change.name)
                if change.name in declared_parameters.RCLPY_PARAMETERS:
                    raise QuantityError(f"parameter '{change.name}' can be set at start only")
                if declared is None:
                    continue
                value = declared.check(change.value)
                if not declared.start_only:
                    accepted[change.name] = value
                elif value != self.value(change.name):
                    raise QuantityError(f"parameter '{declared.name}' can be set at start only")
            if accepted:
                self.parameters_changed(accepted)
        except QuantityError as error:
            self.get_logger().error(str(error))
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

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
        continuity = Continuity()
        reported: set[str] = set()
        acknowledge = self.acknowledger(topic.name)

        def report(what: str, level: bytes, sentence: str) -> None:
            if sentence not in reported:
                reported.add(sentence)
                log = self.get_logger()
                log.error(sentence) if level == ERROR else log.warning(sentence)
            self.health(f"{topic.name} {what}", level, sentence)

        def receive(message: bytes, info: MessageInfo) -> None:
            process(message)
            acknowledge(info)

        def process(message: bytes) -> None:
            try:
                block, notes = select_columns(unpack(message), wanted, name, optional)
                for note in notes:
                    report("units", WARN, f"{name}: {note}")
            except BlockError as error:
                text = str(error)
                report("blocks", ERROR, text if text.startswith(name) else f"{name}: {text}")
                return
            findings = continuity.check(block.data)
            for finding in findings:
                self.get_logger().warning(f"{name}: {finding.message}", throttle_duration_sec=1.0)
                self.health(topic.name, WARN, finding.message)
            self.count(f"{topic.name} missing samples", continuity.missing)
            callback(block, findings)

        # rclpy passes the info to a callback of two arguments; its annotation knows one.
        with_info: Any = receive
        qos = reader_qos(topic)
        self.create_subscription(Float64MultiArray, topic.name, with_info, qos, raw=True)
        self.watch_publishers(topic.name)
        return continuity

    def watch_publishers(self, topic: str) -> None:
        """Report from now on when several nodes publish a topic that this node reads."""
        self._sources.watch(self.resolve_topic_name(topic))

    def _report_sources(self, topic: str, sentence: str) -> None:
        self.get_logger().error(sentence, throttle_duration_sec=10.0)
        self.health(f"{topic} publishers", ERROR, sentence)

    def acknowledger(self, topic: str) -> Callable[[MessageInfo], None]:
        """Make a function to call with the info of each message that this node has processed.

        DDS confirms that a message reached the reader's queue, not that the reader got to it: a
        replay at full speed would overrun the queue of 64 if it did not hear this. The message says
        who reads, and when the message that it got to was sent [ns].
        """
        publisher = self.create_publisher(
            String, self.resolve_topic_name(topic) + ACKNOWLEDGED, LATEST_QOS
        )
        reader = f"{self.get_fully_qualified_name()} {os.getpid()}-{id(publisher)}"

        def acknowledge(info: MessageInfo) -> None:
            self._last_block = (info["source_timestamp"], time.monotonic())
            publisher.publish(String(data=f"{reader} {info['source_timestamp']}"))

        return acknowledge

    def when_read(self, topic: Topic, readers: int, begin: Callable[[], None]) -> None:
        """Call `begin` once as many readers are connected to a block topic of this node; at once
        for 0.

        A graph whose nodes start in any order loses no block at its beginning when each node takes
        its input only after its own output is read.
        """
        if readers <= 0:
            begin()
            return
        publisher = self._block_publishers[topic.name]
        asked_at = time.monotonic()

        def look() -> None:
            connected = publisher.get_subscription_count()
            if connected >= readers:
                timer.cancel()
                begin()
            elif time.monotonic() - asked_at > 5.0:
                self.health(
                    topic.name, WARN, f"waiting for {readers} readers, {connected} connected"
                )

        timer = self.create_timer(
            READERS_POLL_PERIOD, look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def take_priority_beside_a_rig(self, priority: int) -> None:
        """Take real-time priority once a rig's driver is in the graph.

        A graph that only simulates shares the computer like any other program.

        Parameters
        ----------
        priority
            As for `ankle_node.real_time.take_priority`.
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


class StopSignal:
    """Receives SIGINT and SIGTERM: while the node is made they interrupt whatever it does (a
    compilation takes half a minute), afterwards they are noted, so that the node ends in good
    order.
    """

    def __init__(self) -> None:
        self.starting = True
        self._received = threading.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._receive)

    @property
    def received(self) -> bool:
        """Tell whether the process was asked to stop."""
        return self._received.is_set()

    def _receive(self, number: int, frame: FrameType | None) -> None:
        self._received.set()
        if self.starting:
            self.starting = False
            raise KeyboardInterrupt


def run(make: Callable[[], AnkleNode], arguments: Sequence[str] | None = None) -> int:
    """Start rclpy, spin the node until the process is asked to stop, and clean up.

    Discovery stays on this host unless the environment says otherwise.

    Parameters
    ----------
    make
        Makes the node.
    arguments
        Command line; that of the process where None.

    Returns
    -------
    int
        Exit code: 0 after a stop by signal or by the node itself, 1 after an error, which is one
        line on stderr.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    with unblocked_output():
        return _run(make, [*(sys.argv if arguments is None else arguments), *NO_LOG_FILES])


def _run(make: Callable[[], AnkleNode], arguments: list[str]) -> int:
    # rclpy's own handlers would close the context at once, with the last blocks still on their way.
    rclpy.init(args=arguments, signal_handler_options=SignalHandlerOptions.NO)
    node: AnkleNode | None = None
    try:
        stop = StopSignal()
        node = make()
        stop.starting = False
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while rclpy.ok() and not stop.received:
            executor.spin_once(timeout_sec=STOP_POLL_PERIOD)
        node.process_waiting(executor)
        node.hand_over()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return 1
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
