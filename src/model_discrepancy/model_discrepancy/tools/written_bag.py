"""Simulated recordings as bags, as a live rig sends them."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ankle_interfaces.block import Block
from ankle_physics.joint_profile import joint_in_force
from model_discrepancy.recording.recording import REFERENCE_TOPIC, SAMPLES_TOPIC, Recording
from session_recorder.bag_writer import BagWriter

# The share of a second that one block holds.
_BLOCKS_PER_SECOND = 64


def write_bag(recording: Recording, torque: np.ndarray, path: Path) -> None:
    """Write a recording's movement with a torque as a bag, in the units of the joint in force.

    Parameters
    ----------
    recording
        Of n samples.
    torque
        [N.m], shape (n,).
    path
        Of the bag; there must be none yet.

    Raises
    ------
    BagError
        Something is there.
    """
    joint = joint_in_force()
    time = recording.start + recording.time
    columns = {
        "t[s]": time,
        joint.position_column: recording.position,
        joint.torque_column: torque,
    }
    if recording.velocity is not None:
        columns[joint.velocity_column] = recording.velocity
    topics = {SAMPLES_TOPIC: columns}
    if recording.reference is not None:
        topics[REFERENCE_TOPIC] = {"t[s]": time, joint.position_column: recording.reference}
    size = max(1, round(recording.rate / _BLOCKS_PER_SECOND))
    with BagWriter(path) as writer:
        for topic, written in topics.items():
            writer.add_topic(topic)
            data = np.column_stack(list(written.values()))
            for begin in range(0, len(data), size):
                writer.write_block(topic, Block(tuple(written), data[begin : begin + size]))
