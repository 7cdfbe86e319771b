"""A node with the managed life cycle of ROS and the standard services of `lifecycle_msgs`.

`ros2 lifecycle set NODE activate` and launch files drive it as any other managed node.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.lifecycle.node import LifecycleNodeMixin

from ankle_interfaces.errors import UserError
from ankle_interfaces.quantity import Quantity
from ankle_node.node import ERROR, AnkleNode

FAILURES = (ValueError, OSError)
"""What a transition may raise because of the node's surroundings. The transition then fails, and
the sentence is in the log and in the health."""


class StartError(UserError, RuntimeError):
    """Reports a node whose first transition failed; the log says why."""


class ManagedNode(LifecycleNodeMixin, AnkleNode):
    """Runs as a life-cycle node; its subclass says what happens at each transition.

    Parameters
    ----------
    name, parameters
        See `AnkleNode`.
    """

    def __init__(self, name: str, parameters: Sequence[Quantity]) -> None:
        AnkleNode.__init__(self, name, parameters)
        LifecycleNodeMixin.__init__(self)

    def configure(self) -> None:
        """Prepare everything that needs the parameters; raise one of `FAILURES` where that is not
        possible.
        """

    def activate(self) -> None:
        """Begin to work."""

    def deactivate(self) -> None:
        """End the work; called before `release` whenever the node is active."""

    def release(self) -> None:
        """Give back what `configure` took; harmless where it took nothing."""

    def start(self) -> None:
        """Configure and activate without waiting for a request.

        Raises
        ------
        StartError
            A transition failed.
        """
        for transition in (self.trigger_configure, self.trigger_activate):
            if transition() is not TransitionCallbackReturn.SUCCESS:
                raise StartError(f"{self.get_name()} could not start; its log says why")

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Prepare the node; the standard transition to inactive."""
        return self._attempt(self.configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Begin to work; the standard transition to active."""
        return self._attempt(self.activate)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the work; the standard transition to inactive."""
        return self._attempt(self.deactivate)

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Give everything back; the standard transition to unconfigured."""
        return self._attempt(self.release)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """End the work and give everything back; the standard transition from any state."""
        return self._attempt(self.deactivate, self.release)

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Return to unconfigured after an error; a standard transition."""
        return self._attempt(self.deactivate, self.release)

    def _attempt(self, *steps: Callable[[], None]) -> TransitionCallbackReturn:
        try:
            for step in steps:
                step()
        except FAILURES as error:
            self.get_logger().error(str(error))
            self.health("life cycle", ERROR, str(error))
            return TransitionCallbackReturn.FAILURE
        return TransitionCallbackReturn.SUCCESS
