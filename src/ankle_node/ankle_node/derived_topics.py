"""What tools show that cannot read blocks: single numbers by name, and joint states."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from rclpy.node import Node
from rclpy.time import Time
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64

from ankle_interfaces.topics import ANKLE_SAMPLES, JOINT_STATES, PLOTS, Topic
from ankle_node.qos import publisher_qos

JOINT = "ankle"
"""Name of the joint, as in ``ankle_description.urdf``."""
FRAME = "shank"
"""The link in which the joint's angle is measured."""

Publish = Callable[[np.ndarray], None]


def plots(node: Node, topic: Topic, columns: Sequence[str]) -> Publish:
    """Make a publisher of a block topic's columns as ``std_msgs/Float64``, one topic for each.

    Parameters
    ----------
    node
        Owner of the publishers.
    topic
        The block topic; `Topic.plots` names columns and topics.
    columns
        Columns of the blocks that will be published.

    Returns
    -------
    Callable
        To be called with each block's data, shape (n, m); publishes its last row, but not more
        often than `PLOTS` says by the samples' own time.
    """
    by_name = {plot.name: plot for plot in PLOTS}
    senders = [
        (columns.index(column), node.create_publisher(Float64, name, publisher_qos(by_name[name])))
        for column, name in topic.plots
        if column in columns
    ]
    # A tenth less than the period: where the blocks come at a multiple of the rate, rounding must
    # not drop every other message.
    shortest = min((0.9 / (by_name[name].rate or math.inf) for _, name in topic.plots), default=0)
    last = -math.inf

    def publish(data: np.ndarray) -> None:
        nonlocal last
        if not senders or not len(data) or abs(float(data[-1, 0]) - last) < shortest:
            return
        last = float(data[-1, 0])
        for index, sender in senders:
            sender.publish(Float64(data=float(data[-1, index])))

    return publish


def joint_states(node: Node) -> Publish:
    """Make a publisher of the last row of each block of ``ankle/samples`` as a JointState.

    Returns
    -------
    Callable
        To be called with data of shape (n, 4): t [s], position [rad], velocity [rad/s] and torque
        [N.m].
    """
    sender = node.create_publisher(JointState, JOINT_STATES.name, publisher_qos(JOINT_STATES))
    at = [ANKLE_SAMPLES.columns.index(name) for name in _STATE]

    def publish(data: np.ndarray) -> None:
        if not len(data):
            return
        position, velocity, torque = (float(data[-1, index]) for index in at)
        state = JointState(name=[JOINT], position=[position], velocity=[velocity], effort=[torque])
        state.header.stamp = Time(nanoseconds=round(float(data[-1, 0]) * 1e9)).to_msg()
        state.header.frame_id = FRAME
        sender.publish(state)

    return publish


_STATE = ("position[rad]", "velocity[rad/s]", "torque[N.m]")
