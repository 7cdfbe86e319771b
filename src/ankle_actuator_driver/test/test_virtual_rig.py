"""Driver and emulated controller together in virtual time: what an operator asks for, and every
fault by name.
"""

from dataclasses import replace

import numpy as np
import pytest

from ankle_actuator_driver.link.protocol.packet import (
    DeviceFault,
    DeviceState,
    Heartbeat,
    Reference,
    Refusal,
    Status,
    Wanted,
    build,
    parse,
)
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings
from rig_emulator.faults import Faults

pytestmark = pytest.mark.live

RATE = 2048.0
OFF_WITHIN = 0.25  # s after the last valid packet


def test_from_first_packet_to_perturbation_and_back(laboratory):
    lab = laboratory()
    assert lab.state == "disabled"
    assert not lab.command("arm").done
    lab.until("ready")
    assert not lab.command("start").done
    assert lab.command("arm").done
    assert not lab.command("start").done  # before the rig has confirmed that it holds
    lab.run(0.1)
    assert lab.command("start").done
    lab.run(3.0)
    commands = lab.commands(lab.rig_time - 2.0)
    assert np.ptp(commands[:, 1]) == pytest.approx(0.04, abs=1e-6)
    assert np.abs(commands[:, 2]).max() == pytest.approx(3.1, abs=0.1)
    assert lab.command("stop").done
    lab.until("ready")
    assert [state.value for state, _ in lab.changes] == [
        "ready",
        "armed",
        "running",
        "stopping",
        "ready",
    ]
    assert lab.device.state is DeviceState.OFF
    assert lab.end.missing == 0
    assert not lab.device.refusals


def test_the_reference_is_followed_at_its_own_time(laboratory):
    lab = laboratory(drift=50e-6).running(seconds=3.0)
    commands = lab.commands(lab.rig_time - 1.0)
    ros = lab.epoch + (commands[:, 0] - lab.offset) / (1.0 + lab.drift)
    count = round((ros[-1] - lab.epoch + 0.1) * RATE)
    wanted = PulseStep(Settings(rate=RATE, seed=1)).next(count)
    expected = np.interp(ros - lab.epoch, np.arange(count) / RATE, wanted[:, 0])
    # The clock is known to half the time between two looks at the line (2 ms), and the plate is
    # told to move at 3.1 rad/s.
    assert np.abs(commands[:, 1] - expected).max() < 3.1 * 1.2e-3


def test_samples_come_evenly_in_ros_time(laboratory):
    lab = laboratory(drift=50e-6).running(seconds=4.0)
    time = np.concatenate(lab.blocks)[:, 0]
    assert np.abs(np.diff(time) * RATE - 1.0).max() < 1e-3
    rig = lab.offset + (time - lab.epoch) * (1.0 + lab.drift)
    # Virtual time looks at the line every 2 ms, which is all that the times can be wrong by.
    phase = (rig - lab.offset) * RATE
    assert np.ptp(phase - np.round(phase)) < 1.0
    assert lab.end.missing == 0


@pytest.mark.parametrize("state", ["armed", "running"])
def test_stop_works_from_every_state_within_50_ms(laboratory, state):
    lab = getattr(laboratory(), state)()
    if state == "running":
        lab.until_moving(2.0)
    at = lab.rig_time
    assert lab.command("stop").done
    lab.run(0.3)
    assert lab.state == "ready"
    commanded, real = lab.moves_until(at)
    assert commanded < 0.05
    assert real < 0.1  # a 30 Hz servo comes to rest 40 ms after its command
    commands = lab.commands()
    assert np.abs(commands[:, 3]).max() <= 2000.0
    for present in ("ready", "disabled"):
        assert lab.command("stop").done
        assert lab.state == present or present == "disabled"


def test_stop_is_answered_before_any_rig_was_heard(laboratory):
    lab = laboratory()
    assert lab.command("stop").done
    assert lab.state == "disabled"


def rests(lab, since):
    """The plate rests from 250 ms after a rig's time on, and the drive is off."""
    lab.run(0.6)
    assert lab.moves_until(since).max() < OFF_WITHIN
    assert lab.device.state in (DeviceState.OFF, DeviceState.FAULT)
    return lab


