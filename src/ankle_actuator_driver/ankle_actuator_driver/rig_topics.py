"""The topics on which the driver says what its rig does: samples, state, events and health."""

from __future__ import annotations

import time

import numpy as np
from std_msgs.msg import String

from ankle_actuator_driver.rig_session import News, RigSession, state_event, state_text
from ankle_actuator_driver.safety.states import State
from ankle_interfaces.topics import ANKLE_SAMPLES, RIG_STATE, SESSION_EVENT
from ankle_node.derived_topics import joint_states
from ankle_node.node import ERROR, LATEST_QOS, WARN, AnkleNode
from ankle_node.qos import publisher_qos

REPORT_PERIOD = 1.0
"""[s] Time between two reports of the figures on ``/diagnostics``."""


class RigTopics:
    """Publishes what a session with a rig reports.

    Parameters
    ----------
    node
        The node that owns the publishers.
    """

    def __init__(self, node: AnkleNode) -> None:
        self._node = node
        self._samples = node.block_publisher(ANKLE_SAMPLES)
        self._joint = joint_states(node)
        self._state = node.create_publisher(String, RIG_STATE.name, LATEST_QOS)
        self._events = node.create_publisher(
            String, SESSION_EVENT.name, publisher_qos(SESSION_EVENT)
        )
        self._reported = 0.0

    def publish(self, news: News, session: RigSession | None) -> None:
        """Publish what a look at the line gave, and the session's figures once a second."""
        for block in news.blocks:
            self._publish(block)
        for note in news.notes:
            self._node.get_logger().warning(note, throttle_duration_sec=1.0)
            self._node.health("rig", WARN, note)
        for state, reason in news.changes:
            text = state_text(state, reason)
            self._state.publish(String(data=text))
            self._events.publish(String(data=state_event(state, reason, news.ros).line()))
            self._node.get_logger().info(f"rig {text}")
        if session is not None and time.monotonic() - self._reported > REPORT_PERIOD:
            self._reported = time.monotonic()
            self._report(session)

    def _publish(self, block: np.ndarray) -> None:
        self._samples(block)
        self._joint(block)

    def _report(self, session: RigSession) -> None:
        states = session.bridge.states
        if states.state in (State.FAULT, State.DISABLED):
            level = ERROR if states.state is State.FAULT else WARN
            self._node.health("state", level, state_text(states.state, states.reason))
        for what, value in session.figures().items():
            self._node.count(what, value)
