"""What a running graph says of itself: latest estimate, true values, lost samples, latency."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection
from dataclasses import dataclass, field, replace

import numpy as np
from rclpy.node import Node
from std_msgs.msg import Float64MultiArray

from ankle_bringup.graph import Graph, NodeDescription
from ankle_interfaces.block import TIME_COLUMN, Block, unpack
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
MONITORED = (ESTIMATE, SAMPLES, REFERENCE, TRUTH)
"""Topics that a monitor reads unless others are named."""
VALID = "valid[1]"
WAITS_FOR_READERS = {
    "perturbation_generator": REFERENCE,
    "ankle_sim": SAMPLES,
    "ankle_actuator_driver": SAMPLES,
    "impedance_estimator": ESTIMATE,
}
"""Executables whose parameter `wait_for_readers` counts the readers of a topic of the monitor."""


def with_one_more_reader(graph: Graph, topics: Collection[str]) -> Graph:
    """Return the graph whose nodes wait for a monitor beside the readers that they wait for.

    Otherwise a node would count the monitor in place of a reader that is still starting, and that
    reader would lose the first blocks.

    Parameters
    ----------
    graph
        The graph that the monitor looks at.
    topics
        Topics that the monitor reads.
    """

    def waiting(node: NodeDescription) -> NodeDescription:
        readers = node.parameters.get("wait_for_readers")
        own = WAITS_FOR_READERS.get(node.executable, "")
        # A number that is none is refused by the node, with its allowed range.
        if not isinstance(readers, int) or readers < 1:
            return node
        if node.remappings.get(own, own) not in topics:
            return node
        return replace(node, parameters={**node.parameters, "wait_for_readers": readers + 1})

    return replace(graph, nodes=tuple(waiting(node) for node in graph.nodes))


@dataclass
class Stream:
    """Holds what the monitor knows of one topic."""

    continuity: Continuity = field(default_factory=Continuity)
    blocks: int = 0
    samples: int = 0
    last: Block | None = None


class LiveMonitor:
    """Subscribes to the graph's main topics as any other reader would, until it is closed.

    Parameters
    ----------
    node
        A node made by `ankle_bringup.live_graph.observer`.
    topics
        The topics to follow.
    """

    def __init__(self, node: Node, topics: tuple[str, ...] = MONITORED) -> None:
        # rclpy.spin_once would build an executor at each call, too slow for 256 messages a second
        # on a busy machine.
        self._executor = BlockExecutor()
        self._executor.add_node(node)
        self.streams = {topic: Stream() for topic in topics}
        self.latencies: list[float] = []
        """From the time of the last sample in an estimate to its arrival here [s]."""
        self.reference_latencies: list[float] = []
        """From the time of the last sample in a block of the reference to its arrival here [s]."""
        self.valid: Block | None = None
        """The last estimate that was valid, one row; None before the first one."""
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
                self.keep_valid(block)
            elif topic == REFERENCE:
                self.reference_latencies.append(time.time() - float(block.time[-1]))

        return receive

    def keep_valid(self, block: Block) -> None:
        """Keep the last row of a block of estimates that is valid, where there is one."""
        rows = np.flatnonzero(block.column(VALID) == 1.0)
        if len(rows):
            self.valid = Block(block.columns, block.data[rows[-1:]])

    def latest_valid(self, column: str) -> float:
        """Return a column of the last valid estimate, NaN before the first one."""
        return float("nan") if self.valid is None else float(self.valid.column(column)[-1])

    @property
    def since_valid(self) -> float:
        """Return the time from the last valid estimate to the last estimate [s]; NaN without."""
        return self.latest(ESTIMATE, TIME_COLUMN) - self.latest_valid(TIME_COLUMN)

    def close(self) -> None:
        """Let go of the node. Until then it stays in the graph as a reader of the topics, even
        behind the end of its observer, and another graph's nodes would count it.
        """
        self._executor.shutdown()

    def spin(self, seconds: float) -> None:
        """Process what arrives during the next seconds."""
        deadline = time.monotonic() + seconds
        while (left := deadline - time.monotonic()) > 0:
            self._executor.spin_once(timeout_sec=left)

    def latest(self, topic: str, column: str) -> float:
        """Return the last value of a column, NaN before the first block and for other topics."""
        block = self.streams[topic].last if topic in self.streams else None
        return (
            float(block.column(column)[-1])
            if block is not None and len(block.data)
            else float("nan")
        )

    @property
    def missing(self) -> int:
        """Return the number of samples missing so far in the sampled topics."""
        return sum(stream.continuity.missing for stream in self.streams.values())
