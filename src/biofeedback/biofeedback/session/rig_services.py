"""The rig's driver over its `std_srvs/srv/Trigger` services, found by what it offers: ``NODE/arm``,
``NODE/start``, ``NODE/stop``.
"""

from __future__ import annotations

import asyncio
from typing import Any

from rclpy.client import Client
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ankle_node.node import WORKED_OFF_QOS
from biofeedback.errors import CommandError

SERVICE = "std_srvs/srv/Trigger"
NEEDED = ("arm", "start", "stop")
ACTIONS = (*NEEDED, "reset_fault")
STATE_TOPIC = "/rig/state"
"""Latched text of the driver's state, where it has one."""
NONE_FOUND = "no rig driver in this graph: arm, start and stop concern the session only"


class RigServices:
    """Finds the rig and calls it; used by the server's thread, looked for by the executor's.

    Parameters
    ----------
    node
        Makes the clients.
    name
        Of the driver node; empty takes the one that is there.
    """

    def __init__(self, node: Node, name: str) -> None:
        self._node = node
        self._wanted = name.strip("/")
        self._clients: dict[str, Client] = {}
        self._name: str | None = None
        self._problem = NONE_FOUND
        self._unanswered: set[str] = set()
        self._state = ""
        self._look_now = node.create_guard_condition(self.look)
        node.create_subscription(String, STATE_TOPIC, self._hear_state, WORKED_OFF_QOS)

    def _hear_state(self, message: String) -> None:
        self._state = str(message.data)[:200]

    @property
    def present(self) -> bool:
        """Whether there is a rig to steer."""
        return self._name is not None

    def describe(self) -> dict[str, Any]:
        """Ready for JSON."""
        return {
            "name": self._name,
            "problem": self._problem,
            "state": self._state if self.present else "",
        }

    def look(self) -> None:
        """Look for the rig's services in the graph."""
        offered: dict[str, set[str]] = {}
        for service, types in self._node.get_service_names_and_types():
            owner, _, action = service.rpartition("/")
            if SERVICE in types and action in ACTIONS:
                offered.setdefault(owner.strip("/"), set()).add(action)
        rigs = [
            owner
            for owner, actions in offered.items()
            if set(NEEDED) <= actions and self._wanted in ("", owner)
        ]
        if len(rigs) == 1:
            if rigs[0] != self._name:
                for client in self._clients.values():
                    self._node.destroy_client(client)
                self._clients = {
                    action: self._node.create_client(Trigger, f"/{rigs[0]}/{action}")
                    for action in sorted(offered[rigs[0]])
                }
            self._name, self._problem = rigs[0], ""
            for action in sorted(self._unanswered):
                self._send(action)
            return
        self._name = None
        if rigs:
            self._problem = (
                f"{len(rigs)} rig drivers ({', '.join(sorted(rigs))}): set the "
                "parameter rig to the one that is meant"
            )
        else:
            self._problem = (
                f"the rig driver '{self._wanted}' is not in this graph"
                if self._wanted
                else NONE_FOUND
            )

    async def call(self, action: str) -> None:
        """Call a service and wait for its answer.

        Raises
        ------
        CommandError
            No such service, or the rig refuses, with its own words.
        """
        loop = asyncio.get_running_loop()
        answered: asyncio.Future[Trigger.Response] = loop.create_future()

        def done(future: Future) -> None:
            # In the executor's thread. The page may have given up waiting.
            loop.call_soon_threadsafe(
                lambda: None if answered.done() else answered.set_result(future.result())
            )

        self._client(action).call_async(Trigger.Request()).add_done_callback(done)
        response = await answered
        if not response.success:
            raise CommandError(
                f"{self._name} refuses to {action.replace('_', ' ')}: {response.message}"
            )

    def tell(self, action: str) -> None:
        """Call a service without waiting, again at every look until it answers; says in the log
        where the rig refuses.

        A stop must not be lost: a rig that is not found yet is told once it is, and one that was
        found a moment ago may not hear its first call. Only its answer ends this: a start that the
        rig agrees to meanwhile must not take a stop's place.
        """
        self._unanswered.add(action)
        if self.present:
            self._send(action)
        else:
            self._look_now.trigger()

    def _send(self, action: str) -> None:
        def done(future: Future) -> None:
            self._unanswered.discard(action)
            response = future.result()
            if not response.success:
                self._node.get_logger().error(
                    f"{self._name} refuses to {action}: {response.message}"
                )

        self._client(action).call_async(Trigger.Request()).add_done_callback(done)

    def _client(self, action: str) -> Client:
        if self._name is None or action not in self._clients:
            raise CommandError(self._problem or f"{self._name} has no service '{action}'")
        return self._clients[action]
