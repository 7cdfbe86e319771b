"""Show K live: a node that reads the estimates of a running graph.

    ankle up simulated &
    python examples/listen_to_k_node.py

| topic | direction | type |
| --- | --- | --- |
| impedance/estimate | in | Float64MultiArray |
"""

import sys

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.quantity import Quantity
from ankle_interfaces.topics import IMPEDANCE_ESTIMATE
from ankle_node.node import AnkleNode, run

COUNT = Quantity("count", "1", 0, 10**9, 0, description="Ends after so many blocks; 0 goes on.")


class ListenToK(AnkleNode):
    """Prints each valid K."""

    def __init__(self) -> None:
        super().__init__("listen_to_k", [COUNT])
        self._left = int(self.number(COUNT.name)) or -1
        self.block_subscription(IMPEDANCE_ESTIMATE, self._show, ["K[N.m/rad]", "valid[1]"])

    def _show(self, block: Block, findings: list[Finding]) -> None:
        t, K, valid = block.data[-1]
        print(f"{t:.3f} s: K = {K:.1f} N.m/rad{'' if valid else ' (not valid)'}", flush=True)
        self._left -= 1
        if self._left == 0:
            raise SystemExit(0)


if __name__ == "__main__":
    sys.exit(run(ListenToK))
