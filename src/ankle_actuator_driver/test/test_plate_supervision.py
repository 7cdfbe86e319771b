"""Driver and rig find a plate, a servo and sensors that do not do what was commanded."""

import re
from dataclasses import replace

import pytest
from virtual_laboratory import unchecked

from ankle_actuator_driver.safety.rig import DeviceState

pytestmark = pytest.mark.live


@pytest.mark.parametrize("state", ["armed", "running"])
def test_a_rig_that_does_not_switch_off_gets_no_heartbeats(laboratory, state):
    lab = getattr(laboratory(lead=1.5), state)()
    lab.faults(ignore_off=1.0)
    lab.command("stop")
    lab.run(0.8)
    assert lab.state == "fault"
    assert lab.device.state in (DeviceState.OFF, DeviceState.FAULT)
    assert lab.device.fault.name == "HEARTBEAT_LOST"
    assert "confirm" in lab.bridge.states.reason


def test_a_rig_that_powers_itself_while_the_driver_is_ready_or_in_fault_is_left_alone(laboratory):
    for state in ("ready", "fault"):
        lab = laboratory().until("ready")
        if state == "fault":
            lab.bridge.states.trip("a test", lab.now)
        lab.faults(ignore_off=1.0)
        lab.device.state = DeviceState.HOLD
        lab.run(1.0)
        assert lab.state == "fault"
        assert lab.device.state in (DeviceState.OFF, DeviceState.FAULT)


SENSOR_FAULTS = [
    ("encoder_slip", 0.03, "slips|one of the two sensors is wrong"),
    ("encoder_stuck", 1.0, "encoder"),
    ("velocity_stuck", 1.0, "velocity"),
    ("torque_dead", 1.0, "torque sensor dead"),
    ("torque_saturated", 1.0, "torque"),
    ("torque_swings", 0.5, "swings beyond the limit"),
    ("no_samples", 1.0, "no samples"),
    ("nan", 1.0, "nothing valid came"),
]


@pytest.mark.parametrize(("switch", "size", "words"), SENSOR_FAULTS)
def test_a_sensor_that_fails_is_a_fault_within_200_ms_of_its_first_wrong_sign(
    laboratory, switch, size, words
):
    """Found by the driver: the rig checks nothing. What shows in motion only is timed from the
    beginning of the next movement."""
    lab = unchecked(laboratory)
    lab.until_moving(0.5)
    lab.run(0.04)
    lab.faults(unchecked=1.0, **{switch: size})
    lab.until_moving(0.5)
    at = lab.now
    while lab.state == "running":
        lab.run(0.002)
        assert lab.now - at < 0.5
    assert re.search(words, lab.bridge.states.reason)
    assert lab.now - at <= 0.2


def test_a_line_that_hangs_for_60_ms_contradicts_no_sensor(laboratory):
    """Shorter than a watchdog, in motion: samples are missing, but none of those that came is
    wrong."""
    lab = laboratory(lead=0.5).until("ready").run(0.3).running(2.0)
    for _ in range(4):
        lab.until_moving(0.2)
        missing = lab.end.missing
        lab.faults(freeze=1.0)
        lab.run(0.06)
        lab.faults()
        lab.run(0.3)
        assert lab.state == "running", lab.bridge.states.reason
        assert lab.end.missing > missing


@pytest.mark.parametrize(("switch", "size"), [("encoder_slip", 0.03), ("velocity_stuck", 1.0)])
def test_sensors_are_judged_though_a_tenth_of_the_packets_is_lost(laboratory, switch, size):
    lab = unchecked(laboratory)
    lab.until_moving(0.5)
    lab.faults(unchecked=1.0, drop=0.1, **{switch: size})
    lab.until("fault", 1.0)
    assert re.search("slips|sensors is wrong", lab.bridge.states.reason)


def test_a_rig_that_does_not_follow_the_reference_is_a_fault(laboratory):
    lab = unchecked(laboratory)
    lab.faults(unchecked=1.0, ignore_reference=1.0)
    lab.until("fault", 1.5)
    assert "from the reference that it was sent" in lab.bridge.states.reason


def test_a_small_command_that_the_encoder_does_not_follow_is_a_fault(laboratory):
    lab = laboratory()
    lab.scale = 0.05  # 2 mrad
    lab.running()
    lab.faults(unchecked=1.0, encoder_stuck=1.0)
    lab.until("fault", 1.5)
    assert "encoder" in lab.bridge.states.reason


def test_spikes_of_a_sensor_are_counted_and_stop_nothing(laboratory):
    lab = laboratory()
    lab.limits = replace(lab.limits)
    lab.running()
    lab.plant.faults = replace(lab.plant.faults, encoder_spikes=0.002)
    lab.device.faults = replace(lab.device.faults, unchecked=1.0)
    lab.bridge.limits = replace(lab.limits, angle=0.175)
    lab.run(0.5)
    assert lab.bridge.sensors.spikes > 0 or lab.state != "running"


def test_a_measured_position_beyond_the_limit_is_a_fault(laboratory):
    lab = unchecked(laboratory)
    lab.bridge.expectations = replace(lab.bridge.expectations, following=10.0)
    lab.plant.position = 0.2
    lab.bridge.sensors._velocity_contradicts = lambda window: None
    lab.until("fault", 0.3)
    assert "passes the limit of 0.175 rad" in lab.bridge.states.reason


def test_the_driver_yields_to_a_torque_though_the_rig_does_not(laboratory):
    lab = unchecked(laboratory)
    lab.plant.torque = 80.0
    lab.run(0.16)
    assert lab.bridge._yield.offset < -0.005
    lab.until("fault", 0.3)


def test_a_rig_that_never_confirms_is_a_fault_after_half_a_second(laboratory):
    lab = laboratory().until("ready")
    lab.down.faults = replace(lab.down.faults, drop=1.0)
    lab.command("arm")
    lab.until("fault", 1.5)
    assert "where it should hold" in lab.bridge.states.reason


def test_a_drive_that_is_far_from_its_command_is_a_fault_of_the_rig(laboratory):
    lab = laboratory().armed()
    lab.plant.faults = replace(lab.plant.faults, encoder_slip=0.1)
    lab.run(0.05)
    assert lab.device.fault.name in ("FOLLOWING_ERROR", "HEARTBEAT_LOST", "ENCODER")
    assert lab.device.fault.name == "FOLLOWING_ERROR"


def test_the_rig_finds_a_torque_that_stays_without_the_driver(laboratory):
    lab = laboratory().armed()
    lab.bridge.sensors.fault = lambda *arguments: None
    lab.plant.torque = 45.0
    lab.run(0.4)
    assert lab.device.fault.name == "TORQUE"
