"""The driver alone keeps everything from the line that a rig without any check would carry out."""

from dataclasses import replace

import numpy as np
import pytest
from held_against_limits import ENDS
from virtual_laboratory import unchecked

from ankle_actuator_driver.safety.continuation import contradiction
from ankle_actuator_driver.safety.interpolated_path import path_through
from ankle_actuator_driver.safety.limits import Limits
from ankle_actuator_driver.safety.rig import DeviceState, Wanted
from perturbation_generator.multisine import Multisine
from perturbation_generator.prbs import Prbs
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

pytestmark = pytest.mark.live
RATE = 2048.0
LIMITS = Limits()


def stretch(lab, after, position, velocity=0.0, acceleration=0.0, count=32):
    """Times and motion of a block that begins so long after the end of what was sent [s]."""
    time = lab.bridge._path.end + after + np.arange(1, count + 1) / RATE
    since = np.arange(1, count + 1) / RATE
    motion = np.column_stack(
        [
            position + velocity * since + 0.5 * acceleration * since**2,
            velocity + acceleration * since,
            np.full(count, acceleration),
        ]
    )
    return time, motion


def give(lab, time, motion):
    before = len(lab.sent)
    lab.bridge.reference(time, motion, lab.now, lab.ros)
    lab.send()
    return len(lab.sent) > before


def last(lab):
    return lab.stretches[-1].motion[-1]


def stays_at_rest(lab):
    """Until the reference rests, and no further one comes by itself."""
    end = lab.now + 3.0
    while np.abs(lab.stretches[-1].motion[:, 1:]).max() > 1e-9:
        lab.run(0.01)
        assert lab.now < end
    lab.sending = False
    return lab


def test_a_velocity_that_turns_round_at_the_seam_of_two_blocks_is_refused(laboratory):
    lab = unchecked(laboratory)
    lab.sending = False
    x, v, _ = last(lab)
    assert not give(lab, *stretch(lab, 0.0, x, -v - 1.3))
    assert lab.state in ("stopping", "fault")
    assert "on the way from the last block" in lab.bridge.states.reason


def test_a_jump_after_a_gap_is_refused(laboratory):
    for gap in (0.03, 0.06):
        lab = stays_at_rest(unchecked(laboratory, lead=0.3))
        x = last(lab)[0]
        assert not give(lab, *stretch(lab, gap, x - 0.1 if x > 0 else x + 0.1))
        lab.until("fault" if gap == 0.03 else "ready")
        assert "reference refused" in lab.bridge.states.reason


def test_a_reference_that_rests_may_pause_and_go_on(laboratory):
    lab = stays_at_rest(unchecked(laboratory, lead=0.3))
    assert give(lab, *stretch(lab, 0.06, last(lab)[0]))
    assert lab.state == "running"


def test_a_second_generator_is_refused_whatever_its_phase(laboratory):
    for shift in (0.004, 0.0117):
        lab = unchecked(laboratory)
        other = PulseStep(Settings(rate=RATE, seed=9))
        for _ in range(60):
            lab.run(0.0156)
            if lab.state != "running":
                break
            time = lab.stretches[-1].time + shift
            give(lab, time, other.next(32))
        assert lab.state in ("fault", "stopping")
        assert "two sources" in lab.bridge.states.reason


def test_two_publishers_are_refused_by_name_and_stop_a_rig_that_runs(laboratory):
    lab = laboratory().until("ready")
    both = ["/perturbation_generator", "/session_replayer"]
    lab.bridge.reference_sources(both, lab.now)
    refused = lab.command("arm")
    assert not refused.done
    assert "/perturbation_generator, /session_replayer" in refused.sentence
    lab.bridge.reference_sources(both[:1], lab.now)
    lab.running(0.5)
    lab.bridge.reference_sources(both, lab.now)
    lab.until("fault")
    assert "/session_replayer" in lab.bridge.states.reason


def test_a_start_is_refused_by_name_while_the_generator_waits_for_its_readers(laboratory):
    lab = laboratory()
    lab.sending = False
    lab.armed().run(0.5)
    lab.bridge.reference_sources([], lab.now)
    assert "no node publishes the reference" in lab.command("start").sentence
    lab.bridge.reference_sources(["/perturbation_generator"], lab.now, ["/recorder"])
    refused = lab.command("start")
    assert not refused.done
    assert "/perturbation_generator" in refused.sentence
    assert "read by /recorder" in refused.sentence
    assert "wait_for_readers" in refused.sentence
    assert lab.state == "armed"
    lab.sending = True
    lab.run(0.05)
    assert lab.command("start").done


@pytest.mark.parametrize("state", ["armed", "running"])
def test_a_driver_that_no_longer_takes_commands_stops_the_plate(laboratory, state):
    lab = getattr(laboratory(), state)()
    for _ in range(15):
        lab.bridge.reference_sources(["/perturbation_generator"], lab.now)
        lab.run(0.1)
    assert lab.state == state
    at = lab.rig_time
    lab.run(1.3)
    assert lab.state == "ready"
    assert "took no commands" in lab.bridge.states.reason
    assert lab.moves_until(at).max() < 1.2


