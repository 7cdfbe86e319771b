"""Online estimates of intrinsic and reflex impedance.

| topic | type | |
| --- | --- | --- |
| `/ankle/samples` | Float64MultiArray | in: t, position, torque, velocity if measured |
| `/perturbation/reference` | Float64MultiArray | in: t and position, the instrument |
| `/impedance/estimate` | Float64MultiArray | out: a row every 1 / `estimate_rate` of sample time |
| `/impedance/reflex_irf` | Float64MultiArray | out: reflex response of a muscle, and beyond it |
| `/impedance/tracked` | Float64MultiArray | out: gains that the model tracks, twice a second |
| `/impedance/provenance` | String | out, latched: estimator, settings, model and rig |
| `/impedance/model` | String | out, latched: the text of the model's file |
| `/diagnostics` | DiagnosticArray | out: why estimates are not valid or doubted, missing samples |
"""

from __future__ import annotations

import sys
import time

from std_msgs.msg import Float64MultiArray, String

from ankle_interfaces.block import TIME_COLUMN, Block, pack
from ankle_interfaces.continuity import Finding
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Value
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    IMPEDANCE_ESTIMATE,
    IMPEDANCE_MODEL,
    IMPEDANCE_PROVENANCE,
    IMPEDANCE_REFLEX_IRF,
    IMPEDANCE_TRACKED,
    PERTURBATION_REFERENCE,
)
from ankle_node.node import ERROR, LATEST_QOS, OK, WARN, AnkleNode, run
from ankle_node.qos import publisher_qos
from ankle_physics.own_terms import load_terms
from impedance_estimator.known_physics import load_known_physics
from impedance_estimator.live_estimates import Compilation, LiveEstimates
from impedance_estimator.parameters import (
    MODEL,
    PARAMETERS,
    RIG,
    TERMS,
    WAIT_FOR_READERS,
    settings_from,
)
from impedance_estimator.provenance import model_text, provenance
from impedance_estimator.stream import Estimates, EstimateStream, compile_estimator


