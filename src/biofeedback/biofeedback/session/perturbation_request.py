"""Asks the perturbation generator for one stretch, without waiting for its answer."""

from __future__ import annotations

from rclpy.node import Node
from rclpy.task import Future
from std_srvs.srv import Trigger

GENERATOR = "perturbation_generator"


class PerturbationRequest:
    """Calls the generator's service ``~/perturb``.

    Parameters
    ----------
    node
        The node that makes the client.

    Attributes
    ----------
    refusal
        Why the last request was refused; empty where it was not.
    """

    def __init__(self, node: Node) -> None:
        self._client = node.create_client(Trigger, f"{GENERATOR}/perturb")
        self.refusal = ""

    def give(self) -> None:
        """Ask for a stretch; from any thread."""
        if not self._client.service_is_ready():
            self.refusal = "no perturbation generator answers"
            return
        self.refusal = ""
        self._client.call_async(Trigger.Request()).add_done_callback(self._answered)

    def _answered(self, future: Future) -> None:
        answer = future.result()
        if answer is not None and not answer.success:
            self.refusal = f"the perturbation generator refuses: {answer.message}"
