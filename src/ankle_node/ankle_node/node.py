"""The base of every node: declared parameters, blocks in and out, health, start and stop."""

from __future__ import annotations

import copy
import math
import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rcl_interfaces.msg import (
    FloatingPointRange,
    IntegerRange,
    ParameterDescriptor,
    SetParametersResult,
)
from rclpy.clock import Clock, ClockType
from rclpy.duration import Duration
from rclpy.executors import ExternalShutdownException, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.qos import QoSDurabilityPolicy, QoSHistoryPolicy, QoSProfile, QoSReliabilityPolicy
from rclpy.signals import SignalHandlerOptions
from std_msgs.msg import Float64MultiArray, String

from ankle_interfaces.block import Block, pack, require_columns, unpack
from ankle_interfaces.continuity import Continuity, Finding
from ankle_interfaces.errors import BlockError, QuantityError
from ankle_interfaces.quantity import Quantity, Value

# Reliable, keep-last 64: one second of blocks, so that a busy reader loses nothing.
BLOCK_QOS = QoSProfile(
    history=QoSHistoryPolicy.KEEP_LAST,
    depth=64,
    reliability=QoSReliabilityPolicy.RELIABLE,
    durability=QoSDurabilityPolicy.VOLATILE,
)
# A publisher keeps half a minute, for readers that ask again for what was dropped on the way: a
# recorder of a graph that replays at a hundred times real time lost blocks with 64.
PUBLISHED_BLOCKS_QOS = QoSProfile(
    history=QoSHistoryPolicy.KEEP_LAST,
    depth=2048,
    reliability=QoSReliabilityPolicy.RELIABLE,
    durability=QoSDurabilityPolicy.VOLATILE,
)
# Latched, the last one only: what a reader has worked off so far is also known to a replay that
# connects later.
WORKED_OFF_QOS = QoSProfile(
    history=QoSHistoryPolicy.KEEP_LAST,
    depth=1,
    reliability=QoSReliabilityPolicy.RELIABLE,
    durability=QoSDurabilityPolicy.TRANSIENT_LOCAL,
)
WORKED_OFF = "/_worked_off"  # behind a topic's name; the underscore hides it from `ros2 topic list`
DIAGNOSTICS_PERIOD = 1.0  # s
HEALTH_SHOWN = 10.0  # s; a warning stays so long, so that a person who looks up once sees it
NEWS_PERIOD = (
    0.1  # s; something that comes and goes with every block is told no more often than that
)
READERS_POLL_PERIOD = 0.05  # s; short against the start of a process, long against its cost
STOP_POLL_PERIOD = (
    0.1  # s; longest time from a signal to the stop of a node that nothing else wakes
)
# s without a block after which none is on its way; a crowded machine holds a process off for half a
# second
QUIET_TIME = 1.0
HAND_OVER_TIME = 3.0  # s; Fast DDS asks after lost blocks at least that often
MessageInfo = dict[str, Any]  # as rclpy hands it to a callback of two arguments
OK, WARN, ERROR = DiagnosticStatus.OK, DiagnosticStatus.WARN, DiagnosticStatus.ERROR


