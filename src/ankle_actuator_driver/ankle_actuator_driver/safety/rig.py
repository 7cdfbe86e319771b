"""What the driver and a rig say to each other, whatever carries it: orders out, reports in."""

from __future__ import annotations

from dataclasses import dataclass, field
from enum import Enum, IntEnum, IntFlag

import numpy as np


class Wanted(IntEnum):
    """Names what the driver wants the rig to do. OFF always means: a smooth stop first, if the
    plate moves.
    """

    OFF = 0
    HOLD = 1
    FOLLOW = 2


class DeviceState(IntEnum):
    """Names what the rig does."""

    OFF = 0
    HOLD = 1
    FOLLOW = 2
    STOPPING = 3
    FAULT = 4


class DeviceFault(IntEnum):
    """Names why the rig is, or is about to be, in `DeviceState.FAULT`."""

    NONE = 0
    HEARTBEAT_LOST = 1
    REFERENCE_BEYOND_LIMIT = 2
    MOTION_BEYOND_LIMIT = 3
    TORQUE = 4
    ENCODER = 5
    FOLLOWING_ERROR = 6
    EMERGENCY_STOP = 7


class Status(IntFlag):
    """Lists further properties of the rig, one bit each."""

    EMERGENCY_STOP_PRESSED = 1
    YIELDING = 2
    REFERENCE_BRIDGED = 4
    REFERENCE_LOST = 8


UNPOWERED = (DeviceState.OFF, DeviceState.FAULT)
"""States of the rig in which the drive has no power."""


class Purpose(Enum):
    """Names the reason why an order leaves; a driver that no longer hears the rig may send a stop
    only.
    """

    HEARTBEAT = "heartbeat"
    REFERENCE = "reference"
    STOP = "stop"


@dataclass(frozen=True)
class Stretch:
    """Holds evenly spaced samples of the motion that the plate is to follow.

    Attributes
    ----------
    time
        ROS times at which the samples are due [s], shape (n,), n of at least 2.
    motion
        Position [rad], velocity [rad/s], acceleration [rad/s^2], shape (n, 3).
    """

    time: np.ndarray
    motion: np.ndarray


@dataclass(frozen=True)
class Order:
    """Holds what the driver orders; every order is a heartbeat as well.

    Attributes
    ----------
    wanted
        What the rig is to do.
    resets
        Number of fault resets, modulo 256.
    purpose
        Why it leaves.
    stretch
        Reference that goes with it, or None.
    """

    wanted: Wanted
    resets: int
    purpose: Purpose = Purpose.HEARTBEAT
    stretch: Stretch | None = None


@dataclass(frozen=True)
class RigReport:
    """Holds what a rig says of itself, in ROS time.

    Attributes
    ----------
    state, fault, status
        Of the rig.
    obeys
        Whether the rig obeys this driver.
    answered
        Whether the rig had heard the driver's last change of `Order.wanted` when it reported.
    clock_ready
        Whether the rig's time can be given in ROS time.
    commanded
        Position that the servo was given at the last sample [rad].
    time
        ROS times of the samples [s], shape (n,); empty where they cannot be dated.
    samples
        Measured position [rad], velocity [rad/s] and torque [N.m], shape (n, 3); as long as `time`.
    received
        Samples that came with the report, dated or not.
    """

    state: DeviceState
    fault: DeviceFault
    status: Status
    obeys: bool
    answered: bool
    clock_ready: bool
    commanded: float
    time: np.ndarray = field(default_factory=lambda: np.empty(0))
    samples: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    received: int = 0


@dataclass(frozen=True)
class Interruption:
    """Says that the line was interrupted: the rig has started anew, or a clock was set.

    Attributes
    ----------
    sentence
        What happened.
    """

    sentence: str


@dataclass(frozen=True)
class Remark:
    """Tells the operator a sentence that changes nothing.

    Attributes
    ----------
    sentence
        What happened.
    """

    sentence: str


Event = RigReport | Interruption | Remark
"""What a link gives to the driver."""
