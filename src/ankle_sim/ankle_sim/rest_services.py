"""The services of a rig's driver, so that a stop on a page stops the simulated plate, too."""

from __future__ import annotations

from functools import partial

from rclpy.node import Node
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ankle_interfaces.topics import RIG_STATE
from ankle_node.qos import publisher_qos
from ankle_sim.rest import Rest


class RestServices:
    """Offers arm, start, stop and reset_fault, and publishes the state after each.

    Parameters
    ----------
    node
        The node whose services they are.
    rest
        Stops and starts the plate.
    """

    def __init__(self, node: Node, rest: Rest) -> None:
        self._rest = rest
        self._state = node.create_publisher(String, RIG_STATE.name, publisher_qos(RIG_STATE))
        for action in ("arm", "start", "stop", "reset_fault"):
            node.create_service(Trigger, f"~/{action}", partial(self._answer, action))
        self._publish()

    def _answer(
        self, action: str, request: Trigger.Request, answer: Trigger.Response
    ) -> Trigger.Response:
        rest = self._rest
        found = getattr(rest, action)() if action != "reset_fault" else "there is no fault"
        answer.success = found is not None
        answer.message = found if found is not None else f"{rest.state}: arm first"
        self._publish()
        return answer

    def _publish(self) -> None:
        self._state.publish(String(data=self._rest.state))
