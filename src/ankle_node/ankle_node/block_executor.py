"""An executor for nodes that take a few hundred messages a second.

rclpy's own single-threaded executor collects every entity of the node and builds a wait set before
each callback, and once more after it, which costs ten times the work on a block. Here the wait set
is kept until an entity is created or destroyed, and messages, timers and guard conditions are
handed to their callbacks directly. Everything else is rare (services, clients, events of the
middleware, coroutines) and goes through rclpy's own executor.
"""

from __future__ import annotations

import time
from collections.abc import Iterable
from contextlib import ExitStack
from typing import Any

from rclpy.context import Context
from rclpy.executors import (
    ExternalShutdownException,
    ShutdownException,
    SingleThreadedExecutor,
    TimeoutException,
)
from rclpy.guard_condition import GuardCondition
from rclpy.impl.implementation_singleton import rclpy_implementation
from rclpy.subscription import Subscription
from rclpy.timer import Timer

LARGEST_BATCH = 8
"""Largest number of messages that one subscription hands on before others have their turn: a
command that waits behind a backlog of blocks waits for a few milliseconds only."""
COMPLETE_PERIOD = 2.0
"""[s] Time between two turns of rclpy's own executor, which handles events of the middleware, as
the warning about readers whose quality of service does not fit."""
WITHOUT_TIME_LIMIT = -1


class BlockExecutor(SingleThreadedExecutor):
    """Runs the callbacks of nodes in the thread that spins, at a small cost for each message.

    The callbacks of subscriptions, timers and guard conditions are functions, not coroutines;
    those of services may be coroutines.

    Parameters
    ----------
    context
        Of the nodes; the default one where None.
    """

    def __init__(self, *, context: Context | None = None) -> None:
        super().__init__(context=context)
        self._kept = ExitStack()
        self._wait_set: Any = None
        self._kept_subscriptions: dict[int, Subscription] = {}
        self._kept_timers: dict[int, Timer] = {}
        self._kept_guards: dict[int, GuardCondition] = {}
        self._kept_services: list[Any] = []
        self._kept_clients: list[Any] = []
        self._completed = -COMPLETE_PERIOD

    def spin_once(self, timeout_sec: float | None = None) -> None:
        """Wait until something is to be done, and do all that is ready.

        Parameters
        ----------
        timeout_sec
            Longest wait [s]; None waits for ever.

        Raises
        ------
        ExternalShutdownException
            The context was shut down.
        Exception
            Whatever a callback raises.
        """
        if self._tasks or time.monotonic() - self._completed > COMPLETE_PERIOD:
            self._complete()
            if self._tasks:  # a coroutine that goes on, or a result that somebody waits for
                return
        self._end_with_context()
        if self._wait_set is None:
            self._collect()
        self._wait(WITHOUT_TIME_LIMIT if timeout_sec is None else max(round(1e9 * timeout_sec), 0))

    def shutdown(self, timeout_sec: float | None = None) -> bool:
        """Stop executing callbacks; see `rclpy.executors.Executor.shutdown`."""
        self._release()
        return bool(super().shutdown(timeout_sec))

    def _complete(self) -> None:
        """Let rclpy's own executor do everything that is ready, without waiting."""
        self._release()  # its wait takes the signal that an entity is new or gone
        self._completed = time.monotonic()
        while not self._is_shutdown:
            try:
                handler, _, _ = self.wait_for_ready_callbacks(timeout_sec=0.0)
            except (TimeoutException, ShutdownException):
                break
            handler()
            handler.result()  # raises what the callback raised
            self._end_with_context()
        with self._tasks_lock:  # those that are done would bring the next turn here again
            self._tasks = [task for task in self._tasks if not task[0].done()]

    def _release(self) -> None:
        self._wait_set = None
        self._kept.close()

    def _keep(self, entities: Iterable[Any]) -> dict[int, Any]:
        """Hold entities, which are then not destroyed, and return them by their pointers."""
        held = {}
        for entity in entities:
            try:
                self._kept.enter_context(entity.handle)
            except rclpy_implementation.InvalidHandle:  # destroyed meanwhile
                continue
            held[entity.handle.pointer] = entity
        return held

    def _collect(self) -> None:
        """Make the wait set from the entities that there are now."""
        nodes = self.get_nodes()
        self._kept_subscriptions = self._keep(one for node in nodes for one in node.subscriptions)
        self._kept_timers = self._keep(one for node in nodes for one in node.timers)
        self._kept_guards = self._keep(one for node in nodes for one in node.guards)
        services = self._keep(one for node in nodes for one in node.services)
        clients = self._keep(one for node in nodes for one in node.clients)
        self._kept_services = [service.handle for service in services.values()]
        self._kept_clients = [client.handle for client in clients.values()]
        assert self._guard is not None
        assert self._context.handle is not None
        self._kept.enter_context(self._context.handle)
        self._kept.enter_context(self._guard.handle)
        self._wait_set = rclpy_implementation.WaitSet(
            len(self._kept_subscriptions),
            len(self._kept_guards) + 1,
            len(self._kept_timers),
            len(clients),
            len(services),
            0,
            self._context.handle,
        )

    def _wait(self, timeout: int) -> None:
        """Wait for so many nanoseconds at most, then call what is ready."""
        found = self._wait_set
        found.clear_entities()
        for subscription in self._kept_subscriptions.values():
            found.add_subscription(subscription.handle)
        for timer in self._kept_timers.values():
            found.add_timer(timer.handle)
        for guard in self._kept_guards.values():
            found.add_guard_condition(guard.handle)
        assert self._guard is not None
        found.add_guard_condition(self._guard.handle)
        for service in self._kept_services:
            found.add_service(service)
        for client in self._kept_clients:
            found.add_client(client)
        found.wait(timeout)
        self._end_with_context()
        ready = {kind: found.get_ready_entities(kind) for kind in _KINDS}
        if self._guard.handle.pointer in ready["guard_condition"]:
            self._release()  # an entity is new or gone; those that are ready have their turn first
        for pointer in ready["timer"]:
            _call_timer(self._kept_timers[pointer])
            self._end_with_context()
        for pointer in ready["subscription"]:
            _call_subscription(self._kept_subscriptions[pointer])
            self._end_with_context()
        for pointer in ready["guard_condition"]:
            if pointer in self._kept_guards:
                self._kept_guards[pointer].callback()
                self._end_with_context()
        if ready["service"] or ready["client"]:
            self._complete()

    def _end_with_context(self) -> None:
        """Call nothing more once the context was shut down: a callback could not use the graph."""
        if not self._context.ok():
            raise ExternalShutdownException


_KINDS = ("subscription", "timer", "guard_condition", "service", "client")


def _call_timer(timer: Timer) -> None:
    """Call a timer's callback where it is due; one that was cancelled or destroyed is not."""
    try:
        with timer.handle:
            if not timer.handle.is_timer_ready():
                return
            timer.handle.call_timer()
    except rclpy_implementation.InvalidHandle:
        return
    timer.callback()


def _call_subscription(subscription: Subscription) -> None:
    """Hand the messages that wait to the callback, as many as its turn allows."""
    alone = subscription._callback_type is Subscription.CallbackType.MessageOnly
    for _ in range(LARGEST_BATCH):
        try:
            with subscription.handle:
                taken = subscription.handle.take_message(subscription.msg_type, subscription.raw)
        except rclpy_implementation.InvalidHandle:
            return
        if taken is None:
            return
        if alone:
            subscription.callback(taken[0])
        else:
            subscription.callback(*taken)
