"""What settles, stiffness or reflex: one half of a recording tells nothing of the other."""

from copy import copy
from dataclasses import replace

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.run_time import REFERENCE_TIME
from ankle_physics.signals import Signals
from model_discrepancy.criticism.criticism import _held_out
from model_discrepancy.diagnose import diagnose
from simulation_study.planted_trials import simulate_trial

SETTLING = {"kt": -0.8, "T": 25.0}
RIVALS = (
    "settling_stiffness",
    "stiffness_drift",
    "cocontraction",
    "activation_stiffness",
    "position_dependent_stiffness",
)


def torque(planted: dict[str, dict[str, float]], rate: float = 100.0) -> np.ndarray:
    """Return the torque of a minute and a half at an angle of one, by stiffness alone."""
    angle = np.ones(int(90.0 * rate))
    still = np.zeros_like(angle)
    model = Model.of({"stiffness": {"K": 50.0}, **planted})
    return model.torque(Signals(rate, angle, still, still))


def test_stiffness_approaches_its_last_value():
    rate, made = 100.0, torque({"settling_stiffness": SETTLING})
    middle = int(REFERENCE_TIME * rate)
    assert made[middle] == pytest.approx(50.0)
    assert rate * (made[middle + 1] - made[middle]) == pytest.approx(SETTLING["kt"], rel=1e-3)
    last = 50.0 + SETTLING["kt"] * SETTLING["T"]
    assert (made[-1] - last) / (made[middle] - last) == pytest.approx(
        np.exp(-60.0 / 25.0), rel=0.01
    )


def test_with_a_long_time_constant_it_is_a_steady_drift():
    slow = torque({"settling_stiffness": {"kt": -0.3, "T": 150.0}})
    steady = torque({"stiffness_drift": {"kt": -0.3}})
    assert np.abs(slow - steady)[2000:4000].max() < 0.2


def diagnosed(library, planted=None):
    planted = planted or {"settling_stiffness": SETTLING}
    return diagnose(simulate_trial(planted, seed=3, duration=60.0, rate=1024.0), library=library)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        pytest.param("settling_reflex", {"Gt": -0.1, "T": 12.0}, id="settles"),
        pytest.param("reflex_drift", {"Gt": -0.12}, id="does not", marks=pytest.mark.slow),
    ],
)
def test_a_reflex_that_settles_is_told_from_one_that_drifts(name, values):
    rivals = ("settling_reflex", "reflex_drift", "activation_reflex_gain", "stiffness_drift")
    found = diagnosed(rivals, {name: values})
    assert names(found) == [name]
    assert found.verdict.verdict == "explained"


@pytest.fixture(scope="module")
def diagnosis():
    return diagnosed(RIVALS)


def names(diagnosis):
    return [effect.trial.name for effect in diagnosis.found.effects]


def test_it_is_named(diagnosis):
    assert names(diagnosis) == ["settling_stiffness"]


@pytest.mark.slow
def test_it_is_named_among_all_terms():
    assert names(diagnosed(None)) == ["settling_stiffness"]


@pytest.mark.parametrize("worse", [True, False])
def test_models_are_scored_on_alternating_stretches_where_one_half_tells_nothing(diagnosis, worse):
    """From the second half alone a fit may not know how steeply the stiffness fell in the first."""
    found = copy(diagnosis.found)
    change = -1.0 if worse else 1.0
    found.final_held_out = replace(found.final_held_out, vaf=found.base_held_out.vaf + change)
    base, final = _held_out(diagnosis.problem, found)
    assert (base is found.base_held_out) != worse
    assert (final is found.final_held_out) != worse
    if worse:
        assert final.vaf > base.vaf + 1.0


def test_without_a_term_that_follows_time_the_halves_stay(diagnosis):
    found = copy(diagnosis.found)
    found.final = found.base
    found.final_held_out = replace(found.final_held_out, vaf=0.0)
    assert _held_out(diagnosis.problem, found)[1] is found.final_held_out
