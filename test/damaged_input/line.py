"""Damaged input on the line between driver and rig, and in the reference that goes over it."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ankle_actuator_driver.link.protocol.driver_end import DriverEnd
from ankle_actuator_driver.link.protocol.packet import (
    Heartbeat,
    Reference,
    StateReport,
    build,
    sealed,
)
from ankle_actuator_driver.safety.bridge import Bridge
from ankle_actuator_driver.safety.interpolated_path import path_through
from ankle_actuator_driver.safety.limits import Limits
from ankle_actuator_driver.safety.rig import DeviceFault, DeviceState, RigReport, Status, Wanted
from ankle_actuator_driver.safety.states import State
from damaged_input.damage import (
    ROS,
    Case,
    damaged,
    integer,
    number,
)
from rig_emulator.emulated_device import EmulatedDevice


class Still:
    """A plate that rests."""

    def run(self, command: np.ndarray) -> np.ndarray:
        """Zeros."""
        return np.zeros((len(command), 3))


def _heartbeat(random: np.random.Generator, session: int, rig: int) -> tuple:
    return (
        session if random.random() < 0.5 else integer(random, 32),
        integer(random, 32),
        integer(random, 64, signed=True),
        Wanted(int(random.integers(3))),
        integer(random, 8),
        integer(random, 32),
        rig if random.random() < 0.5 else integer(random, 32),
    )


def packets_to_the_rig(folder: Path) -> Case:
    """Valid digests with extreme contents, and damaged packets."""
    device = EmulatedDevice(Still(), Limits(), 2048.0, 77, 1000.0)
    clock = [1000.0]

    def case(random: np.random.Generator) -> bool:
        head = _heartbeat(random, 5, 77)
        if random.random() < 0.5:
            data = build(Heartbeat(*head))
        else:
            motion = np.array([[number(random, 0.01, 0.17) for _ in range(3)] for _ in range(4)])
            first = round(1e9 * (clock[0] + float(random.uniform(-1, 1))))
            data = build(Reference(*head, first, number(random, 1 / 2048), motion))
        if random.random() < 0.3:
            data = damaged(data, random)
        elif random.random() < 0.1:
            data = sealed(random.bytes(int(random.integers(0, 80))))
        clock[0] += 2e-4
        accepted = isinstance(device.receive(data, clock[0]), Heartbeat)
        device.advance(clock[0])
        position, velocity, acceleration = device.command
        assert abs(position) <= 0.175
        assert abs(velocity) <= 5.0
        assert abs(acceleration) <= 2000.0 * (1 + 1e-5)
        return accepted

    return case


def packets_to_the_driver(folder: Path) -> Case:
    """State reports with extreme contents, and damaged ones."""
    end, bridge, clock = DriverEnd(5), Bridge(Limits(), 0.5, 0.0), [10.0]

    def case(random: np.random.Generator) -> bool:
        samples = np.array([[number(random, 0.01) for _ in range(3)] for _ in range(8)])
        report = StateReport(
            77 if random.random() < 0.8 else integer(random, 32),
            integer(random, 32),
            integer(random, 64, signed=True),
            DeviceState(int(random.integers(5))),
            DeviceFault(int(random.integers(8))),
            Status(int(random.integers(16))),
            integer(random, 32),
            5 if random.random() < 0.5 else integer(random, 32),
            integer(random, 32),
            *(integer(random, 64, signed=True) for _ in range(3)),
            number(random, 1 / 2048),
            number(random, 0.01),
            samples,
        )
        data = build(report)
        if random.random() < 0.3:
            data = damaged(data, random)
        clock[0] += float(random.choice([0.0, 0.004, 0.2]))
        events = end.take(data, clock[0], ROS + clock[0])
        for event in events:
            bridge.take(event, clock[0])
        bridge.advance(clock[0], ROS + clock[0])
        orders = bridge.take_orders(clock[0])
        assert all(order.wanted is Wanted.OFF for order in orders)
        for order in orders:
            end.packets(order, clock[0], ROS + clock[0])
        bridge.samples, bridge.notes, bridge.states.changes = [], [], []
        return bool(events)

    return case


def references(folder: Path) -> Case:
    """Blocks of the reference to a driver whose plate runs."""
    bridge = Bridge(Limits(), 0.5, 0.0)
    held = RigReport(
        DeviceState.OFF, DeviceFault.NONE, Status(0), True, True, True, 0.0, received=1
    )

    def case(random: np.random.Generator) -> bool:
        bridge.take(held, 0.0)
        bridge.states.state = State.RUNNING
        bridge._begin(0.0)
        bridge.orders = []
        count = int(random.choice([0, 1, 2, 8, 32, 100]))
        with np.errstate(all="ignore"):
            steps = np.arange(count) * number(random, *(1 / 2048,) * 20, 1 / 1000)
        start = ROS + float(random.choice([-1.0, 0.0, 0.02, 0.1, 1.0, 5.0]))
        motion = np.zeros((count, 3))
        if random.random() < 0.5:
            motion[:, 0] = 0.02 * np.sin(2 * np.pi * 5.0 * steps) if count else 0.0
            motion[:, 1] = np.gradient(motion[:, 0], 1 / 2048) if count > 2 else 0.0
            motion[:, 2] = np.gradient(motion[:, 1], 1 / 2048) if count > 2 else 0.0
        for column, usual in enumerate((0.05, 1.0, 200.0) if random.random() < 0.3 else ()):
            motion[:, column] = number(random, usual, usual, -usual)
        if count > 2 and random.random() < 0.3:
            motion[int(random.integers(count)), int(random.integers(3))] = number(random, 0.1)
        with np.errstate(all="ignore"):
            bridge.reference(start + steps, motion, 0.0, ROS)
        sent = [order.stretch for order in bridge.orders if order.stretch is not None]
        for stretch in sent:
            path = path_through(stretch.time, stretch.motion)
            assert np.abs(path.position).max() <= 0.175 * (1 + 1e-5)
            assert np.abs(path.velocity).max() <= 5.0 * (1 + 1e-5)
            assert path.largest_acceleration <= 2000.0 * (1 + 1e-5)
        bridge.notes, bridge.states.changes = [], []
        return bool(sent)

    return case
