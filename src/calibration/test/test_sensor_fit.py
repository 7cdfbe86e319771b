"""A torque sensor is described as far as the recording shows one, beside friction of any kind."""

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from calibration.errors import CalibrationError
from calibration.one_way_motion import OneWayMotion, one_way_stretches
from calibration.rig_identification import identify_rig
from calibration.rig_spectra import RigSpectra, Signals, rest_of
from calibration.sensor_fit import LAG, MODE
from perturbation_generator.rig_calibration import DURATION, RigCalibration
from perturbation_generator.settings import Settings

RATE = 1000.0
INERTIA, FRICTION, DELAY = 0.006, 0.3, 2  # kg.m^2, N.m, samples
NOISE = (4e-5, 0.1)  # rad, N.m


@pytest.mark.parametrize(
    ("sensor", "values", "inside"),
    [
        (LAG, [0.0, 0.003], True),
        (LAG, [0.0, 0.0003], False),  # a part of the delay
        (LAG, [0.03, 0.003], False),
        (MODE, [0.0, 62.0, 0.06], True),
        (MODE, [0.0, 119.9, 0.06], False),  # at the end of the recorded band
        (MODE, [0.0, float("nan"), 0.06], False),
    ],
)
def test_a_value_at_the_end_of_its_range_was_not_found(sensor, values, inside):
    assert sensor.is_inside(np.array(values)) is inside


def made(lag=0.0, friction_lags=0.0, **changes):
    """A plate whose servo is a Butterworth filter; its friction follows the velocity late, or early
    (as solvers of contacts have it), and sticks at no value: no equation of the library.
    """
    settings = Settings(rate=RATE, amplitude=0.04, seed=5, direction="both")
    reference = RigCalibration(settings).next(int(DURATION * RATE))
    position, velocity, acceleration = lfilter(*butter(2, 40.0, fs=RATE), reference, axis=0).T
    friction = FRICTION * np.clip((velocity - friction_lags * acceleration) / 0.01, -1.0, 1.0)
    torque = INERTIA * acceleration + friction
    if lag:
        kept = np.exp(-1.0 / (RATE * lag))
        torque = lfilter([1.0 - kept], [1.0, -kept], torque)
    torque = np.concatenate([np.zeros(DELAY), torque[:-DELAY]])
    random = np.random.default_rng(2)
    noise = [size * random.standard_normal(len(reference)) for size in NOISE]
    channels = {"position": position + noise[0], "torque": torque + noise[1]}
    return Signals(RATE, **{"velocity": None, "reference": reference[:, 0], **channels, **changes})


@pytest.mark.parametrize(
    "friction_lags",
    [
        pytest.param(-0.001, marks=pytest.mark.slow),
        0.0,
        pytest.param(0.001, marks=pytest.mark.slow),
    ],
)
@pytest.mark.parametrize("lag", [0.0, 0.003])
def test_a_lag_is_told_from_friction_that_comes_late_or_early(lag, friction_lags):
    found = identify_rig(made(lag, friction_lags))
    # The filter of a sampled exponential is half a sample early.
    delay = (DELAY - (0.5 if lag else 0.0)) / RATE
    assert abs(found.torque_delay.value - delay) < 3.0 * found.torque_delay.error
    assert found.torque_delay.error < 0.1e-3
    assert found.inertia.value == pytest.approx(INERTIA, rel=0.03 if lag else 0.01)
    assert abs(found.inertia.value - INERTIA) < 3.0 * found.inertia.error
    assert found.mode is None
    if lag:
        assert found.lag.value == pytest.approx(lag, rel=0.1)
        assert abs(found.lag.value - lag) < 3.0 * found.lag.error
    else:
        assert found.lag is None


def test_the_plate_keeps_its_direction_in_every_stretch():
    signals = made()
    spectra = RigSpectra(signals, rest_of(signals))
    stretches = one_way_stretches(spectra)
    velocity = np.diff(signals.reference) * RATE
    for first, last in stretches:
        part = np.sign(velocity[int(first * RATE) - 20 : int(last * RATE) - 20])
        assert abs(part.mean()) > 0.99
    assert sum(last - first for first, last in stretches) > 20.0
    samples = OneWayMotion(spectra)(spectra.torque)
    # Each is without its mean, so that friction is in none of them.
    for k in range(len(stretches)):
        assert abs(samples[OneWayMotion(spectra).stretch == k].mean()) < 1e-9


def test_movements_without_sweeps_calibrate_nothing():
    signals = made()
    short = int(34.0 * RATE)
    cut = {name: getattr(signals, name)[:short] for name in ("position", "torque", "reference")}
    with pytest.raises(CalibrationError, match=r"keeps moving one way for 0\.\d s .* rig_calibr"):
        identify_rig(Signals(RATE, velocity=None, **cut))
