"""Publish a signal of your own: the mean torque of each block of samples.

    ankle up simulated &
    python examples/publish_mean_torque_node.py &
    ankle echo /ankle/mean_torque -n 1

| topic | direction | type | columns |
| --- | --- | --- | --- |
| ankle/samples | in | Float64MultiArray | t[s],torque[N.m] |
| ankle/mean_torque | out | Float64MultiArray | t[s],mean_torque[N.m] |
"""

import sys

from ankle_interfaces.block import MESSAGE_TYPE, Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.topics import ANKLE_SAMPLES, Delivery, Topic
from ankle_node.node import AnkleNode, run

MEAN_TORQUE = Topic(
    "ankle/mean_torque",
    MESSAGE_TYPE,
    Delivery.BLOCKS,
    "Mean torque of each block of samples.",
    rate=64.0,
    columns=("t[s]", "mean_torque[N.m]"),
)


class PublishMeanTorque(AnkleNode):
    """Reads blocks of samples, publishes one row for each."""

    def __init__(self) -> None:
        super().__init__("publish_mean_torque", [])
        self._publish = self.block_publisher(MEAN_TORQUE)
        self.block_subscription(ANKLE_SAMPLES, self._average, ["torque[N.m]"])

    def _average(self, block: Block, findings: list[Finding]) -> None:
        self._publish(block.data.mean(axis=0, keepdims=True))


if __name__ == "__main__":
    sys.exit(run(PublishMeanTorque))
