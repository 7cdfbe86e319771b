"""The other end of the line as a node: the simulated ankle behind the protocol, with its own clock
and faults.

| topic | direction | type | rate | content |
| --- | --- | --- | --- | --- |
| /diagnostics | out | DiagnosticArray | 1 Hz | state, fault and refused packets of the rig |

    ros2 run rig_emulator rig_emulator --ros-args -p K:=80.0 -p faults:=drop=0.01

Everything else goes by the line (docs/rig_protocol.md). At the next port it takes fault switches
while it runs (`rig_emulator.faults`), one datagram of text each, and answers with the switches that
are on, or with what was wrong. Parameters: `rig_emulator.settings`.
"""

from __future__ import annotations

import threading
from collections.abc import Mapping

from ankle_actuator_driver.link.protocol.packet import read_key
from ankle_actuator_driver.link.protocol.transport import UdpTransport
from ankle_interfaces.quantity import Quantity, Value
from ankle_node.node import AnkleNode, run
from ankle_node.real_time import RIG_PRIORITY, keep_loaded_objects, take_priority
from ankle_physics.model import Model
from ankle_sim.parameters import RIG
from ankle_sim.start_values import start_value
from rig_emulator.emulated_rig import EmulatedRig
from rig_emulator.settings import (
    FOOT,
    MODEL,
    PARAMETERS,
    joint_parameters,
    load_model,
    settings_from,
)

NAME = "rig_emulator"
REPORT_PERIOD = 1.0  # s


def _declared_for(model: Model) -> list[Quantity]:
    """Return the parameters of an emulator with a joint."""
    return [*PARAMETERS, *(parameter for parameter, _, _ in joint_parameters(model).values())]


def declared_parameters(values: Mapping[str, Value]) -> list[Quantity]:
    """Return the parameters that the node declares for start values, by which its joint is
    found.
    """
    chosen = {which.name: values.get(which.name, which.default) for which in (MODEL, RIG, FOOT)}
    return _declared_for(_load(chosen))


def _load(chosen: Mapping[str, Value]) -> Model:
    return load_model(str(chosen[MODEL.name]), str(chosen[RIG.name]), bool(chosen[FOOT.name]))


class RigEmulatorNode(AnkleNode):
    """Runs an `EmulatedRig` in a thread of its own.

    Parameters
    ----------
    model
        The joint; its values are the defaults of the model's parameters.
    """

    def __init__(self, model: Model) -> None:
        declared = _declared_for(model)
        super().__init__(NAME, declared)
        values: dict[str, Value] = {
            parameter.name: self.value(parameter.name) for parameter in declared
        }
        settings = settings_from(values, model, read_key(str(values["key_file"])))
        address, port = str(values["address"]), int(values["port"])
        self.get_logger().info("preparing (compiles the simulation at the first start, about 20 s)")
        line = UdpTransport((address, port), None)
        switches = UdpTransport((address, port + 1), None)
        self._rig = EmulatedRig(settings, line, switches, self._say)
        self._ended = threading.Event()
        self._failure: Exception | None = None
        self._failed = self.create_guard_condition(self._raise_failure)
        keep_loaded_objects()
        if refusal := take_priority(RIG_PRIORITY):
            self.get_logger().warning(refusal)
        self._thread = threading.Thread(target=self._run, name="rig", daemon=True)
        self._thread.start()
        self.create_timer(REPORT_PERIOD, self._report)
        self._say(f"listening at UDP {address}:{port}")

    def _say(self, sentence: str) -> None:
        self.get_logger().info(sentence)

    def _run(self) -> None:
        try:
            self._rig.run(self._ended)
        except Exception as error:
            self._failure = error
            self._failed.trigger()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _report(self) -> None:
        device = self._rig.device
        self.count("state", device.state.name.lower())
        self.count("fault", device.fault.name.lower())
        self.count("packets refused", sum(list(device.refusals.values())))

    def destroy_node(self) -> None:
        """End the emulated rig and the node."""
        self._ended.set()
        self._thread.join(timeout=2.0)
        self._rig.close()
        super().destroy_node()


def make() -> RigEmulatorNode:
    """Return the node with the model that its parameter names."""
    return RigEmulatorNode(
        _load({which.name: start_value(NAME, which) for which in (MODEL, RIG, FOOT)})
    )


def main() -> int:
    """Start the node: the entry point of ``ros2 run rig_emulator rig_emulator``."""
    return run(make)


if __name__ == "__main__":
    raise SystemExit(main())
