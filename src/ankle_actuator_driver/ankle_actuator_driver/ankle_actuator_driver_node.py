"""Between the graph and a rig's own real-time controller; the same topics as `ankle_sim`.

| topic or service | direction | type | rate | content |
| --- | --- | --- | --- | --- |
| perturbation/reference | in | Float64MultiArray | | t[s],position[rad],velocity[rad/s],acceleration[rad/s^2] |
| ankle/samples | out | Float64MultiArray | as the rig sends | t[s],position[rad],velocity[rad/s],torque[N.m] |
| joint_states | out | JointState, name `ankle` | each block | last sample |
| rig/state | out, latched | String | each change | `disabled`, `ready`, `armed`, `running`, `stopping` or `fault`, then `: reason` |
| session/event | out | String | each change | event `rig armed` and so on, with its reason |
| /diagnostics | out | DiagnosticArray | 1 Hz | rig's state, clock, packets refused and lost |
| ~/arm, ~/start, ~/stop, ~/disarm, ~/reset_fault | service | std_srvs/Trigger | | docs/safety.md |
| ~/change_state and others | service | lifecycle_msgs | | managed life cycle |

Parameters: `ankle_actuator_driver.settings`. Everything that decides is in `bridge` and
`safety_states`.
"""  # noqa: E501

from __future__ import annotations

import secrets
import time
from functools import partial

import numpy as np
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ankle_actuator_driver import settings
from ankle_actuator_driver.link.rig_session import News, RigSession
from ankle_actuator_driver.link.transport import UdpTransport, address_towards
from ankle_actuator_driver.safety.bridge import Bridge
from ankle_actuator_driver.safety.limits import LIMIT_PARAMETERS, hard_limits_from, limits_from
from ankle_actuator_driver.safety.states import State
from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Value
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    PERTURBATION_REFERENCE,
    RIG_STATE,
    SESSION_EVENT,
)
from ankle_node import session_event
from ankle_node.derived_topics import joint_states
from ankle_node.managed_node import ManagedNode
from ankle_node.node import ERROR, LATEST_QOS, WARN, run
from ankle_node.qos import publisher_qos

COMMANDS = ("arm", "start", "stop", "disarm", "reset_fault")
REPORT_PERIOD = 1.0  # s


