"""The node between the graph and a rig's own controller; it has the topics of `ankle_sim`.

| topic or service | direction | content |
| --- | --- | --- |
| perturbation/reference | in | t[s],position[rad],velocity[rad/s],acceleration[rad/s^2] |
| ankle/samples | out, as the rig sends | t[s],position[rad],velocity[rad/s],torque[N.m] |
| joint_states | out, each block | JointState, name `ankle`: the last sample |
| rig/state | out, latched, each change | String: the driver's state, then `: reason` |
| rig/operator_alive | in, 10 Hz | String: session of the operator's page that watches |
| session/event | out, each change | String: event `rig armed` and so on, with its reason |
| /diagnostics | out, 1 Hz | state, the rig's clock, packets refused and lost |
| ~/arm, ~/start, ~/stop, ~/disarm, ~/reset_fault | service | std_srvs/Trigger: docs/safety.md |
| ~/change_state and others | service | lifecycle_msgs: managed life cycle |

Parameters: `ankle_actuator_driver.settings`. Everything that decides is in `safety`,
everything that travels in `link`.
"""

from __future__ import annotations

import time
from collections.abc import Generator
from functools import partial

import numpy as np
from rcl_interfaces.msg import SetParametersResult
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from rclpy.topic_endpoint_info import TopicEndpointInfo
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ankle_actuator_driver.link.rig_link import Clocks, open_link
from ankle_actuator_driver.rig_session import News, RigSession, both_clocks
from ankle_actuator_driver.safety.bridge import Bridge
from ankle_actuator_driver.safety.limits import LIMIT_PARAMETERS, hard_limits_from, limits_from
from ankle_actuator_driver.safety.sensor_supervision import (
    SENSOR_PARAMETERS,
    expectations_from,
)
from ankle_actuator_driver.safety.states import CONFIRMATION, State
from ankle_actuator_driver.settings import PARAMETERS
from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Value
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    PERTURBATION_REFERENCE,
    RIG_OPERATOR_ALIVE,
    RIG_STATE,
    SESSION_EVENT,
)
from ankle_node import session_event
from ankle_node.derived_topics import joint_states
from ankle_node.managed_node import ManagedNode
from ankle_node.node import ERROR, LATEST_QOS, WARN, run
from ankle_node.qos import publisher_qos, reader_qos
from ankle_node.real_time import DRIVER_PRIORITY, keep_loaded_objects, take_priority

COMMANDS = ("arm", "start", "stop", "disarm", "reset_fault")
REPORT_PERIOD = 1.0  # s
SOURCES_PERIOD = 0.1  # s; between looks at who publishes the reference
NO_SIMULATED_TIME = "use_sim_time = True is refused: a rig moves in real time"
CONFIRMED_STATES = {"arm": State.ARMED, "start": State.RUNNING}
"""Commands that are answered when the rig has confirmed them, and the state that they enter."""


class _NextTurn:
    """Lets the executor do other things before the callback that awaits it goes on."""

    def __await__(self) -> Generator[None, None, None]:
        yield


