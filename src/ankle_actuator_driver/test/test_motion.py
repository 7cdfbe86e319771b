"""Limits, stops, soft start and yielding: the movements that reach the plate."""

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from ankle_actuator_driver.safety.command_record import CommandRecord
from ankle_actuator_driver.safety.encoder_check import EncoderCheck
from ankle_actuator_driver.safety.interpolated_path import positions_at
from ankle_actuator_driver.safety.limits import (
    HARD_LIMIT_PARAMETERS,
    LIMIT_PARAMETERS,
    Limits,
    hard_limits_from,
    limits_from,
)
from ankle_actuator_driver.safety.soft_start import blend
from ankle_actuator_driver.safety.stop_motion import GENTLE_DECELERATION, StopMotion
from ankle_actuator_driver.safety.torque_yield import RIG_ADMITTANCE, TorqueYield
from ankle_interfaces.errors import QuantityError
from perturbation_generator.limits import Limits as GeneratorLimits
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 2048.0
LIMITS = Limits()


def paper_signal(seconds, **settings):
    return PulseStep(Settings(rate=RATE, **settings)).next(int(seconds * RATE))


def shifted(motion, by):
    return motion + np.array([by, 0.0, 0.0])


def test_the_papers_perturbation_and_all_that_the_generator_allows_keep_the_limits():
    assert LIMITS.passed_by(paper_signal(20.0), 1 / RATE) is None
    allowed = GeneratorLimits()
    assert allowed.amplitude < LIMITS.angle
    assert allowed.velocity <= LIMITS.velocity
    assert allowed.acceleration <= LIMITS.acceleration


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda m: shifted(m, 0.15), "position of 0.19 rad passes the limit of 0.175 rad"),
        (lambda m: m * [1.0, 2.0, 1.0], "velocity of 6.25 rad/s passes the limit of 5 rad/s"),
        (lambda m: m * [1.0, 1.0, 10.0], "rad/s^2 passes the limit of 2000 rad/s^2"),
        (lambda m: np.where(np.arange(len(m))[:, None] > 100, shifted(m, 0.02), m), "step of 0.02"),
        (lambda m: np.column_stack([m[:, 0] * 2, m[:, 1], m[:, 2]]), "positions that move at 6.2"),
    ],
)
def test_every_limit_is_kept_and_named(change, words):
    assert words in LIMITS.passed_by(change(paper_signal(2.0)), 1 / RATE)


def test_a_reference_that_moves_outwards_leaves_room_to_stop():
    position = 0.174 - 3.0 * np.arange(32)[::-1] / RATE
    motion = np.column_stack([position, np.full(32, 3.0), np.zeros(32)])
    assert "a stop would end at 0.177" in LIMITS.passed_by(motion, 1 / RATE)
    assert LIMITS.passed_by(shifted(motion, -0.01), 1 / RATE) is None


def test_a_zigzag_is_fast_though_its_columns_say_it_rests():
    motion = np.zeros((32, 3))
    motion[::2, 0] = 0.001
    assert "accelerate" in LIMITS.passed_by(motion, 1 / RATE)


def test_the_first_sample_follows_the_last():
    motion = shifted(np.zeros((4, 3)), 0.1)
    assert LIMITS.passed_by(motion, 1 / RATE) is None
    assert LIMITS.passed_by(motion, 1 / RATE, before=0.1) is None
    assert "step of 0.1 rad" in LIMITS.passed_by(motion, 1 / RATE, before=0.0)


def test_no_limit_passes_its_hard_limit():
    values = {
        parameter.name: parameter.default
        for parameter in (*LIMIT_PARAMETERS, *HARD_LIMIT_PARAMETERS)
    }
    limits_from(values).require_within(hard_limits_from(values))
    with pytest.raises(
        QuantityError, match=r"'torque_limit' = 40 N\.m passes the hard limit of 30 N\.m"
    ):
        limits_from({**values, "torque_limit": 40.0}).require_within(hard_limits_from(values))
    assert all(parameter.start_only for parameter in HARD_LIMIT_PARAMETERS)


@given(st.floats(-0.17, 0.17), st.floats(-5.0, 5.0))
@example(LIMITS.angle - 0.004, 2.0)  # a gentle stop needs 7.5 mrad, the sharpest one 1.5 mrad
def test_every_stop_keeps_the_limits_and_ends_at_rest(position, velocity):
    room = LIMITS.angle - abs(position) if position * velocity > 0 else LIMITS.angle + abs(position)
    if 0.75 * velocity**2 / LIMITS.acceleration > room:
        return  # no reference that is accepted gets there
    stop = StopMotion.plan(position, velocity, LIMITS.angle, LIMITS.acceleration)
    path = np.array([stop.at(t) for t in np.linspace(0.0, stop.duration, 200)])
    assert np.abs(path[:, 0]).max() <= LIMITS.angle + 1e-9
    assert np.abs(path[:, 1]).max() <= abs(velocity) + 1e-12
    assert np.abs(path[:, 2]).max() <= LIMITS.acceleration * (1 + 1e-9)
    assert path[0, :2] == pytest.approx([position, velocity], abs=1e-12)
    assert stop.at(stop.duration + 1.0)[1:] == (0.0, 0.0)
    assert stop.duration <= 1.5 * 5.0 / GENTLE_DECELERATION
    if len(path) and stop.duration > 0:
        differences = np.gradient(path[:, 0], stop.duration / 199)
        assert np.abs(differences - path[:, 1])[1:-1].max() < 0.01 * max(abs(velocity), 1e-3)


