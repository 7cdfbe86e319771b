"""Terms between encoder and plate against integrations that share no code with them."""

import numpy as np
import pytest
from two_sines import RATE, TIME, integrate, movement

from ankle_physics.model import Model
from ankle_physics.signals import Signals

LOST = {"gap": 0.003}


def lost_motion(x, v, a):
    signals = Signals(RATE, x, v, a)
    Model.of({"lost_motion": LOST}).start(RATE).torque(signals)
    return signals


def test_a_plate_behind_a_loose_shaft_follows_its_equation():
    gap = LOST["gap"]

    def right(t, z):
        rate = movement(t)[1]
        return rate - np.abs(rate) * z / gap

    z = integrate(right, np.zeros(1))[0]
    x, v, a = movement(TIME)
    signals = lost_motion(x, v, a)
    expected = x - 0.5 * z
    assert np.abs(signals.position - expected).max() < 0.01 * gap
    np.testing.assert_array_equal(signals.measured_position, x)
    np.testing.assert_array_equal(signals.measured_velocity, v)
    np.testing.assert_array_equal(signals.foot_position, signals.position)


def test_velocity_and_acceleration_behind_a_loose_shaft_are_those_of_its_position():
    signals = lost_motion(*movement(TIME))
    velocity = np.gradient(signals.position) * RATE
    assert np.std((signals.velocity - velocity)[1:-1]) < 0.01 * np.std(velocity)
    acceleration = np.gradient(signals.velocity) * RATE
    # It jumps where the drive turns.
    turns = np.flatnonzero(np.diff(np.sign(signals.measured_velocity)))
    smooth = np.abs(np.arange(len(TIME))[:, None] - turns).min(axis=1) > 2
    smooth[[0, -1]] = False
    apart = (signals.acceleration - acceleration)[smooth]
    assert np.std(apart) < 0.01 * np.std(acceleration)


def test_a_loose_shaft_loses_its_gap_between_two_reversals():
    level = np.concatenate([np.zeros(10), np.linspace(0.0, 0.04, 200), np.linspace(0.04, 0.0, 200)])
    v = np.gradient(level) * RATE
    plate = lost_motion(level, v, np.gradient(v) * RATE).position
    up = np.interp(0.02, level[:210], plate[:210])
    down = np.interp(0.02, level[:209:-1], plate[:209:-1])
    assert down - up == pytest.approx(LOST["gap"], rel=0.02)


RECOVERING = {"gap": 0.003, "recovery": 0.15}


def behind_a_yielding_coupling(x, v, a, values=RECOVERING):
    signals = Signals(RATE, x, v, a)
    Model.of({"recovering_lost_motion": values}).start(RATE).torque(signals)
    return signals


def test_a_plate_behind_a_yielding_coupling_follows_its_equation():
    limit = 0.5 * RECOVERING["gap"]

    def right(t, z):
        rate = movement(t)[1]
        grows = np.where(z * rate > 0.0, 1.0 - (z / limit) ** 2, 1.0)
        return rate * grows - z / RECOVERING["recovery"]

    z = integrate(right, np.zeros(1))[0]
    x, v, a = movement(TIME)
    signals = behind_a_yielding_coupling(x, v, a)
    assert np.abs(signals.position - (x - z)).max() < 0.02 * limit
    np.testing.assert_array_equal(signals.measured_position, x)
    np.testing.assert_array_equal(signals.foot_position, signals.position)


def test_velocity_and_acceleration_behind_a_yielding_coupling_are_those_of_its_position():
    signals = behind_a_yielding_coupling(*movement(TIME))
    velocity = np.gradient(signals.position) * RATE
    assert np.std((signals.velocity - velocity)[1:-1]) < 0.01 * np.std(velocity)
    acceleration = np.gradient(signals.velocity) * RATE
    # It jumps where the drive turns and where the spring has come back to its middle.
    z = signals.measured_position - signals.position
    corners = np.flatnonzero(
        np.diff(np.sign(signals.measured_velocity)) + np.diff(np.sign(z)) != 0.0
    )
    smooth = np.abs(np.arange(len(TIME))[:, None] - corners).min(axis=1) > 3
    smooth[[0, -1]] = False
    apart = (signals.acceleration - acceleration)[smooth]
    assert np.std(apart) < 0.03 * np.std(acceleration)


