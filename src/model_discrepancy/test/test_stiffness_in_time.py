"""The stiffness that a report draws is that which the simulation has."""

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.signals import Signals
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.stiffness_course import courses_of_stiffness
from model_discrepancy.recording.motion import Motion
from model_discrepancy.report.stiffness_in_time import changes_stiffness, stiffness_in_time

RATE = 200.0
VALUES = {
    "activation_stiffness": {"ka": 4.0},
    "cocontraction": {"kc": 20.0},
    "cyclic_stiffness": {"kc": 12.0, "ks": -9.0, "frequency": 0.5},
    "settling_stiffness": {"kt": -0.5, "T": 30.0},
    "stiffness_drift": {"kt": 0.4},
}


@pytest.mark.parametrize("name", sorted(courses_of_stiffness()))
def test_the_torque_of_an_angle_grows_by_the_stiffness(name):
    time = np.arange(int(60.0 * RATE)) / RATE
    still = np.zeros_like(time)
    angle = 0.02 * np.sin(2.0 * np.pi * 0.7 * time)
    activation, course = 2.0 + np.sin(time), np.sqrt(2.0) * np.cos(time)
    motion = Motion(RATE, angle, still, still, still, activation, cocontraction=course)
    fitter = Fitter.of(motion)
    model = Model.of({"stiffness": {"K": 80.0}, name: VALUES[name]})
    fit = fitter.evaluate({e.term.name: dict(e.values) for e in model.entries})
    drawn = stiffness_in_time(fitter, fit)
    signals = (
        Signals(RATE, angle + shift, still, still, activation, course) for shift in (0.0, 0.001)
    )
    before, after = (model.torque(one) for one in signals)
    np.testing.assert_allclose(drawn, (after - before) / 0.001, rtol=1e-6)
    assert np.ptp(drawn) > 5.0


def test_a_steady_stiffness_is_not_drawn():
    assert not changes_stiffness(["inertia", "stiffness", "maxwell_relaxation"])
    assert changes_stiffness(["stiffness", "cocontraction"])