def test_without_a_reference_the_plate_rests_and_only_arming_leads_on(laboratory):
    lab = laboratory().running().until_moving()
    lab.sending = False
    rests(lab, lab.rig_time)
    assert lab.state == "ready"
    assert "no further reference came in time" in lab.bridge.states.reason
    lab.sending = True
    at = lab.rig_time
    lab.run(1.0)
    assert lab.moves_until(at).max() == 0.0
    assert lab.state == "ready"
    lab.running()


def test_a_driver_that_dies_leaves_a_rig_that_rests_and_a_new_one_needs_a_reset(laboratory):
    lab = laboratory().running().until_moving()
    lab.talking = False
    at = lab.valid[-1]
    rests(lab, at)
    assert lab.device.fault is DeviceFault.HEARTBEAT_LOST
    lab.new_driver(4712)
    lab.talking = True
    lab.until("fault")
    assert "heartbeat lost" in lab.bridge.states.reason
    assert not lab.command("arm").done
    assert lab.command("reset_fault").done
    lab.running()


def test_a_rig_that_holds_is_off_when_its_driver_dies(laboratory):
    lab = laboratory().armed()
    lab.talking = False
    lab.run(0.095)
    assert lab.device.state is DeviceState.HOLD
    rests(lab, lab.valid[-1])
    assert lab.device.fault is DeviceFault.HEARTBEAT_LOST


def test_a_rig_that_falls_silent_is_a_fault(laboratory):
    lab = laboratory().running().until_moving()
    lab.up.faults = lab.down.faults = Faults(freeze=1.0)
    at = lab.rig_time
    rests(lab, at)
    lab.until("fault")
    assert "nothing valid came from the rig for 100 ms" in lab.bridge.states.reason
    lab.up.faults = lab.down.faults = Faults()
    lab.run(1.0)
    assert lab.state == "fault"
    assert lab.command("reset_fault").done
    lab.running()


def test_the_emergency_stop_stops_and_has_to_be_released_before_a_reset(laboratory):
    lab = laboratory().running().until_moving()
    at = lab.rig_time
    lab.device.press_emergency_stop(True, at)
    rests(lab, at)
    assert lab.state == "fault"
    assert "emergency stop" in lab.bridge.states.reason
    refused = lab.command("reset_fault")
    assert not refused.done
    assert "pressed" in refused.sentence
    lab.device.press_emergency_stop(False, lab.rig_time)
    lab.run(0.1)
    assert lab.state == "fault"
    assert lab.command("reset_fault").done
    lab.running()


def test_a_stuck_encoder_is_found(laboratory):
    lab = laboratory().running()
    lab.faults(encoder_stuck=1.0)
    lab.until("fault", 1.5)
    assert "encoder" in lab.bridge.states.reason
    rests(lab, lab.rig_time)


def test_a_torque_beyond_the_limit_yields_and_is_a_fault_when_it_stays(laboratory):
    lab = laboratory().armed()
    before = lab.device.command[0]
    lab.plant.torque = 45.0
    lab.run(0.15)
    assert lab.device.status & Status.YIELDING
    assert lab.device.command[0] < before - 0.02
    lab.until("fault")
    assert "torque" in lab.bridge.states.reason
    rests(lab, lab.rig_time)


def test_a_torque_that_the_yielding_takes_away_is_no_fault(laboratory):
    lab = laboratory(plant=None)
    lab.plant.stiffness = 1000.0  # 40 N.m at 0.04 rad: a foot that is far too stiff
    lab.running(seconds=3.0)
    blocks = np.concatenate(lab.blocks[-100:])
    assert 29.0 < np.abs(blocks[:, 3]).max() < 41.0
    commands = lab.commands(lab.rig_time - 1.0)
    assert commands[:, 1].min() < -1e-3  # gave way


def test_a_reference_beyond_a_limit_never_leaves_the_driver(laboratory):
    for scale in (1.7, 5.0, -5.0):
        lab = laboratory().running()
        lab.scale = scale
        lab.until("fault")
        assert "limit" in lab.bridge.states.reason
        assert lab.device.refusals[Refusal.LIMIT] == 0
        assert max(np.abs(motion[:, 1]).max() for motion in lab.sent) <= lab.limits.velocity
        rests(lab, lab.rig_time)


