"""Commands, packets and faults in any order: no reference beyond a limit reaches the rig, and
nothing moves for long without a driver.

A hypothesis state machine over driver and emulated controller in virtual time. After every step the
path that a rig makes of what the driver sent, and all servo samples since the last step, are held
against limits and polynomials of `held_against_limits`. In half of the sequences the rig checks
nothing: the driver alone has to keep the limits.
"""

import copy
from dataclasses import replace

import numpy as np
import pytest
from held_against_limits import RATE, HeldAgainstLimits
from hypothesis import HealthCheck, settings
from hypothesis import strategies as st
from hypothesis.stateful import initialize, rule, run_state_machine_as_test

from ankle_actuator_driver.link.protocol.packet import (
    DeviceState,
    Heartbeat,
    Reference,
    Refusal,
    Wanted,
    build,
    parse,
)
from rig_emulator.faults import Faults

OFF_AFTER_STOP = 1.5  # s; even where the rig ignores its orders
PARTS = st.sampled_from([0.0, 0.02, 0.3, 1.0])


class AlwaysMoving:
    """A reference of sines that hardly ever rests: 0.06 rad, up to 3.3 rad/s and 250 rad/s^2."""

    def __init__(self):
        self.count = 0

    def next(self, n):
        time = (self.count + np.arange(n)) / RATE
        self.count += n
        motion = np.zeros((n, 3))
        for amplitude, frequency in ((0.04, 7.0), (0.02, 11.9)):
            omega = 2 * np.pi * frequency
            motion += amplitude * np.column_stack(
                [
                    np.sin(omega * time),
                    omega * np.cos(omega * time),
                    -(omega**2) * np.sin(omega * time),
                ]
            )
        return motion


