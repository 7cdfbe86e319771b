"""Background and reflex activity of four muscles for every onset of the perturbation.

| topic | direction | type | |
| --- | --- | --- | --- |
| emg/samples | in | Float64MultiArray | t[s],SOL[V],TA[V],GL[V],GM[V] |
| perturbation/reference | in | Float64MultiArray | t[s],position[rad]: onsets |
| ankle/samples | in | Float64MultiArray | t[s],velocity[rad/s]: onsets while there is no reference |
| emg/responses | out | Float64MultiArray | each onset: t[s],direction[1], background_SOL[V] ..., reflex_SOL[V.s] ... |
| emg/ensemble | out | Float64MultiArray | each second onset: lag[s],SOL[V],TA[V],GL[V],GM[V] |
| /diagnostics | out | DiagnosticArray | onsets, bad electrodes, missing samples |

The node advances by samples, never by timers. Parameters: `emg_driver.settings`.
"""  # noqa: E501

from __future__ import annotations

import math
import sys

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.quantity import Quantity, Value
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    EMG_ENSEMBLE,
    EMG_RESPONSES,
    EMG_SAMPLES,
    PERTURBATION_REFERENCE,
)
from ankle_node.node import ERROR, WARN, AnkleNode, run
from emg_driver.offline import POSITION, VELOCITY
from emg_driver.processor import EmgProcessor, Responses, warm_up
from emg_driver.settings import ELECTRODES, PROCESSING, settings_from

WAIT_FOR_READERS = Quantity(
    "wait_for_readers",
    "1",
    0,
    100,
    0,
    description="Readers of /emg/responses to wait for before the first block is taken.",
    start_only=True,
)
PARAMETERS = (*PROCESSING, *ELECTRODES, WAIT_FOR_READERS)
# The average of a hundred changes little with each; half the messages show the same.
RESPONSES_PER_ENSEMBLE = 2


class EmgProcessorNode(AnkleNode):
    """Wires an `EmgProcessor` to its topics."""

    def __init__(self) -> None:
        super().__init__("emg_processor", PARAMETERS)
        self._values = {parameter.name: self.value(parameter.name) for parameter in PARAMETERS}
        self._processor = EmgProcessor(settings_from(self._values))
        self._published = 0
        self._responses = self.block_publisher(EMG_RESPONSES)
        self._ensemble = self.block_publisher(EMG_ENSEMBLE)
        self.when_read(EMG_RESPONSES, int(self.number(WAIT_FOR_READERS.name)), self._begin)

    def parameters_changed(self, values: dict[str, Value]) -> None:
        """Start the processing anew with new settings."""
        changed = {**self._values, **values}
        if changed != self._values:
            self._processor = EmgProcessor(settings_from(changed))
            self._values = changed
            self.get_logger().info(
                "processing starts anew: "
                f"{', '.join(f'{name} = {value}' for name, value in values.items())}"
            )

    def _begin(self) -> None:
        warm_up()
        self.block_subscription(PERTURBATION_REFERENCE, self._take_reference, (POSITION,))
        self.block_subscription(ANKLE_SAMPLES, self._take_motion, (VELOCITY,))
        self.block_subscription(EMG_SAMPLES, self._take_emg)
        self.get_logger().info("ready")

    def _take_reference(self, block: Block, findings: list[Finding]) -> None:
        self._publish(self._processor.feed_reference(block.data[:, 0], block.data[:, 1]))

    def _take_motion(self, block: Block, findings: list[Finding]) -> None:
        self._publish(self._processor.feed_motion(block.data[:, 0], block.data[:, 1]))

    def _take_emg(self, block: Block, findings: list[Finding]) -> None:
        try:
            self._publish(self._processor.feed_emg(block.data[:, 0], block.data[:, 1:]))
        except ValueError as error:
            self.get_logger().error(f"{EMG_SAMPLES.name}: {error}", throttle_duration_sec=5.0)
            self.health("EMG", ERROR, str(error))

    def _publish(self, due: Responses) -> None:
        for note in due.notes:
            self.get_logger().warning(note, throttle_duration_sec=1.0)
            what, _, sentence = note.partition(": ")
            self.health(what, WARN, sentence)
        for row in due.rows:
            self._responses(row[None])
            self._published += 1
            if self._published % RESPONSES_PER_ENSEMBLE == 0:
                self._ensemble(self._processor.ensemble())
        self.count("onsets", self._published)
        if not math.isnan(self._processor.lag):
            self.count(
                "lag of the plate behind its command [ms]", f"{1e3 * self._processor.lag:.1f}"
            )


def main() -> None:
    """Start the node: the entry point of ``ros2 run emg_driver emg_processor``."""
    sys.exit(run(EmgProcessorNode))
