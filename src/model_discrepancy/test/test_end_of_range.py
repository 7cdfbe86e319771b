"""A joint that meets a further stiffness from a certain angle on."""

import numpy as np
import pytest

from ankle_physics.impedance import OperatingPoint, tangent_stiffness
from ankle_physics.model import Model
from ankle_physics.signals import Signals
from model_discrepancy.diagnose import diagnose
from simulation_study.planted_trials import simulate_trial

END = {"ke": 90.0, "xe": 0.01, "toe": 0.0015}
STATIC = ("position_dependent_stiffness", "hardening_stiffness", "cyclic_angle_error")


def test_torque_is_another_straight_line_beyond_the_angle():
    angle = np.linspace(-0.05, 0.05, 201)
    still = np.zeros_like(angle)
    made = Model.of({"end_of_range": END}).torque(Signals(100.0, angle, still, still))
    far = np.abs(angle - END["xe"]) > 0.015
    expected = END["ke"] * np.maximum(angle - END["xe"], 0.0)
    assert np.abs(made - expected)[far].max() < 1e-4
    assert made[np.argmin(np.abs(angle - END["xe"]))] == pytest.approx(
        END["ke"] * END["toe"] * np.log(2.0)
    )


@pytest.mark.parametrize(("position", "expected"), [(-0.02, 50.0), (0.04, 140.0)])
def test_stiffness_is_that_of_the_side_on_which_the_joint_is(position, expected):
    model = Model.of({"stiffness": {"K": 50.0}, "end_of_range": END})
    found = tangent_stiffness(model, OperatingPoint(position=position))
    assert found == pytest.approx(expected, rel=1e-3)


@pytest.fixture(scope="module")
def stiffening():
    planted = {"stiffness": {"K": 60.0}, "end_of_range": END}
    return simulate_trial(planted, seed=5, duration=60.0, rate=1024.0)


@pytest.mark.slow
def test_it_is_named_and_leaves_the_stiffness_right(stiffening):
    verdict = diagnose(stiffening, library=("end_of_range", *STATIC)).verdict
    assert [effect["name"] for effect in verdict.effects] == ["end_of_range"]
    parameters = verdict.effects[0]["parameters"]
    assert parameters["ke[N.m/rad]"][0] == pytest.approx(END["ke"], rel=0.05)
    stiffness = verdict.parameters["K[N.m/rad]"]
    without = diagnose(stiffening, library=STATIC).verdict.parameters["K[N.m/rad]"]
    error, before = (
        abs(one["augmented"] - true_stiffness(stiffening)) for one in (stiffness, without)
    )
    assert error < 2.0 * stiffness["standard_error"]
    assert error < 0.5 * before


def true_stiffness(recording):
    model = Model.of({"stiffness": {"K": 60.0}, "end_of_range": END})
    return tangent_stiffness(model, OperatingPoint(position=float(np.mean(recording.position))))
