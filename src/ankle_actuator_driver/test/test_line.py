"""What comes over the line is obeyed only where it is of this rig, this driver and this time."""

from dataclasses import replace

import numpy as np
import pytest

from ankle_actuator_driver.link.protocol.driver_end import OTHER_DRIVER_SILENCE, DriverEnd
from ankle_actuator_driver.link.protocol.packet import Refusal, build, parse
from ankle_actuator_driver.safety.rig import DeviceState, Order, Wanted
from rig_emulator.faults import Faults

pytestmark = pytest.mark.live


def test_a_clock_of_the_rig_that_is_set_stops_the_plate_with_the_next_packets(laboratory):
    lab = laboratory().running()
    lab.offset, lab.device._begin = lab.offset + 5.0, lab.device._begin + 5.0
    lab.run(0.04)
    assert lab.state in ("stopping", "fault")
    assert "the rig's clock was set by +5 s" in lab.bridge.states.reason


def test_packets_that_waited_while_the_driver_was_held_up_are_no_clock_that_was_set(laboratory):
    lab = laboratory().running()
    lab.offset, lab.device._begin = lab.offset - 5.0, lab.device._begin - 5.0
    lab.run(0.04)
    assert lab.state in ("stopping", "fault")
    assert "came 5 s late: this computer held the driver up" in lab.bridge.states.reason


def test_a_driver_that_no_longer_hears_sends_nothing_after_100_ms(laboratory):
    lab = laboratory(lead=0.6).running()
    lab.hearing = False
    lab.run(0.11)
    sent = len(lab.packets)
    lab.run(1.0)
    assert len(lab.packets) == sent
    assert lab.device.state in (DeviceState.OFF, DeviceState.FAULT)


def test_a_driver_that_no_longer_hears_still_stops(laboratory):
    lab = laboratory().running()
    lab.hearing = False
    lab.run(0.11)
    sent = len(lab.packets)
    assert lab.command("stop").done
    assert [parse(data).wanted for data in lab.packets[sent:]] == [Wanted.OFF]


def stand_still(lab, seconds):
    """The computer of driver and rig stands still for so long [s]."""
    before = lab.rig_time
    lab.now += seconds
    lab.device.look(before, lab.rig_time)


def test_a_computer_that_stood_still_is_no_silence_of_the_line(laboratory):
    lab = laboratory(lead=0.6).running()
    stand_still(lab, 0.12)
    lab.run(0.5)
    assert lab.state == "running"
    assert lab.device.state is DeviceState.FOLLOW


def test_a_computer_that_stood_still_for_longer_than_200_ms_stops_the_plate(laboratory):
    lab = laboratory(lead=0.6).running()
    stand_still(lab, 0.25)
    lab.run(0.1)
    assert lab.state in ("stopping", "fault")
    assert lab.device.state is not DeviceState.FOLLOW


@pytest.mark.parametrize("pause", [0.002, 0.03, 0.09])
def test_a_silent_rig_is_noticed_within_200_ms_by_a_driver_that_is_put_aside_again_and_again(
    laboratory, pause
):
    lab = laboratory(lead=0.6).running()
    lab.up.faults = Faults(drop=1.0)
    began = lab.now
    while lab.state == "running" and lab.now < began + 1.0:
        lab.now += pause
        lab.run(0.002)
    assert lab.now - began < 0.2 + pause + 0.03
    assert "nothing valid came" in lab.bridge.states.reason


def test_a_driver_that_hears_again_in_time_loses_nothing(laboratory):
    lab = laboratory(lead=0.6).running()
    lab.hearing = False
    lab.run(0.09)
    lab.hearing = True
    lab.run(1.0)
    assert lab.state == "running", lab.bridge.states.reason


def extreme(report, **fields):
    return build(replace(report, **fields))


@pytest.mark.parametrize(
    "fields",
    [
        {"sent": 2**62, "first": 2**62},
        {"sent": -(2**62), "first": -(2**62)},
        {"echo": 2**62},
        {"echo_received": -(2**62)},
        {"first": 0},
        {"sent": 2**63 - 1},
        {"samples": np.full((4, 3), 1e308)},
        {"interval": 0.02, "first": 2**62, "sent": 2**62},
    ],
)
def test_valid_packets_with_extreme_contents_harm_nobody(laboratory, fields):
    lab = laboratory().running()
    real = parse(lab_report(lab))
    for step in range(200):
        lab.take(extreme(real, sequence=(real.sequence + 1 + step) % 2**32, **fields))
        lab.run(0.002)
    lab.run(1.5)
    assert lab.device.state in (DeviceState.OFF, DeviceState.FAULT, DeviceState.FOLLOW)
    assert np.abs(lab.commands()[:, 1:]).max(axis=0).tolist() <= [0.175, 5.0, 2000.0]
    assert np.isfinite(lab.end.clock.drift)


def lab_report(lab):
    """The newest state packet of the rig."""
    from ankle_actuator_driver.link.protocol.packet import build as sealed

    return sealed(lab.device._report(lab.rig_time))