def test_lower_limits_stop_a_plate_that_is_on_its_way_beyond_them(laboratory):
    lab = laboratory(lead=1.0).running().until_moving()
    lab.bridge.change_limits(replace(LIMITS, angle=0.1), lab.now, lab.ros)
    assert lab.state == "running"  # what was sent keeps within these
    lab.bridge.change_limits(replace(LIMITS, velocity=0.5), lab.now, lab.ros)
    assert lab.state == "stopping"
    assert "passes the limit of 0.5 rad/s" in lab.bridge.states.reason
    lab.send()
    at = lab.rig_time
    lab.run(0.5)
    assert lab.moves_until(at).max() < 0.2
    assert lab.state == "ready"


def test_a_refused_block_is_not_even_kept_to_be_sent(laboratory):
    lab = unchecked(laboratory)
    lab.sending = False
    x, v, _ = last(lab)
    for after, velocity in ((0.0, -v - 1.3), (0.06, v)):
        time, motion = stretch(lab, after, x - 0.1, velocity)
        lab.bridge.reference(time, motion, lab.now, lab.ros)
        assert not any(order.stretch is not None for order in lab.bridge.orders)
        assert lab.bridge._path.end < time[0]


def test_a_first_block_from_the_past_starts_softly_and_in_the_future(laboratory):
    lab = laboratory()
    lab.faults(unchecked=1.0)
    lab.armed()
    lab.sending = False
    assert lab.command("start").done
    lab.run(0.05)
    count = int(1.6 * RATE)
    time = lab.ros - 1.5 + np.arange(count) / RATE
    phase = 2 * np.pi * (time - time[0])
    motion = 0.1 * np.column_stack(
        [np.cos(phase), -2 * np.pi * np.sin(phase), -((2 * np.pi) ** 2) * np.cos(phase)]
    )
    lab.bridge.reference(time, motion, lab.now, lab.ros)
    lab.send()
    assert lab.stretches[0].time[0] > lab.ros
    assert np.abs(lab.sent[0][0] - [lab.bridge._path.held, 0.0, 0.0]).max() < 1e-6
    lab.run(0.3)
    commands = lab.commands()
    assert np.abs(np.diff(commands[:, 1])).max() < LIMITS.velocity / RATE


@pytest.mark.parametrize(
    ("column", "by", "words"),
    [
        (1, 0.3, "velocity column says"),
        (2, 500.0, "acceleration column says"),
    ],
)
def test_a_column_that_contradicts_another_one_is_refused(laboratory, column, by, words):
    lab = stays_at_rest(unchecked(laboratory, lead=0.3))
    time, motion = stretch(lab, 0.0, last(lab)[0])
    motion[10:20, column] += by
    assert not give(lab, time, motion)
    assert words in lab.bridge.states.reason


def test_the_generators_signals_do_not_contradict_themselves():
    for rate in (1000.0, 2048.0, 4096.0):
        for signal in (PulseStep, Multisine, Prbs):
            motion = signal(Settings(rate=rate)).next(int(8 * rate))
            assert contradiction(motion, 1 / rate, LIMITS) is None, (signal, rate)
            time = np.arange(len(motion)) / rate
            assert LIMITS.passed_on(path_through(time, motion)) is None, (signal, rate)


def test_a_path_that_peaks_between_samples_is_refused(laboratory):
    """Every sample keeps every limit; the polynomial between two of them does not."""
    peaking = np.array([[0.172, 2.0, -380.0], [0.172, -2.0, -380.0]])
    found = LIMITS.passed_on(path_through(np.array([0.0, 0.0105]), peaking))
    assert "the path reaches 0.177" in found
    assert np.abs(peaking[:, 0]).max() < LIMITS.angle
    sharp = np.array([[0.0, 0.0, 0.0], [0.002, 0.0, 0.0]])
    assert "accelerates at" in LIMITS.passed_on(path_through(np.array([0.0, 0.002]), sharp))
    fast = np.array([[0.0, 4.9, 300.0], [0.05, 4.9, -300.0]])
    assert "moves at 5." in LIMITS.passed_on(path_through(np.array([0.0, 0.0101]), fast))


def test_the_extremes_of_the_path_are_those_of_a_much_finer_one():
    random = np.random.default_rng(3)
    motion = random.normal(size=(40, 3)) * [0.05, 2.0, 500.0]
    time = np.cumsum(random.uniform(0.0005, 0.02, 40))
    path = path_through(time, motion)
    largest = 0.0
    for k in range(39):
        h = time[k + 1] - time[k]
        s = np.linspace(0, 1, 4001)
        basis = np.vander(s, 6, increasing=True)
        scale = np.array([1, h, h * h])
        c = np.linalg.solve(ENDS, np.concatenate([motion[k] * scale, motion[k + 1] * scale]))
        position = basis @ c
        assert np.abs(position).max() <= np.abs(path.position[k]).max() * (1 + 1e-3) + 1e-6
        second = np.vander(s, 4, increasing=True) @ (c[2:] * [2, 6, 12, 20]) / h**2
        largest = max(largest, np.abs(second).max())
    assert path.largest_acceleration == pytest.approx(largest, rel=1e-5)


