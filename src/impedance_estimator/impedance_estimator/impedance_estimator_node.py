"""Online estimates of intrinsic and reflex impedance.

| topic | type | |
| --- | --- | --- |
| `/ankle/samples` | Float64MultiArray | in: t, position, torque, and velocity where it is measured |
| `/impedance/estimate` | Float64MultiArray | out: one row every 1 / `estimate_rate` of sample time |
| `/impedance/reflex_irf` | Float64MultiArray | out: reflex impulse response, twice a second |
| `/diagnostics` | DiagnosticArray | out: why estimates are not valid, missing samples |
"""  # noqa: E501

from __future__ import annotations

import sys
import time

from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Value
from ankle_interfaces.topics import ANKLE_SAMPLES, IMPEDANCE_ESTIMATE, IMPEDANCE_REFLEX_IRF
from ankle_node.node import ERROR, OK, WARN, AnkleNode, run
from impedance_estimator.parameters import PARAMETERS, WAIT_FOR_READERS, settings_from
from impedance_estimator.stream import EstimateStream, compile_estimator


class ImpedanceEstimator(AnkleNode):
    """Feeds the estimator with blocks and publishes what becomes due."""

    def __init__(self) -> None:
        super().__init__("impedance_estimator", PARAMETERS)
        self._values = {parameter.name: self.value(parameter.name) for parameter in PARAMETERS}
        self._stream = self._make_stream(self._values)
        self._reason: str | None = None
        self._was_valid = False
        self._compile()
        self._publish_estimate = self.block_publisher(IMPEDANCE_ESTIMATE)
        self._publish_response = self.block_publisher(IMPEDANCE_REFLEX_IRF)
        self.when_read(
            IMPEDANCE_ESTIMATE, int(self._values[WAIT_FOR_READERS.name]), self._subscribe
        )

    def _compile(self) -> None:
        algorithm, begin = str(self._values["algorithm"]), time.monotonic()
        self.get_logger().info(f"compiling {algorithm} (once: about 20 s, simultaneous 40 s)")
        compile_estimator(algorithm)
        self.get_logger().info(f"{algorithm} ready after {time.monotonic() - begin:.1f} s")

    def _subscribe(self) -> None:
        self.block_subscription(ANKLE_SAMPLES, self._receive)

    def _make_stream(self, values: dict[str, Value]) -> EstimateStream:
        try:
            return EstimateStream(str(values["algorithm"]), settings_from(values))
        except ValueError as error:
            raise QuantityError(str(error)) from None

    def parameters_changed(self, values: dict[str, Value]) -> None:
        changed = {**self._values, **values}
        if changed != self._values:
            self._stream = self._make_stream(changed)
            self._was_valid = False
            another = changed["algorithm"] != self._values["algorithm"]
            self._values = changed
            if another:
                self._compile()
            self.get_logger().info(
                "estimator starts anew: "
                f"{', '.join(f'{name} = {value}' for name, value in values.items())}"
            )

    def _receive(self, block: Block, findings: list[Finding]) -> None:
        try:
            due = self._stream.feed(block)
        except ValueError as error:
            self.get_logger().error(f"{ANKLE_SAMPLES.name}: {error}", throttle_duration_sec=5.0)
            self.health("samples", ERROR, str(error))
            return
        for note in due.notes:
            self.get_logger().info(note)
        for row in due.rows:
            self._publish_estimate(row[None])
        for _, response in due.responses:
            self._publish_response(response)
        reason = self._stream.reason
        self.count("estimate", f"not valid: {reason}" if reason else "valid")
        # Before the first valid estimate nothing is wrong: the memory is being filled.
        self._was_valid |= not reason
        lost = bool(reason) and self._was_valid
        self.health("estimate", WARN if lost else OK, f"not valid: {reason}")
        if reason != self._reason:
            self.get_logger().info(
                f"estimates are not valid: {reason}" if reason else "estimates are valid"
            )
            self._reason = reason


def main() -> None:
    """Entry point of ``ros2 run impedance_estimator impedance_estimator``."""
    sys.exit(run(ImpedanceEstimator))
