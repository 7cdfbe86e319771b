"""The rig's driver over its `std_srvs/srv/Trigger` services ``NODE/arm|start|stop|reset_fault``.

A stop has a way of its own: requests leave in the thread that asks for them, answers and
repetitions are handled by a ROS node and a thread that do nothing else, and no lock is held that
anything slow holds too.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from typing import Any

from rclpy.client import Client
from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from rclpy.task import Future
from std_msgs.msg import String
from std_srvs.srv import Trigger

from ankle_interfaces.topics import RIG_OPERATOR_ALIVE, RIG_STATE
from ankle_node.block_executor import BlockExecutor
from ankle_node.qos import LATEST_QOS, publisher_qos
from biofeedback.errors import CommandError
from biofeedback.session.drivers import ACTIONS, Drivers

SERVICE = "std_srvs/srv/Trigger"
LOOK_PERIOD = 1.0
"""[s] Time between two looks for drivers, after which one that starts later is known."""
REPEAT_PERIOD = 0.25
"""[s] Time after which a stop that was not confirmed is sent again: a service that was found a
moment ago may not hear its first call, and a loaded driver confirms within 0.1 s."""
UNCONFIRMED_AFTER = 0.5
"""[s] After this time a stop without confirmation is shown to the operator: two repetitions."""


class RigServices:
    """Finds the drivers, calls the one that may be commanded, and stops all of them.

    Parameters
    ----------
    parent
        Node whose context and namespace are used.
    name
        Of the driver node; empty takes the one that is there.
    """

    def __init__(self, parent: Node, name: str) -> None:
        self._node = Node(
            f"{parent.get_name()}_rig_services",
            context=parent.context,
            namespace=parent.get_namespace(),
            use_global_arguments=False,
            start_parameter_services=False,
        )
        namespace = parent.get_namespace().strip("/")
        self._drivers = Drivers(
            f"{namespace}/{name}" if name and namespace and "/" not in name else name
        )
        self._clients: dict[str, dict[str, Client]] = {}
        self._state = ""
        self._stop_number = 0
        self._stop_requested_at = 0.0
        self._unconfirmed: set[str] = set()
        self._stop_next_driver = False
        self._alive = self._node.create_publisher(
            String, RIG_OPERATOR_ALIVE.name, publisher_qos(RIG_OPERATOR_ALIVE)
        )
        self._node.create_subscription(String, RIG_STATE.name, self._receive_state, LATEST_QOS)
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._node.create_timer(LOOK_PERIOD, self.look, clock=steady)
        self._node.create_timer(REPEAT_PERIOD, self._repeat_stop, clock=steady)
        self._executor = BlockExecutor(context=parent.context)
        self._executor.add_node(self._node)
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._spin, name="rig services", daemon=True)
        self._thread.start()

    def _spin(self) -> None:
        self.look()
        with contextlib.suppress(ExternalShutdownException):
            while not self._closing.is_set() and self._node.context.ok():
                self._executor.spin_once(timeout_sec=0.1)

    def close(self) -> None:
        """End the thread; nothing is sent afterwards."""
        self._closing.set()
        self._thread.join(timeout=2.0)
        self._node.destroy_node()

    def _receive_state(self, message: String) -> None:
        self._state = str(message.data)[:200]

    @property
    def present(self) -> bool:
        """Tell whether there is exactly one driver, which may be commanded."""
        return self._drivers.selected is not None

    @property
    def problem(self) -> str:
        """Tell why no driver can be commanded, or what is wrong with it; empty where nothing is."""
        return self._drivers.problem

    @property
    def several(self) -> bool:
        """Tell whether more drivers than one are in the graph."""
        return self._drivers.several

    @property
    def waits_for_stop(self) -> bool:
        """Tell whether a driver has not confirmed the last stop yet."""
        return bool(self._unconfirmed)

    def describe(self) -> dict[str, Any]:
        """Return name, problem, state and unconfirmed stops, as `messages.RigState` has them."""
        overdue = time.monotonic() - self._stop_requested_at > UNCONFIRMED_AFTER
        return {
            "name": self._drivers.selected,
            "problem": self._drivers.problem,
            "state": self._state if self.present else "",
            "stop_unconfirmed": sorted(self._unconfirmed) if overdue else [],
        }

    def announce_operator(self, session_id: str) -> None:
        """Publish that an operator's page is connected and alive."""
        with contextlib.suppress(Exception):  # the context may be shut down meanwhile
            self._alive.publish(String(data=session_id))

    def look(self) -> None:
        """Look for drivers in the graph; a stop that waits for its driver is sent to a new one.

        The list of service names also has those that somebody only calls, so it says where to look;
        whether a service is served, its client knows.
        """
        named: dict[str, set[str]] = {}
        # In a namespace, the drivers of other laboratories are none of this one's.
        namespace = f"{self._node.get_namespace().rstrip('/')}/"
        for service, types in self._node.get_service_names_and_types():
            owner, _, action = service.rpartition("/")
            if SERVICE in types and action in ACTIONS and service.startswith(namespace):
                named.setdefault(owner.strip("/"), set()).add(action)
        for name, actions in named.items():
            if name not in self._clients and actions >= {"stop"} and actions & {"arm", "start"}:
                clients = {
                    action: self._node.create_client(Trigger, f"/{name}/{action}")
                    for action in ACTIONS
                }
                self._clients = {**self._clients, name: clients}
        known = len(self._drivers.known)
        self._drivers.update(
            {
                name: {action for action, client in clients.items() if client.service_is_ready()}
                for name, clients in self._clients.items()
            }
        )
        if len(self._drivers.known) > known and self._stop_next_driver:
            self.stop()

    def stop(self) -> None:
        """Send a stop to every driver known now or before, without waiting; from any thread.

        It is repeated to each driver until that driver confirms it. Where no driver is known yet,
        the first one that appears receives it.
        """
        self._stop_number += 1
        self._stop_requested_at = time.monotonic()
        known = list(self._drivers.known)
        self._unconfirmed = set(known)
        self._stop_next_driver = not known
        for name in known:
            self._send_stop(name, self._stop_number)

    def _repeat_stop(self) -> None:
        if time.monotonic() - self._stop_requested_at < REPEAT_PERIOD:
            return
        for name in list(self._unconfirmed):
            self._send_stop(name, self._stop_number)

    def _send_stop(self, name: str, number: int) -> None:
        def done(future: Future) -> None:
            response = future.result()
            if response is None or number != self._stop_number:
                return
            self._unconfirmed.discard(name)
            if not response.success:
                self._node.get_logger().error(f"{name} refuses to stop: {response.message}")

        with contextlib.suppress(Exception):  # one driver's client must not keep the next from it
            self._clients[name]["stop"].call_async(Trigger.Request()).add_done_callback(done)

    async def call(self, action: str) -> None:
        """Call ``arm``, ``start`` or ``reset_fault`` of the selected driver and await its answer.

        Raises
        ------
        CommandError
            There is no driver to command, or it refuses, with its own words.
        """
        name = self._drivers.selected
        if name is None:
            raise CommandError(self._drivers.problem)
        loop = asyncio.get_running_loop()
        answered: asyncio.Future[Trigger.Response] = loop.create_future()

        def done(future: Future) -> None:
            # In the executor's thread. The caller may have given up waiting.
            with contextlib.suppress(RuntimeError):
                loop.call_soon_threadsafe(
                    lambda: None if answered.done() else answered.set_result(future.result())
                )

        self._clients[name][action].call_async(Trigger.Request()).add_done_callback(done)
        response = await answered
        if not response.success:
            raise CommandError(f"{name} refuses to {action.replace('_', ' ')}: {response.message}")
