"""The simulated plate stops and starts as a rig's does: smoothly, and only when it is asked to."""

import numpy as np
import pytest

from ankle_sim.rest import ARMED, READY, RUNNING, START_TIME, STOP_TIME, Rest

RATE = 2048.0


def sine(time):
    w = 2.0 * np.pi * 1.3
    return 0.04 * np.column_stack(
        [np.sin(w * time), w * np.cos(w * time), -(w**2) * np.sin(w * time)]
    )


def follow(rest, begin, seconds, block=32):
    """Motion over a time, in blocks."""
    time = begin + np.arange(round(seconds * RATE)) / RATE
    return time, np.concatenate(
        [
            rest.motion(time[k : k + block], sine(time[k : k + block]))
            for k in range(0, len(time), block)
        ]
    )


def test_it_follows_until_it_is_stopped():
    rest = Rest()
    time, motion = follow(rest, 0.0, 1.0)
    np.testing.assert_array_equal(motion, sine(time))
    assert rest.state == RUNNING


def test_a_stop_brings_the_plate_to_rest_and_a_start_back_to_the_reference():
    rest = Rest()
    _, before = follow(rest, 0.0, 1.0)
    rest.stop()
    assert rest.state == READY
    _, stopping = follow(rest, 1.0, 1.0)
    still = stopping[round((STOP_TIME + 0.02) * RATE) :]
    assert np.abs(still[:, 1:]).max() == 0.0
    assert np.ptp(still[:, 0]) == 0.0
    assert rest.start() is None  # arming is a call of its own
    assert rest.arm()
    assert rest.state == ARMED
    _, armed = follow(rest, 2.0, 0.5)
    assert np.ptp(armed[:, 0]) == 0.0
    assert rest.start()
    time, starting = follow(rest, 2.5, START_TIME + 0.5)
    late = time > 2.5 + START_TIME + 0.05
    np.testing.assert_allclose(starting[late], sine(time[late]), atol=1e-12)
    whole = np.concatenate([before, stopping, armed, starting])
    # One path: positions, velocities and accelerations belong together everywhere.
    steps = np.diff(whole[:, 0]) * RATE
    middle = 0.5 * (whole[1:, 1] + whole[:-1, 1])
    assert np.abs(steps - middle).max() < 0.02
    assert np.abs(np.diff(whole[:, 0])).max() < 3.0 / RATE


@pytest.mark.parametrize("columns", [1, 3])
def test_a_position_alone_will_do(columns):
    rest = Rest()
    rest.stop()
    time = np.arange(1024) / RATE
    assert rest.motion(time, sine(time)[:, :columns]).shape == (1024, columns)


def test_a_stop_during_the_soft_start_holds():
    rest = Rest()
    rest.stop()
    follow(rest, 0.0, 0.5)
    rest.arm()
    rest.start()
    follow(rest, 0.5, 0.4)
    rest.stop()
    _, motion = follow(rest, 0.9, 0.5)
    assert np.abs(motion[round((STOP_TIME + 0.02) * RATE) :, 1]).max() == 0.0


def test_a_plate_that_begins_at_rest_moves_once_it_is_armed_and_started():
    rest = Rest(at_rest=True)
    assert rest.state == READY
    _, motion = follow(rest, 0.0, 0.5)
    assert np.abs(motion).max() == 0.0
    assert rest.start() is None
    rest.arm()
    assert rest.start()
    time, motion = follow(rest, 0.5, START_TIME + 0.5)
    late = time > 0.5 + START_TIME + 0.05
    np.testing.assert_allclose(motion[late], sine(time[late]), atol=1e-12)
