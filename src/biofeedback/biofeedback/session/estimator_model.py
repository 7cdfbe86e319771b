"""The model of the running estimator: handed over as its parameter, confirmed by what its estimates
state.
"""

from __future__ import annotations

from pathlib import Path
from threading import Thread

from rcl_interfaces.srv import SetParameters
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.task import Future
from std_msgs.msg import String

from ankle_interfaces.topics import IMPEDANCE_PROVENANCE
from ankle_interfaces.yaml_text import YamlError, parse_yaml
from ankle_node.qos import reader_qos
from ankle_physics.errors import ModelError
from biofeedback.errors import CommandError

ESTIMATOR, MODEL = "impedance_estimator", "model"


def stated_model(provenance: str) -> str | None:
    """Return the SHA-256 of the model that estimates are made with.

    Parameters
    ----------
    provenance
        A line of the topic ``impedance/provenance``.

    Returns
    -------
    str or None
        Empty where they are made without a model; None where the line does not say it.
    """
    try:
        content = parse_yaml(provenance)
        model = content[MODEL]
        return "" if model is None else str(model["sha256"])
    except (YamlError, KeyError, TypeError):
        return None


class ModelOfEstimator:
    """Hands a model to the node of the estimator and follows which one it uses.

    Parameters
    ----------
    node
        Makes the client and the subscription.
    """

    def __init__(self, node: Node) -> None:
        self._client = node.create_client(SetParameters, f"{ESTIMATOR}/set_parameters")
        self._stated: str | None = None
        self._wanted: str | None = None
        self._sent: str | None = None
        self._number = 0
        self.refusal = ""
        node.create_subscription(
            String, IMPEDANCE_PROVENANCE.name, self._receive, reader_qos(IMPEDANCE_PROVENANCE)
        )

    def _receive(self, message: String) -> None:
        self._stated = stated_model(message.data)

    @property
    def confirmed(self) -> bool:
        """Tell whether the estimates are made with the model that was handed over last."""
        return self._wanted is not None and self._stated == self._wanted

    def prepare(self) -> None:
        """Load, beside the session, what reading a model needs.

        It takes a second, and several on a busy computer. The session's loop, which hands the model
        over, keeps the rig alive meanwhile.
        """
        Thread(target=_load_terms, daemon=True).start()

    def hand_over(self, model: Path | None) -> None:
        """Ask the estimator to go on with a model, or without one; from any thread.

        Parameters
        ----------
        model
            The model's file; None for no model.

        Raises
        ------
        CommandError
            The file cannot be read, or no estimator answers.
        """
        from ankle_physics.model import Model  # with its compiler, only where a model is used

        self._wanted = None
        try:
            self._wanted = "" if model is None else Model.load(model).sha256
        except (ModelError, OSError) as error:
            raise CommandError(str(error)) from None
        self.refusal = ""
        if self.confirmed and self._sent in (None, self._wanted):
            return  # another one that was sent meanwhile would still take over
        if not self._client.service_is_ready():
            raise CommandError(f"no node '{ESTIMATOR}' answers")
        # The same path with new content would be no change to the estimator: it is emptied first.
        paths = [""] if model is None else ["", str(model.resolve())]
        request = SetParameters.Request(
            parameters=[Parameter(MODEL, value=path).to_parameter_msg() for path in paths]
        )
        self._sent = self._wanted
        self._number += 1
        number = self._number

        def done(future: Future) -> None:
            answer = future.result()
            if answer is None or number != self._number:
                return
            self.refusal = next((r.reason for r in answer.results if not r.successful), "")

        self._client.call_async(request).add_done_callback(done)


def _load_terms() -> None:
    from ankle_physics.term import term_library  # with its compiler, only where a model is used

    term_library()
