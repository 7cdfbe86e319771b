"""Ten minutes of stamps that drift, jitter and arrive late, placed in ROS time; corrections with
outliers.
"""

import numpy as np
import pytest

from emg_driver.clock_mapping import ClockDifference, SampleLine, SteadyCorrection

RATE, CHUNK, ROS_MINUS_LSL = 2048.0, 32, 1.7e9


def placed(drift, latency, jitter, seconds=600, correction=0.25):
    """Error of the time of each chunk's last sample [s] and all steps between chunks in samples."""
    random = np.random.default_rng(3)
    line = SampleLine(RATE, lambda: ROS_MINUS_LSL)
    line.start([latency])
    errors, ends = [], []
    for k in range(int(seconds * RATE / CHUNK)):
        true = 1e5 + (k * CHUNK + np.arange(CHUNK)) / RATE
        stamps = true - drift * (true - 1e5) + jitter * random.standard_normal() - correction
        late = random.exponential(0.002) + (0.05 if random.random() < 0.02 else 0.0)
        times, jumps = line.place(stamps, correction, true[-1] + latency + late)
        assert jumps == []
        errors.append(times[-1] - true[-1] - ROS_MINUS_LSL)
        ends.append(times[[0, -1]])
    between = np.array(ends)
    return np.array(errors), (between[1:, 0] - between[:-1, 1]) * RATE


@pytest.mark.parametrize("drift", [50e-6, pytest.param(-50e-6, marks=pytest.mark.slow)])
def test_a_pulse_stays_within_a_millisecond_over_ten_minutes_of_drift(drift):
    errors, steps = placed(drift, 0.005, 0.0002)
    assert np.abs(errors).max() < 1e-3
    assert np.abs(errors[len(errors) // 10 :]).max() < 0.3e-3
    assert np.abs(steps - 1.0).max() < 0.3


@pytest.mark.parametrize("drift", [500e-6, -500e-6])
def test_a_clock_worse_than_any_crystal_is_found_within_seconds(drift):
    errors, steps = placed(drift, 0.005, 0.0002, seconds=20)
    assert np.abs(errors).max() < 1e-3
    assert np.abs(steps - 1.0).max() < 0.3


def test_a_constant_latency_and_a_correction_leave_honest_stamps_alone():
    errors, _ = placed(0.0, 0.02, 0.0, seconds=60)
    assert np.abs(errors).max() < 0.2e-3


def test_a_look_at_two_clocks_that_was_interrupted_does_not_count():
    now, interrupted = [0.0], [False]

    def first():
        now[0] += 1e-6
        return now[0] + 1.7e9

    def second():
        if interrupted[0]:
            now[0] += 0.008
        return now[0]

    difference = ClockDifference(first, second)
    assert difference() == pytest.approx(1.7e9, abs=1e-5)
    interrupted[0] = True
    assert difference() == pytest.approx(1.7e9, abs=1e-5)
    assert (
        len({difference() for _ in range(30)}) > 1
    )  # always so: there is no better look to wait for


def test_a_clock_that_is_set_is_followed_within_two_seconds_though_the_first_chunk_had_waited():
    line = SampleLine(RATE, lambda: ROS_MINUS_LSL)
    line.start([0.001])
    errors, jumps, last = [], [], -np.inf
    for k in range(round(10 * RATE / CHUNK)):
        true = 1e5 + (k * CHUNK + np.arange(CHUNK)) / RATE
        set_clock = true[0] >= 1e5 + 5.0
        waited = 0.013 if set_clock and not jumps else 0.0
        times, found = line.place(
            true + (7.0 if set_clock else 0.0), 0.0, true[-1] + 0.001 + waited
        )
        assert times[0] > last
        last = times[-1]
        jumps += found
        errors.append((true[-1] - 1e5, times[-1] - true[-1] - ROS_MINUS_LSL))
    seconds, errors = np.array(errors).T
    assert [jump.kind for jump in jumps] == ["clock"]
    assert np.abs(errors).max() < 0.014
    assert np.abs(errors[seconds > 7.0]).max() < 1e-3


def test_a_correction_that_is_measured_anew_is_followed_and_is_no_missing_sample():
    line = SampleLine(RATE, lambda: ROS_MINUS_LSL)
    line.start([0.001])
    ends, found = [], []
    for k in range(round(60 * RATE / CHUNK)):
        true = 1e5 + (k * CHUNK + np.arange(CHUNK)) / RATE
        correction = 0.0015 if 1e5 + 20.0 < true[0] < 1e5 + 22.0 else 0.0
        times, jumps = line.place(true, correction, true[-1] + 0.001)
        found += jumps
        ends.append(times[[0, -1]])
    between = np.array(ends)
    assert found == []
    assert np.abs((between[1:, 0] - between[:-1, 1]) * RATE - 1.0).max() < 0.45
    assert abs(between[-1, 1] - true[-1] - ROS_MINUS_LSL) < 0.5e-3


def test_an_odd_correction_is_left_out_and_one_that_many_measurements_agree_on_is_taken():
    correction = SteadyCorrection(0.010)
    for k in range(5):
        correction.measure(0.035 + 1e-6 * k)
    assert correction.value == 0.010
    correction.measure(0.0101)
    assert correction.value == 0.0101
    for k in range(25):
        correction.measure(0.035 + 1e-6 * k)
    assert correction.value == pytest.approx(0.035, abs=1e-4)


def test_corrections_that_a_busy_computer_scatters_or_repeats_are_never_taken():
    random = np.random.default_rng(5)
    correction = SteadyCorrection(0.010)
    for reading in 0.010 + random.uniform(0.003, 0.05, 300):
        correction.measure(reading)
    for _ in range(300):
        correction.measure(0.035)
    assert correction.value == 0.010