def test_a_reference_beyond_a_limit_is_refused_by_the_rig_too(laboratory):
    lab = laboratory().running()
    motion = np.tile([0.3, 0.0, 0.0], (32, 1))
    last = parse(lab.packets[-1])
    forged = Reference(
        last.session,
        last.sequence + 1,
        0,
        Wanted.FOLLOW,
        last.resets,
        0,
        last.rig,
        round((lab.rig_time + 0.1) * 1e9),
        1 / RATE,
        motion,
    )
    at = lab.rig_time
    assert lab.deliver(build(forged)) is Refusal.LIMIT
    rests(lab, at)
    assert lab.device.fault is DeviceFault.REFERENCE_BEYOND_LIMIT
    assert lab.state == "fault"


def test_lost_doubled_reordered_and_damaged_packets_are_counted_and_survived(laboratory):
    lab = laboratory().running()
    lab.down.faults = Faults(drop=0.02, duplicate=0.1, corrupt=0.02)
    lab.up.faults = Faults(drop=0.03, duplicate=0.1, corrupt=0.03)
    lab.run(5.0)
    assert lab.state == "running", lab.bridge.states.reason
    assert lab.device.refusals[Refusal.OLD] > 10
    assert lab.device.refusals[Refusal.DIGEST] > 2
    assert lab.end.refusals[Refusal.OLD] > 10
    time = np.concatenate(lab.blocks)[:, 0]
    gaps = np.round(np.diff(time) * RATE).astype(int) - 1
    assert gaps.min() == 0
    assert gaps.sum() == lab.end.missing > 0
    commands = lab.commands()
    assert np.abs(commands[:, 1:]).max(axis=0)[1:].tolist() <= [5.0, 2000.0]


def test_bursts_of_latency_do_not_reach_the_times(laboratory):
    lab = laboratory().running(seconds=3.0)
    for line in (lab.up, lab.down):
        line.faults = Faults(burst=0.04)
    lab.run(6.0)
    assert lab.state == "running", lab.bridge.states.reason
    time = np.concatenate(lab.blocks)[:, 0]
    assert np.abs(np.diff(time) * RATE - 1.0).max() < 1e-3


def test_two_drivers_do_not_share_a_rig(laboratory):
    lab = laboratory().running()
    other = Heartbeat(99, 1, 0, Wanted.OFF, 0, 0, 77)
    assert lab.deliver(build(other)) is Refusal.SESSION
    lab.run(0.5)
    assert lab.state == "running"


def test_old_packets_that_come_again_do_nothing(laboratory):
    lab = laboratory().running()
    assert lab.command("stop").done
    lab.until("ready")
    lab.run(0.5)
    at = lab.rig_time
    for data in list(lab.packets):
        assert isinstance(lab.deliver(data), Refusal)
    lab.run(0.5)
    assert lab.moves_until(at).max() == 0.0
    assert lab.device.state is DeviceState.OFF


def test_a_rig_that_starts_anew_has_to_be_armed_anew(laboratory):
    lab = laboratory().running()
    again = type(lab.device)(lab.plant, lab.limits, RATE, 78, lab.rig_time)
    lab.device = again
    lab.until("fault")
    assert lab.command("reset_fault").done
    lab.running()


def test_ros_time_that_is_set_stops_the_rig_and_is_reported(laboratory):
    lab = laboratory().running()
    lab.epoch += 5.0
    lab.until("fault")
    assert "ROS time was set by +5.000 s" in lab.bridge.states.reason
    rests(lab, lab.rig_time)


def test_a_late_reference_is_reported_with_the_parameter_that_helps(laboratory):
    lab = laboratory(lead=-0.03)
    lab.armed()
    assert lab.command("start").done
    lab.run(0.8)
    assert lab.state == "ready"
    assert any("perturbation_generator.lead" in note for note in lab.notes)
    assert not lab.obeyed


def test_limits_may_be_tightened_while_it_runs(laboratory):
    lab = laboratory().running()
    lab.bridge.limits = replace(lab.limits, angle=0.02)
    lab.until("fault")
    assert "limit of 0.02 rad" in lab.bridge.states.reason
