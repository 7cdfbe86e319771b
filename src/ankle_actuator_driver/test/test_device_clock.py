"""The rig's clock in ROS time: drift, jitter, bursts, steps."""

import numpy as np
import pytest

from ankle_actuator_driver.link.protocol.device_clock import DeviceClock

EPOCH, OFFSET = 1.76e9, 1000.0
RATE = 2048.0


def delays(random, count, busy=False):
    """50 us and more, some late by milliseconds; when busy nothing is sooner than 20 ms."""
    found = (
        50e-6
        + random.exponential(100e-6, count)
        + (random.random(count) < 0.05) * random.exponential(5e-3, count)
    )
    return found + 0.02 + random.exponential(0.01, count) if busy else found


class Line:
    """Packets of both ends, 64 a second, and the true ROS time of the rig's time."""

    def __init__(self, drift, seed=1):
        self.drift, self.random, self.at = drift, np.random.default_rng(seed), 0.0
        self.clock, self.notes, self.step = DeviceClock(), [], 0.0

    def device(self, ros):
        return OFFSET + self.step + (ros - EPOCH) * (1.0 + self.drift)

    def ros(self, device):
        return EPOCH + (device - OFFSET - self.step) / (1.0 + self.drift)

    def run(self, seconds, busy=False):
        """Errors [s] of the times handed out, one each packet."""
        errors, count = [], round(seconds * 64)
        for up, down in zip(
            delays(self.random, count, busy), delays(self.random, count, busy), strict=True
        ):
            self.at += 1 / 64
            heard = EPOCH + self.at - 0.01
            note = self.clock.exchange(
                self.device(EPOCH + self.at), EPOCH + self.at + up, heard - down, self.device(heard)
            )
            self.notes += [note] if note else []
            if self.clock.ready:
                device = self.device(EPOCH + self.at)
                errors.append(self.clock.to_ros(device) - self.ros(device))
        return np.array(errors)


@pytest.mark.parametrize("drift", [50e-6, -50e-6, 0.0])
def test_offset_and_drift_are_found_and_jitter_does_not_reach_the_times(drift):
    line = Line(drift)
    line.run(10.0)
    errors = line.run(60.0)
    assert np.abs(errors).max() < 100e-6
    # The line's jitter is milliseconds; neighbouring packets differ by the little that the rate is
    # corrected.
    assert np.abs(np.diff(errors)).max() < 4e-6
    assert line.clock.drift == pytest.approx(-drift, abs=3e-6)
    assert not line.notes


def test_bursts_that_delay_everything_do_not_move_the_times():
    line = Line(50e-6)
    line.run(20.0)
    worst = max(
        np.abs(np.concatenate([line.run(2.0, busy=True), line.run(3.0)])).max() for _ in range(6)
    )
    assert worst < 200e-6
    assert not line.notes


def test_times_are_evenly_spaced_and_there_and_back_is_the_same():
    line = Line(50e-6)
    line.run(3.0)
    last = None
    for _ in range(200):
        line.run(1 / 64)
        first = line.device(EPOCH + line.at)
        times = np.array([line.clock.to_ros(first + k / RATE) for k in range(32)])
        intervals = np.diff(times if last is None else np.append(last, times)) * RATE
        assert np.abs(intervals[1:] - 1.0).max() < 1e-3
        assert line.clock.to_device(times[5]) == pytest.approx(first + 5 / RATE, abs=1e-6)
        last = times[-1]


def test_a_clock_that_was_set_is_reported_and_learned_anew():
    line = Line(20e-6)
    line.run(10.0)
    line.step = 0.5
    line.run(3.0)
    assert len(line.notes) == 1
    assert "a clock was set" in line.notes[0]
    assert np.abs(line.run(5.0)).max() < 300e-6


def test_nothing_is_handed_out_before_the_rig_was_heard_both_ways():
    clock = DeviceClock()
    for k in range(300):
        clock.exchange(OFFSET + k / 64, EPOCH + k / 64, float("nan"), 0.0)
    assert not clock.ready
