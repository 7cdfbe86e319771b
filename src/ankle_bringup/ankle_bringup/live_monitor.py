"""What a running graph says of itself: latest estimate, true values, lost samples, latency."""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from ankle_interfaces.block import Block, unpack
from ankle_interfaces.continuity import Continuity
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    ANKLE_TRUTH,
    IMPEDANCE_ESTIMATE,
    PERTURBATION_REFERENCE,
)
from ankle_node.block_executor import BlockExecutor
from ankle_node.node import BLOCK_QOS

ESTIMATE = IMPEDANCE_ESTIMATE.name
SAMPLES = ANKLE_SAMPLES.name
REFERENCE = PERTURBATION_REFERENCE.name
TRUTH = ANKLE_TRUTH.name
ONE_MORE_READER = (
    "perturbation_generator.wait_for_readers=4",
    "ankle_sim.wait_for_readers=3",
    "impedance_estimator.wait_for_readers=2",
)
"""Settings of the graph `simulated_recorded` when a monitor reads along: nothing starts before the
monitor hears it.
"""


@dataclass
class Stream:
    """Holds what the monitor knows of one topic."""

    continuity: Continuity = field(default_factory=Continuity)
    blocks: int = 0
    samples: int = 0
    last: Block | None = None


class LiveMonitor:
    """Subscribes to the graph's main topics as any other reader would.

    Parameters
    ----------
    node
        A node made by `ankle_bringup.live_graph.observer`.
    topics
        The topics to follow.
    """

    def __init__(
        self, node: Node, topics: tuple[str, ...] = (ESTIMATE, SAMPLES, REFERENCE, TRUTH)
    ) -> None:
        # rclpy.spin_once would build an executor at each call, too slow for 256 messages a second
        # on a busy machine.
        self._executor = BlockExecutor()
        self._executor.add_node(node)
        self.streams = {topic: Stream() for topic in topics}
        self.latencies: list[float] = []
        """From the time of the last sample in an estimate to its arrival here [s]."""
        self.reference_latencies: list[float] = []
        """From the time of the last sample in a block of the reference to its arrival here [s]."""
        for topic in topics:
            node.create_subscription(
                Float64MultiArray, topic, self._reader(topic), BLOCK_QOS, raw=True
            )

    def _reader(self, topic: str) -> Callable[[bytes], None]:
        stream = self.streams[topic]
        measured = topic in (SAMPLES, REFERENCE)

        def receive(message: bytes) -> None:
            block = unpack(message)
            stream.blocks += 1
            stream.samples += len(block.data)
            stream.last = block
            if measured:
                stream.continuity.check(block.data)
            if topic == ESTIMATE and len(block.data):
                self.latencies.append(time.time() - float(block.time[-1]))
            elif topic == REFERENCE:
                self.reference_latencies.append(time.time() - float(block.time[-1]))

        return receive

    def spin(self, seconds: float) -> None:
        """Process what arrives during the next seconds."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def latest(self, topic: str, column: str) -> float:
        """Return the last value of a column, NaN before the first block."""
        block = self.streams[topic].last
        return (
            float(block.column(column)[-1])
            if block is not None and len(block.data)
            else float("nan")
        )

    @property
    def missing(self) -> int:
        """Return the number of samples missing so far in the sampled topics."""
        return sum(stream.continuity.missing for stream in self.streams.values())