@pytest.mark.parametrize("velocity", [5.0, -3.0])
def test_a_stop_that_has_no_room_left_still_keeps_the_acceleration(velocity):
    position = np.copysign(LIMITS.angle - 1e-4, velocity)
    stop = StopMotion.plan(position, velocity, LIMITS.angle, LIMITS.acceleration)
    path = np.array([stop.at(t) for t in np.linspace(0.0, stop.duration, 200)])
    assert np.abs(path[:, 2]).max() == pytest.approx(LIMITS.acceleration, rel=1e-3)
    # Beyond the angle by no more than the shortest stop within the acceleration needs.
    beyond = 0.75 * velocity**2 / LIMITS.acceleration
    assert np.abs(path[:, 0]).max() == pytest.approx(abs(position) + beyond, abs=1e-9)


def test_a_soft_start_begins_at_rest_where_the_plate_is_and_becomes_the_reference():
    motion, since = paper_signal(3.0), np.arange(int(3.0 * RATE)) / RATE
    shaped = blend(motion, since, 1.0, held=-0.05)
    assert shaped[0].tolist() == [-0.05, 0.0, 0.0]
    assert np.abs(shaped - motion)[since >= 1.0].max() < 1e-12
    velocity = np.gradient(shaped[:, 0], 1 / RATE)
    assert np.abs(velocity - shaped[:, 1])[1:-1].max() < 0.01
    acceleration = np.gradient(shaped[:, 1], 1 / RATE)
    # Of 400 rad/s^2; the edges' jerk jumps between samples.
    assert np.abs(acceleration - shaped[:, 2])[1:-1].max() < 50.0
    assert LIMITS.passed_by(shaped, 1 / RATE, before=-0.05) is None


@pytest.mark.parametrize("stiffness", [50.0, 200.0, 500.0])
def test_a_torque_beyond_the_limit_makes_the_plate_follow_the_foot(stiffness):
    # The subject pushes with 60 N.m against a plate with a limit of 30; servo and cycle delay what
    # is measured by 20 ms.
    yielding, delayed = TorqueYield(RIG_ADMITTANCE, 30.0), [0.0] * 41
    torques = []
    for k in range(int(2.0 * RATE)):
        if not k % 8:
            yielding.measure(60.0 + stiffness * delayed[0])
        delayed = [*delayed[1:], yielding.step(1 / RATE)[0]]
        torques.append(60.0 + stiffness * delayed[0])
    assert yielding.offset < 0
    assert max(torques[-500:]) < 31.0
    assert min(torques) > 25.0


def test_yielding_ends_where_the_torque_ends():
    yielding = TorqueYield(RIG_ADMITTANCE, 30.0)
    assert yielding.step(1 / RATE) == (0.0, 0.0, 0.0)
    yielding.measure(-50.0)
    path = yielding.stretch(200, 1 / RATE)
    assert path[-1, 0] > 0
    assert np.abs(path[:, 1]).max() <= 1.0
    yielding.measure(-10.0)
    for _ in range(int(40 * RATE)):
        yielding.step(1 / RATE)
    assert yielding.step(1 / RATE) == (0.0, 0.0, 0.0)


def test_an_encoder_that_stands_still_while_the_plate_is_commanded_to_move_is_stuck():
    motion = paper_signal(5.0)[:, 0]
    behind = np.concatenate([np.zeros(16), motion[:-16]])  # 8 ms of servo
    living, stuck = EncoderCheck(), EncoderCheck()
    at = [
        (k / RATE, commanded, seen)
        for k, (commanded, seen) in enumerate(zip(motion, behind, strict=True))
        if not k % 8
    ]
    assert not any(living.stuck(*entry) for entry in at)
    first = next(time for time, commanded, _ in at if stuck.stuck(time, commanded, 0.01))
    onset = next(time for time, commanded, _ in at if commanded > 0.005)
    assert first - onset < 0.05


def test_the_record_of_what_was_sent_gives_the_path_of_all_stretches_at_any_time():
    """Also at a seam, in a gap, before the first stretch and behind the last one."""
    motion, time = paper_signal(2.0), 5.0 + np.arange(int(2.0 * RATE)) / RATE
    time[2000:] += 0.02
    record, cuts = CommandRecord(), range(0, len(time), 32)
    for cut in cuts:
        record.add(time[cut : cut + 32], motion[cut : cut + 32], 5.0)
    random = np.random.default_rng(3)
    starts = [4.9, *time[random.integers(0, len(time), 40)], time[1999], time[-1] - 0.01, 7.5]
    for start in starts:
        wanted = start + np.arange(32) / RATE
        assert record.positions(wanted) == pytest.approx(
            positions_at(time, motion, wanted), abs=1e-15
        )