class AnkleNode(Node):
    """A node with declared parameters and health on ``/diagnostics`` once a second, and at once
    when something goes wrong.

    Parameters
    ----------
    name
        Node name.
    parameters
        Every parameter of the node; a refused start value raises `QuantityError`.
    """

    def __init__(self, name: str, parameters: Sequence[Quantity]) -> None:
        super().__init__(name)
        self._declared = {parameter.name: parameter for parameter in parameters}
        for parameter in parameters:
            self.declare_parameter(parameter.name, parameter.default, _descriptor(parameter))
            parameter.check(self.get_parameter(parameter.name).value)
        self.add_on_set_parameters_callback(self._check_parameters)
        self._taken = (0, 0.0)  # when the last block taken was sent [ns], and when it was taken [s]
        self._health: dict[str, tuple[bytes, str, float]] = {}
        self._counters: dict[str, str] = {}
        self._health_told = 0.0  # s of the steady clock
        self._block_publishers: dict[str, Publisher] = {}
        self._diagnostics = self.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self.create_timer(DIAGNOSTICS_PERIOD, self._publish_health)

    def describe_parameter(self, name: str) -> ParameterDescriptor:
        """What ``ros2 param describe`` shows, range included.

        The range is added here and not at declaration, because rclpy would check it before our own
        check and answer without the unit and the range.
        """
        descriptor = copy.deepcopy(super().describe_parameter(name))
        declared = self._declared.get(name)
        if declared is not None and math.isfinite(declared.upper - declared.lower):
            if isinstance(declared.default, float):
                descriptor.floating_point_range = [
                    FloatingPointRange(
                        from_value=float(declared.lower), to_value=float(declared.upper)
                    )
                ]
            elif isinstance(declared.default, int):
                descriptor.integer_range = [
                    IntegerRange(from_value=int(declared.lower), to_value=int(declared.upper))
                ]
        return descriptor

    def value(self, name: str) -> Value:
        """The present value of a declared parameter, in its declared type."""
        return self._declared[name].check(self.get_parameter(name).value)

    def number(self, name: str) -> float:
        """The present value of a float or int parameter."""
        return float(self.value(name))

    def text(self, name: str) -> str:
        """The present value of a text parameter."""
        return str(self.value(name))

    def parameters_changed(self, values: dict[str, Value]) -> None:
        """Called with accepted new values before they are stored; raise `QuantityError` to refuse
        them.
        """

    def _check_parameters(self, changes: list[rclpy.Parameter]) -> SetParametersResult:
        accepted: dict[str, Value] = {}
        try:
            for change in changes:
                declared = self._declared.get(change.name)
                if declared is None:
                    continue
                if declared.start_only:
                    raise QuantityError(f"parameter '{declared.name}' can be set at start only")
                accepted[change.name] = declared.check(change.value)
            if accepted:
                self.parameters_changed(accepted)
        except QuantityError as error:
            self.get_logger().error(str(error))
            return SetParametersResult(successful=False, reason=str(error))
        return SetParametersResult(successful=True)

    def block_publisher(self, topic: str, columns: Sequence[str]) -> Callable[[np.ndarray], None]:
        """A function that publishes data of shape (n, m), m columns ``t[s], ...``, as one block."""
        names = tuple(columns)
        publisher = self.create_publisher(Float64MultiArray, topic, PUBLISHED_BLOCKS_QOS)
        self._block_publishers[topic] = publisher

        def publish(data: np.ndarray) -> None:
            publisher.publish(pack(Block(names, data)))

        return publish

    def block_subscription(
        self, topic: str, required: Sequence[str], callback: Callable[[Block, list[Finding]], None]
    ) -> Continuity:
        """Calls back with each block of a topic, its required columns in SI, and what is wrong in
        the stream.

        A refused block is reported on ``/diagnostics`` and in the log, and dropped.

        Parameters
        ----------
        required
            Full SI names without time; empty takes the block as it comes.
        """
        continuity = Continuity()
        told: set[str] = set()
        worked_off = self.worked_off(topic)

        def receive(message: bytes, info: MessageInfo) -> None:
            take(message)
            worked_off(info)

        def take(message: bytes) -> None:
            try:
                block = unpack(message)
                _, notes = block.in_si()
                for note in notes:
                    if note not in told:
                        told.add(note)
                        self.get_logger().warning(f"{topic}: {note}")
                        self.health(f"{topic} units", WARN, note)
                block = require_columns(block, tuple(required), topic) if required else block
            except BlockError as error:
                text = str(error) if str(error).startswith(topic) else f"{topic}: {error}"
                if text not in told:
                    told.add(text)
                    self.get_logger().error(text)
                self.health(f"{topic} blocks", ERROR, text)
                return
            findings = continuity.check(block.data)
            for finding in findings:
                self.get_logger().warning(f"{topic}: {finding.message}", throttle_duration_sec=1.0)
                self.health(topic, WARN, finding.message)
            self.count(f"{topic} missing samples", continuity.missing)
            callback(block, findings)

        # rclpy passes the info to a callback of two arguments; its annotation knows one.
        with_info: Any = receive
        self.create_subscription(Float64MultiArray, topic, with_info, BLOCK_QOS, raw=True)
        return continuity

    def worked_off(self, topic: str) -> Callable[[MessageInfo], None]:
        """A function to call with the info of each message of a topic that this node is done with.

        DDS confirms that a message reached the reader's queue, not that the reader got to it: a
        replay at full speed would overrun the queue of 64 if it did not hear this. The message says
        who reads, and when the message that it got to was sent [ns].
        """
        publisher = self.create_publisher(
            String, self.resolve_topic_name(topic) + WORKED_OFF, WORKED_OFF_QOS
        )
        reader = f"{self.get_fully_qualified_name()} {os.getpid()}-{id(publisher)}"

        def tell(info: MessageInfo) -> None:
            self._taken = (info["source_timestamp"], time.monotonic())
            publisher.publish(String(data=f"{reader} {info['source_timestamp']}"))

        return tell

    def when_read(self, topic: str, readers: int, begin: Callable[[], None]) -> None:
        """Call `begin` once as many readers are connected to a block topic of this node; at once
        for 0.

        A graph whose nodes start in any order loses no block at its beginning when each node takes
        its input only after its own output is read.
        """
        if readers <= 0:
            begin()
            return
        publisher = self._block_publishers[topic]
        asked_at = time.monotonic()

        def look() -> None:
            connected = publisher.get_subscription_count()
            if connected >= readers:
                timer.cancel()
                begin()
            elif time.monotonic() - asked_at > 5.0:
                self.health(topic, WARN, f"waiting for {readers} readers, {connected} connected")

        timer = self.create_timer(
            READERS_POLL_PERIOD, look, clock=Clock(clock_type=ClockType.STEADY_TIME)
        )

    def work_off(self, executor: SingleThreadedExecutor) -> None:
        """Take the blocks that were sent before now and still wait in this node's queues."""
        told, begin = time.time_ns(), time.monotonic()
        while rclpy.ok() and time.monotonic() < begin + HAND_OVER_TIME:
            executor.spin_once(timeout_sec=STOP_POLL_PERIOD)
            sent, taken = self._taken
            if sent > told or time.monotonic() > max(taken, begin) + QUIET_TIME:
                return
        self.get_logger().warning(f"stopped with blocks still waiting after {HAND_OVER_TIME:g} s")

    def hand_over(self) -> None:
        """Give the readers time to take the last blocks; says so where they did not."""
        deadline = time.monotonic() + HAND_OVER_TIME
        for topic, publisher in self._block_publishers.items():
            left = max(deadline - time.monotonic(), 0.0)
            if rclpy.ok() and not publisher.wait_for_all_acked(Duration(seconds=left)):
                self.get_logger().warning(
                    f"{topic}: readers did not confirm the last blocks within {HAND_OVER_TIME:g} s"
                )

    def now(self) -> float:
        """ROS time [s]."""
        return self.get_clock().now().nanoseconds * 1e-9

    def health(self, what: str, level: bytes, message: str) -> None:
        """State the health of one thing; a warning or error is shown for at least ten seconds."""
        now = time.monotonic()
        before = self._health.get(what)
        self._health[what] = (level, message, now)
        news = level != OK and (before is None or before[0] == OK or now - before[2] > HEALTH_SHOWN)
        if news and now - self._health_told > NEWS_PERIOD:
            self._publish_health()

    def count(self, what: str, value: object) -> None:
        """A figure that is shown with the node's health."""
        self._counters[what] = str(value)

    def _publish_health(self) -> None:
        now = self._health_told = time.monotonic()
        shown = [
            (what, level, message)
            for what, (level, message, when) in self._health.items()
            if now - when < HEALTH_SHOWN
        ]
        bad = [(level, f"{what}: {message}") for what, level, message in shown if level != OK]
        level = max((entry[0] for entry in bad), default=OK)
        text = "; ".join(message for _, message in sorted(bad, reverse=True)) or "running"
        status = DiagnosticStatus(level=level, name=self.get_name(), message=text, hardware_id="")
        status.values = [KeyValue(key=key, value=value) for key, value in self._counters.items()]
        array = DiagnosticArray(status=[status])
        array.header.stamp = self.get_clock().now().to_msg()
        self._diagnostics.publish(array)