class ActuatorDriverNode(ManagedNode):
    """Wires a `RigSession` to topics and services."""

    def __init__(self) -> None:
        super().__init__("ankle_actuator_driver", settings.PARAMETERS)
        values = self._values()
        self._hard = hard_limits_from(values)
        limits_from(values).require_within(self._hard)
        if self.get_parameter("use_sim_time").value:
            raise QuantityError("use_sim_time = True is refused: a rig moves in real time")
        self._session: RigSession | None = None
        self._failure: Exception | None = None
        self._failed = self.create_guard_condition(self._raise_failure)
        self._reported = 0.0
        self._samples = self.block_publisher(ANKLE_SAMPLES)
        self._joint = joint_states(self)
        self._state = self.create_publisher(String, RIG_STATE.name, LATEST_QOS)
        self._events = self.create_publisher(
            String, SESSION_EVENT.name, publisher_qos(SESSION_EVENT)
        )
        for name in COMMANDS:
            self.create_service(Trigger, f"~/{name}", partial(self._command, name))
        self.when_read(ANKLE_SAMPLES, int(self.number("wait_for_readers")), self._begin)

    def _values(self) -> dict[str, Value]:
        return {parameter.name: self.value(parameter.name) for parameter in settings.PARAMETERS}

    def _begin(self) -> None:
        self.block_subscription(
            PERTURBATION_REFERENCE, self._take, PERTURBATION_REFERENCE.columns[1:]
        )
        if self.value("autostart"):
            self.start()

    def configure(self) -> None:
        """Open the line."""
        rig = (self.text("rig_address"), int(self.number("rig_port")))
        local = (self.text("local_address") or address_towards(rig), int(self.number("local_port")))
        line = UdpTransport(local, rig)
        number = secrets.randbelow(2**32 - 1) + 1
        bridge = Bridge(
            limits_from(self._values()),
            self.number("soft_start"),
            self.number("reference_delay"),
            number,
        )
        self._session = RigSession(bridge, line, self.now, self._tell, self._fail)
        self.get_logger().info(
            f"the rig is at {rig[0]}:{rig[1]}, this side at {line.local[0]}:{line.local[1]}"
        )

    def activate(self) -> None:
        """Begin to talk to the rig; it stays off."""
        assert self._session is not None
        self._session.begin()

    def deactivate(self) -> None:
        """Bring the rig to rest and off, then fall silent."""
        if self._session is not None:
            self._session.end()

    def release(self) -> None:
        """Close the line."""
        session, self._session = self._session, None
        if session is not None:
            session.close()

    def destroy_node(self) -> None:
        """A node that is taken down leaves no plate in motion."""
        self.deactivate()
        self.release()
        super().destroy_node()

    def process_waiting(self, executor: SingleThreadedExecutor) -> None:
        """Told to stop: the rig first, then the blocks that still wait."""
        self.deactivate()
        super().process_waiting(executor)

    def parameters_changed(self, values: dict[str, Value]) -> None:
        """Limits hold from the next block on, and never beyond the hard ones; the soft start from
        the next start on.
        """
        wanted = limits_from(
            {p.name: values.get(p.name, self.value(p.name)) for p in LIMIT_PARAMETERS}
        )
        wanted.require_within(self._hard)
        soft_start = float(values.get("soft_start", self.number("soft_start")))

        def apply(bridge: Bridge) -> None:
            bridge.limits, bridge.soft_start = wanted, soft_start

        if self._session is not None:
            self._session.change(apply)

    def _command(
        self, name: str, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        if self._session is None:
            response.success, response.message = (
                name == "stop",
                f"{name}: the node is not configured, it drives no rig",
            )
        else:
            answer = self._session.operate(name)
            response.success, response.message = answer.done, answer.sentence
        self.get_logger().info(response.message)
        return response

    def _take(self, block: Block, findings: list[Finding]) -> None:
        if self._session is not None:
            self._session.refer(block.data)

    def _fail(self, error: Exception) -> None:
        """In the session's thread; the executor raises it, so that the process ends."""
        self._failure = error
        self._failed.trigger()

    def _raise_failure(self) -> None:
        if self._failure is not None:
            raise self._failure

    def _tell(self, news: News) -> None:
        for block in news.blocks:
            self._publish(block)
        for note in news.notes:
            self.get_logger().warning(note, throttle_duration_sec=1.0)
            self.health("rig", WARN, note)
        for state, reason in news.changes:
            text = f"{state.value}: {reason}" if reason else state.value
            self._state.publish(String(data=text))
            self._events.publish(
                String(
                    data=session_event.SessionEvent(
                        f"rig {state.value}", news.ros, {"reason": reason}
                    ).line()
                )
            )
            self.get_logger().info(f"rig {text}")
        if time.monotonic() - self._reported > REPORT_PERIOD:
            self._reported = time.monotonic()
            self._report()

    def _publish(self, block: np.ndarray) -> None:
        self._samples(block)
        self._joint(block)

    def _report(self) -> None:
        session = self._session
        if session is None:
            return
        bridge, states = session.bridge, session.bridge.states
        if states.state in (State.FAULT, State.DISABLED):
            self.health(
                "state",
                ERROR if states.state is State.FAULT else WARN,
                f"{states.state.value}: {states.reason}",
            )
        for what, value in {
            "state": states.state.value,
            "drift of the rig's clock [ppm]": f"{1e6 * bridge.clock.drift:.2f}",
            "half of the shortest round trip [ms]": f"{1e3 * bridge.clock.uncertainty:.3f}",
            "samples lost on the way": bridge.missing,
            "samples without a time": bridge.undated,
            "packets from the rig refused": sum(bridge.refusals.values()),
            "packets refused by the rig": bridge.report.refused if bridge.report else 0,
            "reference samples not followed": bridge.unused,
        }.items():
            self.count(what, value)


def main() -> int:
    """Entry point of ``ros2 run ankle_actuator_driver ankle_actuator_driver``."""
    return run(ActuatorDriverNode)


if __name__ == "__main__":
    raise SystemExit(main())