class AnyOrder(HeldAgainstLimits):
    """What may happen."""

    laboratory = None
    prepared = None

    def __init__(self):
        super().__init__()
        self.seen, self.session = 0, 5000

    @classmethod
    def prepare(cls):
        """A rig that is ready, one that holds and one that runs; made once and copied."""
        if cls.prepared is None:
            ready = cls.laboratory()
            ready.signal = AlwaysMoving()
            ready.until("ready")
            armed = copy.deepcopy(ready).armed()
            running = copy.deepcopy(ready).running(seconds=0.8)
            cls.prepared = {"ready": ready, "armed": armed, "running": running}

    @initialize(state=st.sampled_from(["running", "armed", "ready"]), unchecked=st.booleans())
    def begin(self, state, unchecked):
        self.prepare()
        self.lab = copy.deepcopy(self.prepared[state])
        self.lab.device.commands, self.lab.device.velocities = self.lab.device.commands[-1:], []
        self.lab.sent, self.lab.obeyed, self.lab.packets = [], [], self.lab.packets[-50:]
        self.lab.stretches, self.kept = [], 0
        self.seen = 0
        self.last = None  # sample sent, with its time, in this run of the plate
        self.unchecked = float(unchecked)
        self.switch()

    def switch(self, **switches):
        """Faults of controller and sensors; the line keeps its own."""
        self.lab.device.faults = Faults(unchecked=self.unchecked, **switches)

    @rule(seconds=st.sampled_from([0.1, 0.002, 0.01, 0.03, 0.3, 0.5]))
    def time_passes(self, seconds):
        self.lab.run(seconds)

    @rule(
        way=st.sampled_from(["driver hangs", "line is cut", "one way is cut", "no reference"]),
        seconds=st.sampled_from([0.3, 0.08, 0.15, 0.6]),
    )
    def silence(self, way, seconds):
        lab = self.lab
        before = lab.talking, lab.down.faults, lab.up.faults, lab.sending
        if way == "driver hangs":
            lab.talking = False
        elif way == "no reference":
            lab.sending = False
        else:
            lab.down.faults = Faults(drop=1.0)
            lab.up.faults = Faults(drop=float(way == "line is cut"))
        lab.run(seconds)
        lab.talking, lab.down.faults, lab.up.faults, lab.sending = before

    @rule(name=st.sampled_from(["arm", "start", "stop", "disarm", "reset_fault"]))
    def operate(self, name):
        self.lab.command(name)
        if name == "stop":
            assert self.lab.state != "running"

    @rule(
        first=st.sampled_from(["arm", "start"]),
        wait=st.sampled_from([0.0, 0.002, 0.006, 0.02]),
    )
    def stop_while_a_command_is_pending(self, first, wait):
        lab = self.lab
        lab.command(first)
        lab.run(wait)
        lab.command("stop")
        assert lab.state not in ("armed", "running")

    @rule(ignores=st.booleans())
    def a_stop_ends_in_rest_whatever_the_rig_does(self, ignores):
        lab = self.lab
        self.switch(ignore_off=float(ignores))
        lab.command("stop")
        lab.run(OFF_AFTER_STOP)
        assert lab.device.state in (DeviceState.OFF, DeviceState.FAULT)
        self.switch()

    @rule(seconds=st.sampled_from([0.05, 0.15, 0.6]))
    def the_thread_that_hears_hangs(self, seconds):
        """References and commands go on: what would be sent later than 100 ms is kept back."""
        lab = self.lab
        lab.hearing = False
        lab.run(min(seconds, 0.104))
        sent = len(lab.packets)
        lab.run(max(seconds - 0.104, 0.0))
        assert all(parse(data).wanted is Wanted.OFF for data in lab.packets[sent:])
        lab.hearing = True

    @rule(shift=st.sampled_from([0.004, 0.0113, -0.007, 0.05]), scale=st.sampled_from([1.0, -1.0]))
    def a_second_generator(self, shift, scale):
        """Another reference in between, at times of its own."""
        lab, other = self.lab, AlwaysMoving()
        other.count = 777
        for _ in range(4):
            lab.run(0.0156)
            if lab.stretches:
                time = lab.stretches[-1].time + shift
                lab.bridge.reference(time, scale * other.next(len(time)), lab.now, lab.ros)
                lab.send()

    @rule(seconds=st.sampled_from([0.0, 0.03, 0.3]))
    def the_generator_starts_anew(self, seconds):
        self.lab.sending = False
        self.lab.run(seconds)
        self.lab.sending, self.lab.signal = True, AlwaysMoving()

    @rule()
    def the_rig_starts_anew(self):
        lab = self.lab
        again = type(lab.device)(
            lab.plant, lab.limits, RATE, 78 + lab.device._session, lab.rig_time
        )
        again.command = (lab.device.command[0], 0.0, 0.0)  # the brake holds the plate
        again.commands, again.velocities = lab.device.commands, lab.device.velocities
        if lab.device.state in (DeviceState.OFF, DeviceState.FAULT):
            lab.device = again
            self.switch()

    @rule()
    def everything_is_repaired_and_brought_up(self):
        lab = self.lab
        lab.down.faults = lab.up.faults = Faults()
        self.switch()
        lab.talking, lab.sending, lab.scale, lab.plant.torque, lab.plant.position = (
            True,
            True,
            1.0,
            None,
            None,
        )
        lab.device.press_emergency_stop(False, lab.rig_time)
        lab.bridge.change_limits(lab.limits, lab.now, lab.ros)
        # A clock that was set is measured anew for a second.
        for name, seconds in (("stop", 0.2), ("reset_fault", 1.2), ("arm", 0.1), ("start", 0.6)):
            lab.command(name)
            lab.run(seconds)
            if name == "stop":
                # What comes behind it is another run of the plate.
                self.no_path_beyond_a_limit_leaves_the_driver()

    @rule(sending=st.booleans())
    def reference_comes_or_not(self, sending):
        self.lab.sending = sending

    @rule(scale=st.sampled_from([0.0, 0.5, 1.0, 1.0, 1.6, 4.0, -3.0, 50.0]))
    def reference_of_another_size(self, scale):
        self.lab.scale = scale

    @rule(
        ahead=st.sampled_from([-1.0, 0.0, 0.05, 0.1, 0.5, 5.0, float("nan")]),
        values=st.lists(
            st.floats(-10, 10) | st.sampled_from([float("nan"), float("inf"), 0.17, 1e300]),
            min_size=3,
            max_size=3,
        ),
        count=st.sampled_from([0, 1, 2, 32, 300]),
        slope=st.booleans(),
    )
    def strange_reference(self, ahead, values, count, slope):
        lab = self.lab
        time = lab.ros + ahead + np.arange(count) / RATE
        motion = np.tile(np.array(values), (count, 1))
        if slope and np.isfinite(values).all():
            motion[:, 0] += motion[:, 1] * np.arange(count) / RATE
        lab.bridge.reference(time, motion, lab.now, lab.ros)
        lab.send()

    @rule(
        drop=PARTS,
        duplicate=PARTS,
        reorder=PARTS,
        corrupt=PARTS,
        burst=st.sampled_from([0.0, 0.05, 0.3]),
        freeze=PARTS,
    )
    def line_fails(self, drop, duplicate, reorder, corrupt, burst, freeze):
        if self.unchecked:
            return  # a rig that checks nothing is not told by the driver what the line has lost
        self.lab.down.faults = self.lab.up.faults = Faults(
            drop, duplicate, reorder, corrupt, burst, float(freeze == 1.0)
        )

    @rule()
    def line_is_good(self):
        self.lab.down.faults = self.lab.up.faults = Faults()

    @rule(pressed=st.booleans())
    def emergency_stop(self, pressed):
        self.lab.device.press_emergency_stop(pressed, self.lab.rig_time)

    @rule(torque=st.sampled_from([None, None, 25.0, 35.0, -60.0, 100.0]))
    def torque(self, torque):
        self.lab.plant.torque = torque

    @rule(position=st.sampled_from([None, None, 0.0, 0.1, 0.5]))
    def encoder(self, position):
        self.lab.plant.position = position

    @rule(talking=st.booleans())
    def driver_hangs_or_not(self, talking):
        self.lab.talking = talking

    @rule()
    def driver_starts_anew(self):
        self.session += 1
        self.lab.new_driver(self.session)
        self.lab.talking = True

    @rule(seconds=st.sampled_from([-3.0, 0.05, 3600.0]))
    def ros_time_is_set(self, seconds):
        self.lab.epoch += seconds

    @rule(data=st.binary(max_size=200))
    def noise(self, data):
        assert isinstance(self.lab.deliver(data), Refusal)

    @rule(place=st.integers(0, 10**6))
    def an_old_packet_comes_again(self, place):
        if self.lab.packets:
            self.lab.deliver(self.lab.packets[place % len(self.lab.packets)])

    @rule(
        wanted=st.sampled_from(list(Wanted)),
        newer=st.integers(-3, 3),
        resets=st.integers(0, 3),
        foreign=st.booleans(),
        ahead=st.sampled_from([-1.0, 0.0, 0.05, 1.0, 3.0]),
        position=st.sampled_from([0.0, 0.02, 0.174, 0.3, 1e200]),
        velocity=st.sampled_from([0.0, 4.0, 5.0, 6.0]),
    )
    def forged_reference(self, wanted, newer, resets, foreign, ahead, position, velocity):
        """A driver gone mad: right session, right digest, any content."""
        if self.unchecked:
            return
        last = parse(self.lab.packets[-1])
        session = 666 if foreign else last.session
        time = np.arange(32) / RATE
        motion = np.column_stack([position + velocity * time, np.full(32, velocity), np.zeros(32)])
        head = (session, (last.sequence + newer) % 2**32, last.sent, wanted, resets, 0, last.rig)
        self.lab.deliver(
            build(Reference(*head, round((self.lab.rig_time + ahead) * 1e9), 1 / RATE, motion))
        )

    @rule(
        wanted=st.sampled_from(list(Wanted)),
        newer=st.integers(-3, 3),
        resets=st.integers(0, 255),
        foreign=st.booleans(),
    )
    def forged_heartbeat(self, wanted, newer, resets, foreign):
        last = parse(self.lab.packets[-1])
        session = 666 if foreign else last.session
        self.lab.deliver(
            build(
                Heartbeat(
                    session, (last.sequence + newer) % 2**32, last.sent, wanted, resets, 0, last.rig
                )
            )
        )

    @rule(angle=st.sampled_from([0.01, 0.05, 0.175]))
    def limits_are_set(self, angle):
        lab = self.lab
        lab.bridge.change_limits(replace(lab.limits, angle=angle), lab.now, lab.ros)


def explore(laboratory, examples, steps):
    AnyOrder.laboratory = laboratory
    run_state_machine_as_test(
        AnyOrder,
        settings=settings(
            max_examples=examples,
            stateful_step_count=steps,
            deadline=None,
            database=None,
            derandomize=examples < 100,
            suppress_health_check=list(HealthCheck),
        ),
    )


@pytest.mark.timeout(1200)  # 15 s of processor time, which a busy machine gives slowly
def test_commands_packets_and_faults_in_any_order(laboratory):
    explore(laboratory, 30, 25)


@pytest.mark.slow
@pytest.mark.timeout(3000)
def test_many_more_orders(laboratory):
    explore(laboratory, 300, 40)