def test_a_packet_for_another_start_of_the_rig_and_a_former_session_are_refused(laboratory):
    lab = laboratory().armed()
    old = parse(lab.packets[-1])
    assert lab.deliver(build(replace(old, rig=123, sequence=old.sequence + 1))) is Refusal.START
    lab.command("disarm")
    lab.until("ready")
    kept = list(lab.packets)
    lab.new_driver(4800)
    lab.until("ready")
    for data in kept:
        assert isinstance(lab.deliver(data), Refusal)
    again = replace(old, sequence=(old.sequence + 10_000) % 2**32)
    assert lab.deliver(build(again)) is Refusal.SESSION


def test_only_a_driver_with_the_key_moves_the_rig(laboratory):
    lab = laboratory(key=b"k" * 16).running()
    at = len(lab.device.commands)
    forged = build(replace(parse(lab.packets[-1], lab.key), wanted=Wanted.OFF))
    assert lab.deliver(forged) is Refusal.DIGEST
    lab.run(0.5)
    assert lab.state == "running"
    assert len(lab.device.commands) > at
    lab.take(build(replace(parse(lab_report(lab)), sequence=2**20)))
    assert lab.end.refusals[Refusal.DIGEST] == 1


def test_a_rig_that_speaks_for_another_driver_is_not_ours(laboratory):
    lab = laboratory().running()
    lab.device._host.session = 99
    lab.until("fault", 0.5)
    assert "obeys another driver" in lab.bridge.states.reason or "no heartbeat" in (
        lab.bridge.states.reason
    )


def test_a_clock_of_the_rig_that_leaps_stops_the_plate(laboratory):
    lab = laboratory().running()
    lab.device._begin += 30.0
    lab.offset += 30.0
    lab.until("fault", 1.0)
    assert "clock was set" in lab.bridge.states.reason


def test_whoever_begins_with_following_or_holding_is_not_obeyed(laboratory):
    lab = laboratory().until("ready")
    first = replace(parse(lab.packets[-1]), rig=0, wanted=Wanted.HOLD, sequence=2**20)
    assert lab.deliver(build(first)) is Refusal.CONTENT
    lab.new_driver(4900)
    lab.device._host.asked_off = False
    hold = replace(parse(lab.packets[-1]), session=5000, wanted=Wanted.HOLD, sequence=1)
    lab.deliver(build(hold))
    assert lab.device.state is DeviceState.OFF


def test_a_packet_whose_samples_cannot_be_of_its_time_is_refused(laboratory):
    lab = laboratory().until("ready")
    real = parse(lab_report(lab))
    for place, first in enumerate((real.sent - 10_000_000_000, real.sent + 10_000_000_000)):
        lab.take(extreme(real, sequence=real.sequence + 1 + place, first=first))
    assert lab.end.refusals[Refusal.TIME] == 2


def once(lab, change):
    """Change the next report of the rig that has samples; gives a list that holds it then."""
    take, changed = lab.take, []

    def take_changed(data):
        report = parse(data)
        if not len(report.samples):
            return take(data)
        lab.take = take
        changed.append(report)
        return take(build(change(report)))

    lab.take = take_changed
    return changed


def test_a_report_whose_samples_lie_in_the_future_costs_no_more_than_its_own_samples(laboratory):
    lab = laboratory().until("ready").run(0.5)
    changed = once(lab, lambda report: replace(report, first=report.first + 1_500_000_000))
    lab.run(2.0)
    assert lab.state == "ready"
    assert lab.end.missing == len(changed[0].samples) > 0
    time = np.concatenate(lab.blocks)[:, 0]
    assert np.diff(time).min() > 0.0
    assert lab.ros - time[-1] < 0.1


def another_driver(lab, seconds):
    """Let another driver take the rig and speak to it for a while; the rig is off."""
    other = DriverEnd(99)
    other.take(lab_report(lab), lab.now, lab.ros)
    end = lab.now + seconds
    while lab.now < end:
        for data in other.packets(Order(Wanted.OFF, 0), lab.now, lab.ros):
            lab.device.receive(data, lab.rig_time)
        lab.run(0.02)
    assert lab.device.host == 99


def test_a_driver_whose_rig_was_taken_is_not_ready_and_leaves_it_to_the_other_one(laboratory):
    lab = laboratory().until("ready")
    another_driver(lab, 3.0 * OTHER_DRIVER_SILENCE)
    assert lab.state == "disabled"
    assert "another driver has taken it" in lab.bridge.states.reason
    assert not lab.command("arm").done


def test_a_driver_whose_rig_was_taken_has_it_again_once_the_other_one_is_silent(laboratory):
    lab = laboratory().until("ready")
    another_driver(lab, 0.5)
    assert lab.state == "disabled"
    lab.until("ready", OTHER_DRIVER_SILENCE + 0.5)
    assert any("takes the rig again" in note for note in lab.notes)
    lab.running()


def test_a_driver_does_not_take_a_rig_that_another_one_has_left_under_power(laboratory):
    lab = laboratory().until("ready")
    another_driver(lab, 0.5)
    lab.device.faults = Faults(unchecked=1.0)
    lab.device.state = DeviceState.HOLD
    lab.device._heartbeats.expired = lambda now: False  # a rig without its watchdog
    lab.run(3.0 * OTHER_DRIVER_SILENCE)
    assert not any("takes the rig again" in note for note in lab.notes)
    assert lab.state == "disabled"
