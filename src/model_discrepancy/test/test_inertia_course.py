"""An inertia that seems to drift tells of the torque channel's gain, and a joint's stiffness that
drifts is none.
"""

from dataclasses import replace

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from model_discrepancy.criticism.variability import variability
from model_discrepancy.fit.inertia_course import inertia_course
from model_discrepancy.problem import prepare
from model_discrepancy.recording.recording import Recording
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 1024.0  # Hz
JOINT = {
    "inertia": {"I": 0.0137},
    "viscosity": {},
    "stiffness": {"K": 60.0},
    "reflex": {"G": 8.0},
    "voluntary_torque": {},
}


def recording(seconds=48.0, **terms):
    reference = PulseStep(Settings(rate=RATE)).next(round(seconds * RATE))
    made = simulate(reference, RATE, Model.of({**JOINT, **terms}), seed=2)
    return Recording(RATE, made.position, made.torque, made.velocity, reference[:, 0], name="r")


def found_in(one):
    problem = prepare(one)
    return variability(problem.fitter, problem.base, one.torque)


@pytest.fixture(scope="module")
def steady():
    return recording()


def test_a_gain_that_drifts_is_seen_as_large_as_it_is(steady):
    course = 1.0 + 0.1 * np.cos(np.pi * steady.time / steady.duration)
    found = found_in(replace(steady, torque=course * steady.torque))
    share, error = found.inertia
    assert share == pytest.approx(0.1 / np.sqrt(2.0), abs=max(0.015, 3.0 * error))
    assert any("the gain of the torque channel drifts" in s for s in found.unexplainable)
    assert found.content()["inertia_in_time"] == {"share_of_mean[1]": [share, error]}


def test_a_joint_without_mismatch_has_one_inertia(steady):
    found = found_in(steady)
    assert found.inertia == (0.0, 0.0)
    assert found.unexplainable == []


def test_a_stiffness_that_drifts_is_no_matter_of_the_inertia():
    found = found_in(recording(stiffness_drift={"kt": 0.6, "bt": 0.006}))
    assert found.inertia == (0.0, 0.0)


def test_a_short_recording_and_a_joint_without_inertia_tell_nothing(steady):
    problem = prepare(recording(20.0))
    assert inertia_course(problem.fitter, problem.base) is None
    problem = prepare(steady)
    without = {name: v for name, v in problem.base.values.items() if name != "inertia"}
    assert inertia_course(problem.fitter, replace(problem.base, values=without)) is None