def test_a_block_that_comes_twice_or_late_is_left_out_and_counted(laboratory):
    lab = unchecked(laboratory)
    sent = lab.stretches[-1]
    assert not give(lab, sent.time, sent.motion)
    assert lab.bridge.left_out == 1
    assert lab.state == "running"


def test_a_block_of_400000_samples_is_left_out(laboratory):
    lab = unchecked(laboratory)
    time = lab.ros + np.arange(400_000) / RATE
    assert not give(lab, time, np.zeros((400_000, 3)))
    assert lab.state == "running"
    assert any("400000 samples" in note for note in lab.bridge.notes)


@pytest.mark.parametrize("command", ["stop", "emergency"])
def test_a_stop_acts_at_once_though_the_reference_is_sent_long_before(laboratory, command):
    lab = laboratory(lead=1.0).running(2.5).until_moving(2.0)
    at = lab.rig_time
    if command == "stop":
        lab.command("stop")
    else:
        lab.device.press_emergency_stop(True, lab.rig_time)
    lab.run(0.3)
    commanded, real = lab.moves_until(at)
    assert commanded < 0.05
    assert real < 0.1


def test_a_source_that_ends_is_followed_to_its_end_and_stopped(laboratory):
    lab = laboratory(lead=0.6).running(2.0)
    lab.sending = False
    lab.run(0.4)
    assert lab.state == "running"
    lab.until("ready", 1.0)
    assert np.abs(lab.commands()[:, 2:]).max(axis=0).tolist() <= [5.0, 2000.0]


def test_a_fault_is_not_reset_while_the_rig_is_silent(laboratory):
    lab = laboratory().running()
    lab.faults(freeze=1.0)
    lab.run(1.0)
    refused = lab.command("reset_fault")
    assert not refused.done
    assert "nothing valid came from the rig" in refused.sentence
    lab.faults()
    lab.run(0.3)
    assert lab.command("reset_fault").done


def test_arming_right_after_disarming_waits_for_the_rig_to_be_off(laboratory):
    lab = laboratory().armed()
    lab.command("disarm")
    assert lab.state == "stopping"
    assert not lab.command("arm").done
    lab.until("ready")
    assert lab.device.state is DeviceState.OFF
    lab.running()


def test_a_stop_during_an_arming_that_is_not_confirmed_yet_ends_off(laboratory):
    lab = laboratory(delay=0.02)
    lab.until("ready")
    lab.command("arm")
    lab.run(0.004)
    lab.command("stop")
    lab.run(0.03)
    assert lab.state == "stopping"  # what the rig says now was said before it heard of the arming
    lab.until("ready")
    lab.run(0.2)
    assert lab.device.state is DeviceState.OFF


def test_a_fault_survives_a_new_session_with_the_rig(laboratory):
    lab = laboratory().until("ready")
    lab.bridge = type(lab.bridge)(lab.limits, 0.5, 0.0, "the encoder was stuck")
    lab.run(1.5)
    assert lab.state == "fault"
    assert lab.bridge.states.reason == "the encoder was stuck"
    assert lab.command("reset_fault").done
    lab.until("ready")


def test_the_operators_page_is_a_dead_mans_switch(laboratory):
    lab = laboratory().running()
    for _ in range(40):
        lab.bridge.operator_alive(lab.now)
        lab.run(0.1)
    assert lab.state == "running"
    lab.run(2.2)
    assert lab.state in ("stopping", "ready")
    assert "operator's page was not heard for 2 s" in lab.bridge.states.reason
    lab.running(seconds=3.0)  # without any page: nobody said that one watches
    assert lab.state == "running"


def test_a_stop_from_between_two_samples_has_room():
    fast = np.array([[0.1549, 0.0, 0.0], [0.1749, 0.0, 0.0]])
    path = path_through(np.array([0.0, 0.0076]), fast)
    assert np.abs(path.position).max() < LIMITS.angle
    assert "a stop on the path would end" in LIMITS.passed_on(path)


def test_references_that_a_stop_overtakes_are_not_sent(laboratory):
    lab = laboratory().running()
    time, motion = stretch(lab, 0.0, *last(lab))
    lab.bridge.reference(time, motion, lab.now, lab.ros)
    lab.bridge.command("stop", lab.now, lab.ros)
    orders = lab.bridge.take_orders(lab.now)
    assert [order.stretch for order in orders] == [None] * len(orders)
    assert orders[-1].wanted is Wanted.OFF
