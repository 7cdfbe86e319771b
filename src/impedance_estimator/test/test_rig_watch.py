"""The rig file is judged on the running samples."""

from datetime import datetime, timezone

import numpy as np
from scipy import signal

from ankle_physics.rig_file import RigFile
from impedance_estimator.rig_watch import WATCH_PERIOD, WATCHED_DURATION, RigWatch

RATE = 1024.0
START = 1.7e9
NOISE = {"position[rad]": 4.5e-5, "torque[N.m]": 0.14}


def watch():
    date = datetime.fromtimestamp(START, timezone.utc)
    return RigWatch(RigFile("plate B", date, noise=NOISE), RATE, measured_velocity=False)


def samples(seconds, noise=1.0):
    random = np.random.default_rng(2)
    n = round(seconds * RATE)
    levels = np.repeat(random.uniform(-0.02, 0.02, n // 400 + 1), 400)[:n]
    x = signal.sosfilt(signal.butter(2, 30.0, fs=RATE, output="sos"), levels)
    torque = 80.0 * x + noise * 0.14 * random.normal(size=n)
    position = x + 4.5e-5 * random.normal(size=n)
    return np.column_stack([START + np.arange(n) / RATE, position, torque])


def said(made, data):
    return [s for part in np.array_split(data, 640) for s in made.add(part)]


def test_a_rig_that_fits_is_silent_and_one_that_does_not_is_named_once():
    assert said(watch(), samples(2.0 * WATCH_PERIOD)) == []
    made = watch()
    (sentence,) = said(made, samples(WATCHED_DURATION + 1.0, noise=3.0))
    assert "torque" in sentence
    assert made.warnings == [sentence]


def test_samples_that_are_not_finite_begin_a_new_stretch():
    made = watch()
    data = samples(1.5 * WATCHED_DURATION, noise=3.0)
    data[len(data) // 2, 1] = np.nan
    assert said(made, data) == []
