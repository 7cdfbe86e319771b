"""EMG of a topic as a Lab Streaming Layer stream: a simulated amplifier, or a recorded session for
any program that reads LSL.

| topic | direction | type | |
| --- | --- | --- | --- |
| emg/samples | in | Float64MultiArray | t[s] and any of SOL[V],TA[V],GL[V],GM[V]; remap it where the bridge runs in the same graph |
| a Lab Streaming Layer stream | out | | one channel for each column, labels and units in its description |
| /diagnostics | out | DiagnosticArray | 1 Hz |

Samples are stamped with their own time, mapped to LSL's clock, on a clock that may drift on
purpose.
"""  # noqa: E501

from __future__ import annotations

import sys

import numpy as np
import pylsl

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding, sampling_rate
from ankle_interfaces.quantity import Quantity
from ankle_interfaces.topics import EMG_SAMPLES
from ankle_interfaces.units import split_column
from ankle_node.node import AnkleNode, run
from emg_driver.clock_mapping import ClockDifference

PARAMETERS = (
    Quantity(
        "stream_name",
        default="simulated amplifier",
        description="Name of the stream.",
        start_only=True,
    ),
    Quantity("stream_type", default="EMG", description="Type of the stream.", start_only=True),
    Quantity(
        "stream_source_id", default="", description="Source id of the stream.", start_only=True
    ),
    Quantity(
        "drift",
        "1",
        -1e-3,
        1e-3,
        0.0,
        description=(
            "Seconds per second by which the stamps lose time, as an amplifier's crystal does."
        ),
        start_only=True,
    ),
)
MICROVOLTS = 1e6  # amplifiers declare microvolts


class EmgOutletNode(AnkleNode):
    """Wires a topic to an outlet."""

    def __init__(self) -> None:
        super().__init__("emg_outlet", PARAMETERS)
        self._outlet: pylsl.StreamOutlet | None = None
        self._first = 0.0
        self._sent = 0
        self._ros_minus_lsl = ClockDifference(self.now, pylsl.local_clock)
        self.block_subscription(EMG_SAMPLES, self._take, (), EMG_SAMPLES.columns[1:])
        self.get_logger().info("ready")

    def _take(self, block: Block, findings: list[Finding]) -> None:
        if self._outlet is None:
            self._outlet = self._open(block)
            self._first = float(block.time[0])
        drifted = block.time - self.number("drift") * (block.time - self._first)
        stamps = drifted - self._ros_minus_lsl()
        # An amplifier sends at regular intervals, so one stamp for the chunk's last sample says
        # all; after a gap a new one.
        self._outlet.push_chunk(
            np.ascontiguousarray(MICROVOLTS * block.data[:, 1:], dtype=np.float32),
            float(stamps[-1]),
        )
        self._sent += len(block.time)
        self.count("samples", self._sent)

    def _open(self, block: Block) -> pylsl.StreamOutlet:
        names = [split_column(column)[0] for column in block.columns[1:]]
        info = pylsl.StreamInfo(
            self.text("stream_name"),
            self.text("stream_type"),
            len(names),
            sampling_rate(block.time),
            "float32",
            self.text("stream_source_id"),
        )
        channels = info.desc().append_child("channels")
        for name in names:
            channel = channels.append_child("channel")
            channel.append_child_value("label", name)
            channel.append_child_value("unit", "microvolts")
            channel.append_child_value("type", "EMG")
        return pylsl.StreamOutlet(info, len(block.time))


def main() -> None:
    """Start the node: the entry point of ``ros2 run emg_driver emg_outlet``."""
    sys.exit(run(EmgOutletNode))