def _descriptor(parameter: Quantity) -> ParameterDescriptor:
    text = " ".join(part for part in (parameter.description, parameter.source) if part)
    unit = f" [{parameter.unit}]" if parameter.unit else ""
    # dynamic_typing: rclpy would refuse `amplitude:=1` for a float before our own check can say
    # why.
    descriptor = ParameterDescriptor(
        description=f"{text}{unit}", dynamic_typing=True, read_only=False
    )
    descriptor.additional_constraints = f"allowed: {parameter.allowed}" + (
        "; at start only" if parameter.start_only else ""
    )
    return descriptor


def run(make: Callable[[], AnkleNode], arguments: Sequence[str] | None = None) -> int:
    """Start rclpy, spin the node until it is told to stop, and clean up.

    Discovery stays on this host unless the environment says otherwise.

    Returns
    -------
    int
        Exit code: 0 after a stop by signal or by the node itself, 1 after an error, which is one
        line on stderr.
    """
    os.environ.setdefault("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    # rclpy's own handlers would close the context at once, with the last blocks still on their way.
    rclpy.init(
        args=None if arguments is None else list(arguments),
        signal_handler_options=SignalHandlerOptions.NO,
    )
    told_to_stop = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: told_to_stop.set())
    node: AnkleNode | None = None
    try:
        node = make()
        executor = SingleThreadedExecutor()
        executor.add_node(node)
        while rclpy.ok() and not told_to_stop.is_set():
            executor.spin_once(timeout_sec=STOP_POLL_PERIOD)
        node.work_off(executor)
        node.hand_over()
    except (KeyboardInterrupt, ExternalShutdownException):
        pass
    except (QuantityError, ValueError, OSError) as error:
        print(f"error: {error}", file=sys.stderr, flush=True)
        return 1
    finally:
        if node is not None:
            node.destroy_node()
        rclpy.try_shutdown()
    return 0
