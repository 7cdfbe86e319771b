"""Limits that hold after every step of a state machine, for what is sent and what a rig does."""

import numpy as np
from hypothesis.stateful import RuleBasedStateMachine, invariant

from ankle_actuator_driver.link.protocol.packet import DeviceState

RATE = 2048.0
AFTER_LAST_PACKET = 0.25  # s
SLOW = 1e-3  # rad/s; of a plate that rests
ANGLE, VELOCITY, ACCELERATION = 0.175, 5.0, 2000.0  # rad, rad/s, rad/s^2
LARGEST_MOTION = np.array([ANGLE, VELOCITY, ACCELERATION]) * (1 + 1e-5)
LONGEST_BRIDGED_GAP = 0.04  # s; longer gaps are not bridged by a rig
JOIN = 1e-3  # rad; between the two ends of a pause at rest
ENDS = np.array(
    [
        [1, 0, 0, 0, 0, 0],
        [0, 1, 0, 0, 0, 0],
        [0, 0, 2, 0, 0, 0],
        [1, 1, 1, 1, 1, 1],
        [0, 1, 2, 3, 4, 5],
        [0, 0, 2, 6, 12, 20],
    ],
    dtype=float,
)
"""From a polynomial of the fifth order to position, velocity and acceleration at 0 and at 1."""
BOUNDARY = np.linalg.inv(ENDS)
"""From position, velocity and acceleration at both ends to the polynomial between them."""
PLACES = np.linspace(0.0, 1.0, 17)


def path_between(time, motion):
    """Largest absolute position, velocity and acceleration of the fifth-order polynomials through
    samples, shape (3,)."""
    h = np.diff(time)[:, None]
    scale = np.hstack([np.ones_like(h), h, h * h])
    ends = np.hstack([motion[:-1] * scale, motion[1:] * scale])
    c = ends @ BOUNDARY.T
    power = np.arange(6)
    largest = []
    for order in range(3):
        factor = np.array([np.prod([k - j for j in range(order)]) for k in power])
        basis = factor * PLACES[:, None] ** np.maximum(power - order, 0)
        largest.append(np.abs((c @ basis.T) / h**order).max())
    return np.array(largest)


class HeldAgainstLimits(RuleBasedStateMachine):
    """What may not happen to driver and rig, `lab`; `seen`, `kept` and `last` tell what of both was
    held against the limits before.
    """

    @invariant()
    def no_path_beyond_a_limit_leaves_the_driver(self):
        if not hasattr(self, "lab"):
            return
        lab = self.lab
        for stretch in lab.stretches[self.kept :]:
            assert np.all(path_between(stretch.time, stretch.motion) <= LARGEST_MOTION)
            self.joined(stretch)
            self.last = (stretch.time[-1], stretch.motion[-1])
        if lab.state != "running":
            self.last = None
        for motion in lab.obeyed:
            assert np.all(np.abs(motion).max(axis=0) <= LARGEST_MOTION)
        lab.obeyed, lab.sent = [], []
        lab.stretches = lab.stretches[-1:]  # `a_second_generator` goes by its times
        self.kept = len(lab.stretches)

    def joined(self, stretch):
        """A stretch continues what was sent before it in this run of the plate."""
        if self.last is None or stretch.time[0] <= self.last[0]:
            return
        time = np.array([self.last[0], stretch.time[0]])
        ends = np.vstack([self.last[1], stretch.motion[0]])
        if time[1] - time[0] <= LONGEST_BRIDGED_GAP:
            assert np.all(path_between(time, ends) <= LARGEST_MOTION)
        else:
            assert abs(ends[1, 0] - ends[0, 0]) < JOIN
            assert np.all(np.abs(ends[:, 1]) < 0.05)

    @invariant()
    def no_command_beyond_a_limit_and_none_without_a_driver(self):
        if not hasattr(self, "lab"):
            return
        lab = self.lab
        commands = np.array(lab.device.commands[max(self.seen - 2, 0) :])
        self.seen = len(lab.device.commands)
        if len(commands) < 2:
            return
        assert np.all(np.abs(commands[:, 1:]).max(axis=0) <= LARGEST_MOTION)
        steps = np.abs(np.diff(commands[:, 1]))
        assert steps.max() <= 1.021 * VELOCITY / RATE
        assert (
            len(steps) < 2
            or np.abs(np.diff(commands[:, 1], 2)).max() <= 1.03 * ACCELERATION / RATE**2
        )
        valid = np.array(lab.valid)
        place = np.searchsorted(valid, commands[:, 0], side="right") - 1
        silent = commands[:, 0] - valid[np.maximum(place, 0)]
        late = silent > AFTER_LAST_PACKET
        assert np.all(commands[late, 2] == 0.0)
        assert np.all(steps[late[1:]] == 0.0)
        plate = np.array(
            [entry for entry in lab.device.velocities if entry[0] >= commands[0, 0]]
        ).reshape(-1, 2)
        place = np.searchsorted(valid, plate[:, 0], side="right") - 1
        late = plate[:, 0] - valid[np.maximum(place, 0)] > AFTER_LAST_PACKET
        assert np.all(np.abs(plate[late, 1]) < SLOW)
        if late.any() and late[-1]:
            assert lab.device.state in (DeviceState.OFF, DeviceState.FAULT)
