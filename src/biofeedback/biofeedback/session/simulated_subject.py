"""The simulated subject of `ankle_sim`, whose behaviour the operator's page sets by parameters."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Mapping

from rcl_interfaces.srv import GetParameters, SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future

from ankle_node.node import SIMULATION
from ankle_sim.subject_parameters import STATE_PARAMETERS, SUBJECT
from biofeedback.errors import CommandError

NAMES = tuple(parameter.name for parameter in STATE_PARAMETERS)


class SimulatedSubject:
    """Finds the simulated subject and sets what it does.

    Parameters
    ----------
    node
        The node that makes the clients.
    """

    def __init__(self, node: Node) -> None:
        self._get = node.create_client(GetParameters, f"{SIMULATION}/get_parameters")
        self._set = node.create_client(SetParameters, f"{SIMULATION}/set_parameters")
        self._values: dict[str, float] | None = None
        self._asked = False

    def describe(self) -> dict[str, float] | None:
        """Return present values by name; None where there is no simulated subject."""
        return None if self._values is None else dict(self._values)

    def look(self) -> None:
        """Ask the simulation, where there is one, whether it has a subject and what that does."""
        if not self._get.service_is_ready():
            self._values, self._asked = None, False
            return
        if not self._asked:
            self._asked = True
            self._get.call_async(
                GetParameters.Request(names=[SUBJECT.name, *NAMES])
            ).add_done_callback(self._receive)

    def _receive(self, future: Future) -> None:
        number, *values = future.result().values
        self._values = (
            {name: value.double_value for name, value in zip(NAMES, values, strict=True)}
            if number.integer_value
            else None
        )

    async def set(self, values: Mapping[str, float]) -> None:
        """Set what the subject does; see `ankle_sim.subject_parameters` for the ranges.

        Raises
        ------
        CommandError
            There is no simulated subject, or the simulation refuses.
        """
        if self._values is None:
            raise CommandError("there is no simulated subject in this graph")
        loop = asyncio.get_running_loop()
        answered: asyncio.Future[SetParameters.Response] = loop.create_future()

        def done(future: Future) -> None:
            with contextlib.suppress(RuntimeError):  # the loop may have ended
                loop.call_soon_threadsafe(
                    lambda: None if answered.done() else answered.set_result(future.result())
                )

        messages = [
            Parameter(name, value=float(value)).to_parameter_msg() for name, value in values.items()
        ]
        self._set.call_async(SetParameters.Request(parameters=messages)).add_done_callback(done)
        for result in (await answered).results:
            if not result.successful:
                raise CommandError(result.reason)
        self._values = {**self._values, **values}