class ImpedanceEstimator(AnkleNode):
    """Feeds the estimator with blocks and publishes what becomes due."""

    def __init__(self) -> None:
        super().__init__("impedance_estimator", PARAMETERS)
        self._values = {parameter.name: self.value(parameter.name) for parameter in PARAMETERS}
        self._live = LiveEstimates(self._make_stream(self._values))
        self._compilation: Compilation | None = None
        self._reason: str | None = None
        self._was_valid = False
        self._compile()
        self._publish_estimate = self.block_publisher(IMPEDANCE_ESTIMATE)
        self._publish_response = self.block_publisher(IMPEDANCE_REFLEX_IRF)
        # Its columns are those of the model, which may change.
        self._tracked = self.create_publisher(
            Float64MultiArray, IMPEDANCE_TRACKED.name, publisher_qos(IMPEDANCE_TRACKED)
        )
        self._provenance = self.create_publisher(String, IMPEDANCE_PROVENANCE.name, LATEST_QOS)
        self._model = self.create_publisher(String, IMPEDANCE_MODEL.name, LATEST_QOS)
        self._state_provenance()
        self.when_read(
            IMPEDANCE_ESTIMATE, int(self._values[WAIT_FOR_READERS.name]), self._subscribe
        )

    def _state_provenance(self) -> None:
        self._model.publish(String(data=model_text(self._live.stream)))
        self._provenance.publish(String(data=provenance(self._live.stream)))

    def _compile(self) -> None:
        algorithm, begin = str(self._values["algorithm"]), time.monotonic()
        self.get_logger().info(
            f"compiling {algorithm} (once; the simultaneous estimator takes about two minutes)"
        )
        compile_estimator(algorithm)
        self.get_logger().info(f"{algorithm} ready after {time.monotonic() - begin:.1f} s")

    def _subscribe(self) -> None:
        self.block_subscription(PERTURBATION_REFERENCE, self._receive_reference)
        self.block_subscription(ANKLE_SAMPLES, self._receive)

    def _receive_reference(self, block: Block, findings: list[Finding]) -> None:
        self._live.feed_reference(block)
        due, taken_over = self._live.release()
        if len(due.rows) or due.notes:
            self._publish(due, taken_over)

    def _make_stream(self, values: dict[str, Value]) -> EstimateStream:
        try:
            load_terms(str(values[TERMS.name]))
            known = load_known_physics(str(values[MODEL.name]), str(values[RIG.name]))
            return EstimateStream(str(values["algorithm"]), settings_from(values), known)
        except (ValueError, OSError) as error:
            raise QuantityError(str(error)) from None

    def parameters_changed(self, values: dict[str, Value]) -> None:
        """Make an estimator with the new values; it takes over when it has settled."""
        changed = {**self._values, **values}
        if changed == self._values:
            return
        successor = self._make_stream(changed)
        another = successor.algorithm != self._live.stream.algorithm
        self._values = changed
        if self._compilation is not None:
            self._compilation.stop()
        self._compilation = Compilation(successor.algorithm) if another else None
        self._live.replace(successor, self._compiled)
        self.get_logger().info(
            f"{', '.join(f'{name} = {value}' for name, value in values.items())}: a new estimator "
            "settles beside the present one and takes over"
        )

    def _compiled(self) -> bool:
        """Say whether the successor's algorithm is compiled; it is then loaded from the cache."""
        if self._compilation is None:
            return True
        if not self._compilation.finished:
            return False
        compile_estimator(self._compilation.algorithm)
        self._compilation = None
        return True

    def destroy_node(self) -> None:
        """End a compilation that still runs, then the node."""
        if self._compilation is not None:
            self._compilation.stop()
        super().destroy_node()

    def _receive(self, block: Block, findings: list[Finding]) -> None:
        try:
            due, taken_over = self._live.feed(block)
        except ValueError as error:
            self.get_logger().error(f"{ANKLE_SAMPLES.name}: {error}", throttle_duration_sec=5.0)
            self.health("samples", ERROR, str(error))
            return
        self._publish(due, taken_over)

    def _publish(self, due: Estimates, taken_over: bool) -> None:
        for note in due.notes:
            self.get_logger().info(note)
        for row in due.rows:
            self._publish_estimate(row[None])
        for _, response in due.responses:
            self._publish_response(response)
        stream = self._live.stream
        if len(due.tracked) and stream.tracked_columns:
            columns = (TIME_COLUMN, *stream.tracked_columns)
            self._tracked.publish(pack(Block(columns, due.tracked)))
        if taken_over:
            self.get_logger().info(f"{stream.algorithm}: the new estimator has taken over")
            self._state_provenance()
        reason = stream.reason
        self.count("estimate", f"not valid: {reason}" if reason else "valid")
        self.count("algorithm", stream.algorithm)
        self.count("known physics", stream.known.describe() if stream.known else "none")
        if stream.reflex_deviation:
            self.count("reflex beyond a muscle's response", stream.reflex_deviation)
        if stream.instrument:
            self.count("instrument", stream.instrument)
        # Before the first valid estimate nothing is wrong: the memory is being filled.
        self._was_valid |= not reason
        lost = bool(reason) and self._was_valid
        self.health("estimate", WARN if lost else OK, f"not valid: {reason}")
        doubts = "" if reason else stream.doubts
        self.health("model", WARN if doubts else OK, f"estimates are doubtful: {doubts}")
        rig = "; ".join(stream.rig_warnings)
        self.health("rig", WARN if rig else OK, rig)
        if reason != self._reason:
            self.get_logger().info(
                f"estimates are not valid: {reason}" if reason else "estimates are valid"
            )
            self._reason = reason


def main() -> None:
    """Start the node: the entry point of ``ros2 run impedance_estimator impedance_estimator``."""
    sys.exit(run(ImpedanceEstimator))