class ActuatorDriverNode(ManagedNode):
    """Wires a `RigSession` to topics and services."""

    def __init__(self) -> None:
        super().__init__("ankle_actuator_driver", PARAMETERS)
        values = self._values()
        self._hard = hard_limits_from(values)
        limits_from(values).require_within(self._hard)
        if self.get_parameter("use_sim_time").value:
            raise QuantityError(NO_SIMULATED_TIME)
        self.add_on_set_parameters_callback(self._refuse_simulated_time)
        keep_loaded_objects()
        if refusal := take_priority(DRIVER_PRIORITY):
            self.get_logger().warning(refusal)
            self.health("priority", WARN, refusal)
        self._fault = ""  # of the last session, still to be reset
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
            answer = self._command_to_confirm if name in CONFIRMED_STATES else self._command
            self.create_service(Trigger, f"~/{name}", partial(answer, name))
        self.create_subscription(
            String, RIG_OPERATOR_ALIVE.name, self._hear_operator, reader_qos(RIG_OPERATOR_ALIVE)
        )
        self.create_timer(SOURCES_PERIOD, self._look_for_sources)
        self.when_read(ANKLE_SAMPLES, int(self.number("wait_for_readers")), self._begin)

    def _values(self) -> dict[str, Value]:
        return {parameter.name: self.value(parameter.name) for parameter in PARAMETERS}

    def _begin(self) -> None:
        self.block_subscription(
            PERTURBATION_REFERENCE, self._take, PERTURBATION_REFERENCE.columns[1:]
        )
        if self.value("autostart"):
            self.start()

    @staticmethod
    def _refuse_simulated_time(changes: list[Parameter]) -> SetParametersResult:
        if any(change.name == "use_sim_time" and change.value for change in changes):
            return SetParametersResult(successful=False, reason=NO_SIMULATED_TIME)
        return SetParametersResult(successful=True)

    def configure(self) -> None:
        """Open the line."""
        values = self._values()
        clocks = partial(both_clocks, self.now)
        link = open_link(str(values["link"]), values, Clocks(clocks))
        bridge = Bridge(
            limits_from(values),
            self.number("soft_start"),
            self.number("reference_delay"),
            self._fault,
        )
        bridge.expectations = expectations_from(values)
        bridge.operator_timeout = self.number("operator_timeout")
        self._session = RigSession(bridge, link, clocks, self._tell, self._fail)
        self.get_logger().info(link.describe())

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
            states = session.bridge.states
            self._fault = states.reason if states.state is State.FAULT else ""
            session.close()

    def destroy_node(self) -> None:
        """Stop the session, so that a node that ends leaves no plate in motion."""
        self.deactivate()
        self.release()
        super().destroy_node()

    def process_waiting(self, executor: SingleThreadedExecutor) -> None:
        """Stop the rig first when the node is to end, then process the blocks that still wait."""
        self.deactivate()
        super().process_waiting(executor)

    def parameters_changed(self, values: dict[str, Value]) -> None:
        """Apply changed limits at once, and a soft start from the next start on.

        Limits never pass the hard ones. A plate that is on its way beyond a new one is stopped.
        """
        wanted = limits_from(
            {p.name: values.get(p.name, self.value(p.name)) for p in LIMIT_PARAMETERS}
        )
        wanted.require_within(self._hard)
        soft_start = float(values.get("soft_start", self.number("soft_start")))
        timeout = float(values.get("operator_timeout", self.number("operator_timeout")))
        expectations = expectations_from(
            {p.name: values.get(p.name, self.value(p.name)) for p in SENSOR_PARAMETERS}
        )

        def apply(bridge: Bridge) -> None:
            bridge.soft_start, bridge.operator_timeout = soft_start, timeout
            bridge.expectations = expectations

        if self._session is not None:
            self._session.change(wanted, apply)

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

    async def _command_to_confirm(
        self, name: str, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        """Answer an arming or a start once the rig has confirmed it.

        A stop is carried out meanwhile.
        """
        self._look_for_sources()
        response = self._command(name, request, response)
        session = self._session
        if session is None or not response.success:
            return response
        deadline = time.monotonic() + 2 * CONFIRMATION
        while (answer := session.confirmed(CONFIRMED_STATES[name])) is None:
            if time.monotonic() > deadline:
                response.success = False
                response.message = f"{name}: the rig did not confirm it within {CONFIRMATION:g} s"
                return response
            await _NextTurn()
        if not answer.done:
            response.success, response.message = False, f"{name} failed: {answer.sentence}"
        return response

    def _hear_operator(self, message: String) -> None:
        if self._session is not None:
            self._session.tell_operator_alive()

    def _look_for_sources(self) -> None:
        """Report to the session who publishes and who reads the reference."""
        topic = self.resolve_topic_name(PERTURBATION_REFERENCE.name)
        names = full_names(self.get_publishers_info_by_topic(topic))
        if len(names) > 1:
            self.health("reference", ERROR, f"published by {', '.join(sorted(names))}")
        if self._session is not None:
            readers = full_names(self.get_subscriptions_info_by_topic(topic))
            self._session.tell_sources(names, readers)

    def _take(self, block: Block, findings: list[Finding]) -> None:
        if self._session is not None:
            self._session.refer(block.data)

    def _fail(self, error: Exception) -> None:
        """Let the executor raise an error of the session's thread, so that the process ends."""
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
            "reference samples not followed": bridge.unused,
            "reference blocks not followed": bridge.left_out,
            "samples away from the command": bridge.sensors.spikes,
            "longest pause of the driver [ms]": f"{1e3 * session.longest_pause:.0f}",
            **session.link.figures(),
        }.items():
            self.count(what, value)


def full_names(ends: list[TopicEndpointInfo]) -> list[str]:
    """Return the full names of the nodes at the ends of a topic."""
    return [f"{end.node_namespace.rstrip('/')}/{end.node_name}" for end in ends]


def main() -> int:
    """Start the node: the entry point of ``ros2 run ankle_actuator_driver
    ankle_actuator_driver``.
    """
    return run(ActuatorDriverNode)


if __name__ == "__main__":
    raise SystemExit(main())
