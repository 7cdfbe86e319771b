"""Recordings of a simulated ankle, as visits of a study."""

import numpy as np

from ankle_interfaces.block import Block
from session_recorder.bag_writer import BagWriter

RATE = 1000  # Hz


def ankle(seconds=30.0):
    """Time, angle [rad] and torque [N.m] of an ankle of 90 N.m/rad under random steps."""
    n = int(seconds * RATE)
    steps = np.repeat(np.random.default_rng(1).uniform(-0.03, 0.03, n // 200), 200)
    position = np.convolve(steps, np.hanning(20) / np.hanning(20).sum(), "same")
    velocity = np.gradient(position, 1 / RATE)
    torque = 0.0137 * np.gradient(velocity, 1 / RATE) + 0.6 * velocity + 90 * position
    return np.arange(n) / RATE, position, torque + 0.05 * np.random.default_rng(2).normal(size=n)


def write_bag(path, emg=False):
    time, position, torque = ankle()
    with BagWriter(path) as writer:
        writer.add_topic("/ankle/samples")
        names = ("t[s]", "position[rad]", "torque[N.m]")
        for first in range(0, len(time), 32):
            piece = slice(first, first + 32)
            data = np.column_stack([time[piece], position[piece], torque[piece]])
            writer.write_block("/ankle/samples", Block(names, data))
        if emg:
            writer.add_topic("/emg/samples")
            data = np.column_stack([time, 2e-5 * np.sin(100 * time)])
            writer.write_block("/emg/samples", Block(("t[s]", "SOL[V]"), data))