def test_a_plate_behind_a_yielding_coupling_settles_back_at_rest():
    steps = np.concatenate([np.zeros(10), np.linspace(0.0, 0.03, 40), np.full(1500, 0.03)])
    v = np.gradient(steps) * RATE
    plate = behind_a_yielding_coupling(steps, v, np.gradient(v) * RATE).position
    lost = steps - plate
    assert lost[50] == pytest.approx(0.5 * RECOVERING["gap"], rel=0.15)
    later = 50 + round(RECOVERING["recovery"] * RATE)
    assert lost[later] == pytest.approx(lost[50] / np.e, rel=0.02)


def test_a_yielding_coupling_without_recovery_loses_its_gap_between_two_reversals():
    level = np.concatenate([np.zeros(10), np.linspace(0.0, 0.04, 200), np.linspace(0.04, 0.0, 200)])
    v = np.gradient(level) * RATE
    held = {**RECOVERING, "recovery": 20.0}
    plate = behind_a_yielding_coupling(level, v, np.gradient(v) * RATE, held).position
    up = np.interp(0.02, level[:210], plate[:210])
    down = np.interp(0.02, level[:209:-1], plate[:209:-1])
    assert down - up == pytest.approx(RECOVERING["gap"], rel=0.03)


UNEVEN = {"s": 4e-4, "c": -3e-4, "p": 0.018, "xc": 0.002}


def behind_uneven_gear(x, v, a):
    signals = Signals(RATE, x, v, a)
    Model.of({"cyclic_angle_error": UNEVEN}).start(RATE).torque(signals)
    return signals


def test_an_angle_error_repeats_as_the_plate_turns_and_has_its_size():
    x = np.linspace(-0.03, 0.03, 6001)
    error = behind_uneven_gear(x, np.zeros_like(x), np.zeros_like(x)).position - x
    once = round(UNEVEN["p"] / (x[1] - x[0]))
    np.testing.assert_allclose(error[once:], error[:-once], atol=1e-9)
    assert np.ptp(error) == pytest.approx(2 * 5e-4, rel=1e-3)
    assert np.interp(UNEVEN["xc"], x, error) == pytest.approx(UNEVEN["c"], rel=1e-6)


def test_the_plate_behind_an_uneven_gear_moves_as_its_angle_says():
    signals = behind_uneven_gear(*movement(TIME))
    np.testing.assert_array_equal(signals.measured_position, movement(TIME)[0])
    for rate, angle in (
        (signals.velocity, signals.position),
        (signals.acceleration, signals.velocity),
    ):
        expected = np.gradient(angle) * RATE
        assert np.std((rate - expected)[1:-1]) < 0.005 * np.std(expected)


CURVE = {"e3": 4e-4, "e7": -3e-4, "e8": 5e-4, "span": 0.06, "xc": 0.004}


def behind_an_uneven_potentiometer(x, v, a, values=CURVE):
    signals = Signals(RATE, x, v, a)
    Model.of({"uneven_angle": values}).start(RATE).torque(signals)
    return signals


def test_an_uneven_angle_has_neither_offset_nor_slope():
    straight = {f"e{k}": 2e-4 + 1e-4 * k for k in range(1, 14)} | {"span": 0.06, "xc": 0.0}
    x = np.linspace(-0.05, 0.05, 1001)
    still = np.zeros_like(x)
    plate = behind_an_uneven_potentiometer(x, still, still, straight).position
    np.testing.assert_allclose(plate, x, atol=1e-12)


def test_an_uneven_angle_is_largest_at_its_knot_and_ends_beyond_its_span():
    x = np.linspace(-0.08, 0.08, 3201)
    still = np.zeros_like(x)
    one = {"e7": 9e-4, "span": 0.06, "xc": 0.004}
    error = behind_an_uneven_potentiometer(x, still, still, one).position - x
    assert x[np.argmax(error)] == pytest.approx(one["xc"], abs=2e-4)
    np.testing.assert_array_equal(error[np.abs(x - one["xc"]) > 0.041], 0.0)


def test_the_plate_behind_an_uneven_potentiometer_moves_as_its_angle_says():
    signals = behind_an_uneven_potentiometer(*movement(TIME))
    np.testing.assert_array_equal(signals.measured_position, movement(TIME)[0])
    assert np.ptp(signals.position - signals.measured_position) > 2e-4
    for rate, angle in (
        (signals.velocity, signals.position),
        (signals.acceleration, signals.velocity),
    ):
        expected = np.gradient(angle) * RATE
        assert np.std((rate - expected)[1:-1]) < 0.005 * np.std(expected)
