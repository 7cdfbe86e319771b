"""The foot's motion behind a nonlinear coupling, against the simulation of the same model."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from ankle_physics.foot_motion import foot_motion
from ankle_physics.model import Model
from ankle_physics.signals import Signals
from ankle_physics.term import term_library

RATE = 500.0
FINE_STEPS = 16


def _plate(rate: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Position, velocity and acceleration of a plate that moves at 3 to 20 Hz for 4 s."""
    time = np.arange(0.0, 4.0, 1.0 / rate)
    omega = 2.0 * np.pi * np.array([3.0, 7.3, 20.0])[:, None]
    size = np.array([0.02, 0.008, 0.002])[:, None] * np.minimum(time / 0.5, 1.0) ** 3
    x = np.sum(size * np.sin(omega * time), axis=0)
    v = np.gradient(x, 1.0 / rate)
    return x, v, np.gradient(v, 1.0 / rate)


@pytest.mark.parametrize(
    ("name", "shape"),
    [
        ("stiffening_fixation", {"curvature": 60.0}),
        ("stiffening_fixation", {"curvature": -80.0}),
        ("fixation_stops", {"gap": 0.002, "k_stop": 3000.0}),
        ("heel_lift", {"k_lift": 200.0, "lift": -0.001}),
    ],
)
def test_the_foot_moves_as_in_the_simulation(name, shape):
    fixation = {"k_s": 900.0, "b_s": 3.0, **shape}
    impedance = {"inertia": {"I": 0.012}, "viscosity": {"B": 0.8}, "stiffness": {"K": 60.0}}
    model = Model.of({**impedance, name: fixation})
    fine = _plate(RATE * FINE_STEPS)
    signals = Signals(RATE * FINE_STEPS, *fine, np.zeros(fine[0].size))
    model.start(RATE * FINE_STEPS).torque(signals)
    term = term_library()[name]()
    plate = tuple(signal[::FINE_STEPS] for signal in fine[:2])
    x, v, a = foot_motion(term, fixation, (0.012, 0.8, 60.0), plate, RATE)
    later = slice(round(RATE), None)
    for own, simulated, least in (
        (x, signals.foot_position, 1e-3),
        (v, signals.foot_velocity, 5e-3),
        (a, signals.foot_acceleration, 2e-2),
    ):
        expected = simulated[::FINE_STEPS][later]
        assert np.std(own[later] - expected) < least * np.std(expected)
        assert np.std(own[later] - expected) < 0.1 * np.std(expected - expected.mean())


@pytest.mark.slow
def test_a_stop_that_is_steep_for_the_sampling_rate_is_simulated():
    """What the foot makes of a sample would throw it back by more than it came."""
    stops = {"k_s": 330.0, "b_s": 11.0, "gap": 0.002, "k_stop": 90_000.0}
    impedance = {"inertia": {"I": 0.015}, "viscosity": {"B": 0.8}, "stiffness": {"K": 300.0}}
    model = Model.of({**impedance, "fixation_stops": stops})

    def torque(steps: int) -> np.ndarray:
        plate = _plate(RATE * steps)
        signals = Signals(RATE * steps, *plate, np.zeros(plate[0].size))
        return model.start(RATE * steps).torque(signals)[::steps]

    slow = butter(4, 50.0, fs=RATE, output="sos")
    coarse, fine = (sosfiltfilt(slow, torque(steps)) for steps in (1, FINE_STEPS))
    assert np.abs(fine).max() > 5.0
    assert np.std(coarse - fine) < 0.1 * np.std(fine)


def test_a_foot_without_inertia_moves():
    fixation = {"k_s": 900.0, "b_s": 3.0, "curvature": 60.0}
    term = term_library()["stiffening_fixation"]()
    x, v, a = foot_motion(term, fixation, (0.0, 0.8, 60.0), _plate(RATE)[:2], RATE)
    assert np.all(np.isfinite([x, v, a]))
    assert np.std(x) > 0.5 * np.std(_plate(RATE)[0])


def test_a_contraction_behind_stops_is_a_stiffness_that_changes():
    """The foot is found in windows, each of which needs its own stretch of the course."""
    rate = 2000.0
    x, v, a = _plate(rate)
    course = np.sqrt(2.0) * np.sin(2.0 * np.pi * 0.4 * np.arange(len(x)) / rate)
    stops = {"k_s": 900.0, "b_s": 3.0, "gap": 0.002, "k_stop": 3000.0}
    impedance = {"inertia": {"I": 0.012}, "viscosity": {"B": 0.8}, "stiffness": {"K": 60.0}}
    contracted = Model.of({**impedance, "cocontraction": {"kc": 25.0}, "fixation_stops": stops})
    scripted = Model.of({**impedance, "fixation_stops": stops})
    steady = scripted.torque(Signals(rate, x, v, a))
    scripted.entry("stiffness").values["K"] = 60.0 + 25.0 * course
    made = contracted.torque(Signals(rate, x, v, a, cocontraction=course))
    np.testing.assert_allclose(made, scripted.torque(Signals(rate, x, v, a)), atol=1e-6)
    assert np.std(made - steady) > 0.01 * np.std(steady)
