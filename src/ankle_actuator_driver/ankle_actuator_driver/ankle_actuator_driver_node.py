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

from functools import partial

from rclpy.callback_groups import ReentrantCallbackGroup
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ankle_actuator_driver.operator_commands import COMMANDS, CONFIRMED_STATES, OperatorCommands
from ankle_actuator_driver.rig_session import News, RigSession
from ankle_actuator_driver.rig_topics import RigTopics
from ankle_actuator_driver.safety.limits import hard_limits_from, limits_from
from ankle_actuator_driver.safety.states import Answer, State
from ankle_actuator_driver.session_setup import adjustment, open_session
from ankle_actuator_driver.settings import PARAMETERS
from ankle_interfaces.block import Block
from ankle_interfaces.continuity import Finding
from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Value
from ankle_interfaces.topics import (
    ANKLE_SAMPLES,
    PERTURBATION_REFERENCE,
    RIG_OPERATOR_ALIVE,
)
from ankle_node.managed_node import ManagedNode
from ankle_node.node import ERROR, WARN, run
from ankle_node.qos import reader_qos
from ankle_node.real_time import DRIVER_PRIORITY, keep_loaded_objects, take_priority
from ankle_node.sources import publishers, readers

SOURCES_PERIOD = 0.1  # s; between looks at who publishes the reference
NO_SIMULATED_TIME = "use_sim_time = True is refused: a rig moves in real time"


class ActuatorDriverNode(ManagedNode):
    """Wires a `RigSession` to topics and services."""

    def __init__(self) -> None:
        super().__init__("ankle_actuator_driver", PARAMETERS)
        values = self._values()
        self._hard = hard_limits_from(values)
        limits_from(values).require_within(self._hard)
        if self.get_parameter("use_sim_time").value:
            raise QuantityError(NO_SIMULATED_TIME)
        keep_loaded_objects()
        if refusal := take_priority(DRIVER_PRIORITY):
            self.get_logger().warning(refusal)
            self.health("priority", WARN, refusal)
        self._fault = ""  # of the last session, still to be reset
        self._session: RigSession | None = None
        self._commands = OperatorCommands(lambda: self._session)
        self._failure: Exception | None = None
        self._failed = self.create_guard_condition(self._raise_failure)
        self._topics = RigTopics(self)
        # In the node's own group a stop would wait for the answer to an arming.
        commands = ReentrantCallbackGroup()
        for name in COMMANDS:
            answer = self._command_to_confirm if name in CONFIRMED_STATES else self._command
            self.create_service(
                Trigger, f"~/{name}", partial(answer, name), callback_group=commands
            )
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

    def configure(self) -> None:
        """Open the line."""
        self._session = open_session(self._values(), self._fault, self.now, self._tell, self._fail)
        self.get_logger().info(self._session.link.describe())

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
        values = {**self._values(), **values}
        wanted = limits_from(values)
        wanted.require_within(self._hard)
        adjust = adjustment(values)
        if self._session is not None:
            self._session.change(wanted, adjust)

    def _command(
        self, name: str, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        return self._answer(response, self._commands.carry_out(name))

    async def _command_to_confirm(
        self, name: str, request: Trigger.Request, response: Trigger.Response
    ) -> Trigger.Response:
        self._look_for_sources()
        return self._answer(response, await self._commands.carry_out_confirmed(name))

    def _answer(self, response: Trigger.Response, answer: Answer) -> Trigger.Response:
        response.success, response.message = answer.done, answer.sentence
        self.get_logger().info(response.message)
        return response

    def _hear_operator(self, message: String) -> None:
        if self._session is not None:
            self._session.tell_operator_alive()

    def _look_for_sources(self) -> None:
        """Report to the session who publishes and who reads the reference."""
        topic = self.resolve_topic_name(PERTURBATION_REFERENCE.name)
        names = publishers(self, topic)
        if len(names) > 1:
            self.health("reference", ERROR, f"published by {', '.join(names)}")
        if self._session is not None:
            self._session.tell_sources(names, readers(self, topic))

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
        self._topics.publish(news, self._session)


def main() -> int:
    """Start the node: the entry point of ``ros2 run ankle_actuator_driver
    ankle_actuator_driver``.
    """
    return run(ActuatorDriverNode)


if __name__ == "__main__":
    raise SystemExit(main())
