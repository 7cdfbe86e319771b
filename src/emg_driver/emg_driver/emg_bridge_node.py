"""EMG from any amplifier that speaks Lab Streaming Layer.

| topic | direction | type | rate | columns |
| --- | --- | --- | --- | --- |
| a Lab Streaming Layer stream | in | chosen by name, type or source id | | channels chosen by label or index |
| emg/samples | out | Float64MultiArray | 64 Hz | t[s],SOL[V],TA[V],GL[V],GM[V]; NaN where a channel is bad |
| /diagnostics | out | DiagnosticArray | 1 Hz | stream, missing samples, drift, bad electrodes |

It looks for the stream until it is there, and again when it is lost. Parameters: `emg_driver.settings`.
"""  # noqa: E501

from __future__ import annotations

import sys
import time

import pylsl
from rclpy.clock import Clock, ClockType

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Value
from ankle_interfaces.topics import EMG_SAMPLES, MUSCLES
from ankle_node.node import ERROR, OK, WARN, AnkleNode, run
from emg_driver.backlog import Backlog
from emg_driver.bridge import EmgBridge
from emg_driver.clock_mapping import ClockDifference
from emg_driver.errors import StreamRefused
from emg_driver.lsl_source import Chunk, Connected, Lost, LslSource, Searching, predicate
from emg_driver.settings import BRIDGE, electrodes_from
from emg_driver.stream_description import parse_channels

PARAMETERS = BRIDGE
# Silent for so long, the stream is looked for anew: a sender that died without closing its
# connection.
SILENCE_TIMEOUT = 5.0  # s
LOOK_PERIOD = 0.1  # s; silence is seen after `silence` and this


class EmgBridgeNode(AnkleNode):
    """Wires a stream to its topic."""

    def __init__(self) -> None:
        super().__init__("emg_bridge", PARAMETERS)
        self._values = {parameter.name: self.value(parameter.name) for parameter in PARAMETERS}
        try:
            parse_channels(self.text("channels"))
        except StreamRefused as error:
            raise QuantityError(f"parameter 'channels' is refused: {error}") from None
        self._bridge: EmgBridge | None = None
        self._session = ""
        self._last = float("-inf")
        self._heard = self._asked = time.monotonic()
        self._connections = self._missing = self._samples = 0
        self._backlog = Backlog()
        self._publish = self.block_publisher(EMG_SAMPLES)
        self._source: LslSource | None = None
        self._ros_minus_lsl = ClockDifference(self.now, pylsl.local_clock)
        self._wake = self.create_guard_condition(self._take_events)
        self.create_timer(LOOK_PERIOD, self._look, clock=Clock(clock_type=ClockType.STEADY_TIME))
        self.when_read(EMG_SAMPLES, int(self.number("wait_for_readers")), self._begin)

    def parameters_changed(self, values: dict[str, Value]) -> None:
        """Apply changed limits of electrodes from the next connection on."""
        self._values = {**self._values, **values}

    def destroy_node(self) -> None:
        """Close the stream first."""
        if self._source is not None:
            self._source.stop()
        super().destroy_node()

    def _begin(self) -> None:
        wanted = predicate(
            self.text("stream_name"), self.text("stream_type"), self.text("stream_source_id")
        )
        self.get_logger().info(f"looking for a stream with {wanted}")
        self._source = LslSource(wanted, self._wake.trigger)

    def _take_events(self) -> None:
        while self._source is not None and not self._source.events.empty():
            event = self._source.events.get()
            try:
                self._take(event)
            except StreamRefused as error:
                self._bridge = None
                self._tell("stream", ERROR, f"refused: {error}")
                self._source.drop()

    def _take(self, event: object) -> None:
        if isinstance(event, Searching):
            self._tell("stream", ERROR, f"no stream with {event.predicate} in the network")
        elif isinstance(event, Lost):
            self._bridge = None
            self._tell("stream", ERROR, f"lost: {event.reason}")
        elif isinstance(event, Connected):
            self._connect(event)
        elif isinstance(event, Chunk) and self._bridge is not None:
            self._heard = time.monotonic()
            self._forward(self._bridge, event)

    def _connect(self, event: Connected) -> None:
        assert self._source is not None
        stream = event.stream
        again = self._session and stream.session != self._session
        self._session = stream.session
        self._heard = time.monotonic()
        self._bridge = EmgBridge(
            stream,
            self.text("channels"),
            self.text("unit"),
            self.number("rate"),
            electrodes_from(self._values),
            self._ros_minus_lsl,
            self._last,
        )
        self._connections += 1
        if again:
            self._tell(
                "stream",
                WARN,
                f"{stream.title} started anew, with a new clock; samples were lost in between",
            )
        self.get_logger().info(
            f"connected to {stream.title}: {len(stream.labels)} channels at {stream.rate:g} Hz"
        )

    def _forward(self, bridge: EmgBridge, chunk: Chunk) -> None:
        before = bridge.samples, bridge.missing
        bridged = bridge.feed(chunk)
        for note in bridged.notes:
            muscle, _, defect = note.partition(": ")
            if muscle in MUSCLES:
                self._tell(muscle, ERROR, defect)
            else:
                self._tell("samples", WARN, note)
        self._backlog.add(bridged.blocks)
        self._hand_out()
        self._last = bridge.last
        self._samples += bridge.samples - before[0]
        self._missing += bridge.missing - before[1]
        if bridged.blocks:
            self.health("stream", OK, "")
            self.count("samples", self._samples)
            self.count("missing samples", self._missing)
            self.count("connections", self._connections)
            self.count("drift of the stream's clock [ppm]", f"{1e6 * bridge.drift:.1f}")
            self.count(
                "bad electrodes",
                ", ".join(muscle for muscle, bad in bridge.bad.items() if bad) or "none",
            )

    def _hand_out(self) -> None:
        for block in self._backlog.due(time.monotonic()):
            self._publish(block)

    def _look(self) -> None:
        """State whether samples come."""
        self._hand_out()
        silent = time.monotonic() - self._heard
        if self._source is None or self._bridge is None or silent < self.number("silence"):
            return
        self._tell("stream", ERROR, f"{self._bridge.stream.title} sends nothing for {silent:.1f} s")
        if silent > SILENCE_TIMEOUT and time.monotonic() - self._asked > SILENCE_TIMEOUT:
            self._asked = time.monotonic()
            self._bridge = None
            self._source.drop()

    def _tell(self, what: str, level: bytes, sentence: str) -> None:
        self.get_logger().warning(f"{what}: {sentence}", throttle_duration_sec=1.0)
        self.health(what, level, sentence)


def main() -> None:
    """Start the node: the entry point of ``ros2 run emg_driver emg_bridge``."""
    sys.exit(run(EmgBridgeNode))
