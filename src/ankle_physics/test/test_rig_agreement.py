"""A rig file that is old, or that the signals contradict."""

from datetime import datetime, timedelta, timezone

import numpy as np
import pytest
from scipy import signal

from ankle_physics.rig_agreement import LARGEST_AGE, rig_warnings, velocity_delay
from ankle_physics.rig_file import Measured, RigFile

RATE = 2048.0
DATE = datetime(2026, 3, 1, tzinfo=timezone.utc)
NOISE = {"position[rad]": 4.5e-5, "velocity[rad/s]": 6.5e-3, "torque[N.m]": 0.14}


def rig(delay=0.0004):
    return RigFile("plate B", DATE, velocity_delay=Measured(delay, 2e-5), noise=NOISE)


def channels(delay=0.0004, noise=1.0, seconds=20.0):
    """Steps of a plate at random times, with sensors of the calibrated noise."""
    random = np.random.default_rng(4)
    n = round(seconds * RATE)
    levels = np.repeat(random.uniform(-0.02, 0.02, n // 800 + 1), 800)[:n]
    x = signal.sosfilt(signal.butter(2, 30.0, fs=RATE, output="sos"), levels)
    time = np.arange(n) / RATE
    v = np.interp(time - delay, time, np.gradient(x, 1.0 / RATE))
    torque = 80.0 * x
    return [
        values + noise * NOISE[name] * random.normal(size=n)
        for name, values in zip(NOISE, (x, v, torque), strict=True)
    ]


def test_signals_of_the_calibrated_rig_raise_nothing():
    assert rig_warnings(rig(), RATE, *channels(), now=DATE + timedelta(days=20)) == []


def test_an_old_calibration_is_named_with_its_age():
    now = DATE + timedelta(days=LARGEST_AGE + 10.0)
    (sentence,) = rig_warnings(rig(), RATE, *channels(), now=now)
    assert "plate B" in sentence
    assert "100 days" in sentence


def test_another_delay_of_the_velocity_is_named():
    (sentence,) = rig_warnings(rig(), RATE, *channels(delay=0.0014), now=DATE)
    assert "1.4" in sentence
    assert "0.40 ms" in sentence


@pytest.mark.parametrize("factor", [0.3, 4.0])
def test_another_noise_is_named_for_each_channel(factor):
    found = rig_warnings(rig(), RATE, *channels(noise=factor), now=DATE)
    assert [s.split()[2] for s in found] == ["position", "velocity", "torque"]


def test_a_delay_is_read_within_its_standard_error_and_a_short_stretch_is_not_judged():
    position, velocity, torque = channels(delay=0.0009)
    found = velocity_delay(RATE, position, velocity)
    assert abs(found.value - 0.0009) < 4.0 * found.standard_error + 1e-5
    assert found.standard_error < 1e-4
    assert rig_warnings(rig(), RATE, position[:99], velocity[:99], torque[:99], now=DATE) == []
