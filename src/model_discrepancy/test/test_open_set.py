"""A name that could stand for an effect is fitted to each recording as well as it can be."""

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from model_discrepancy.fit.base_model import bic
from model_discrepancy.problem import prepare
from model_discrepancy.recording.recording import Recording
from model_discrepancy.tools import open_set
from model_discrepancy.tools.open_set import OpenSet
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 512.0
CORE = {"inertia": {"I": 0.0137}, "viscosity": {}, "stiffness": {"K": 60.0}, "reflex": {"G": 5.0}}
BONDS = "short_range_stiffness"
HIDDEN = {"k": 250.0, "yield": 0.004, "recovery": 2.0}


@pytest.fixture(scope="module")
def problem():
    reference = PulseStep(Settings(rate=RATE)).next(round(20.0 * RATE))
    model = Model.of({**CORE, BONDS: HIDDEN, "voluntary_torque": {}})
    made = simulate(reference, RATE, model, seed=1)
    return prepare(
        Recording(RATE, made.position, made.torque, made.velocity, reference[:, 0], name="bonds")
    )


def test_a_name_is_found_again_far_from_the_values_of_the_last_recording(problem, monkeypatch):
    far = {**problem.base.values, BONDS: {"k": 30.0, "yield": 0.03, "recovery": 5.0}}
    asked = OpenSet(BONDS, {BONDS: far})
    found = asked.fitted(problem.fitter, BONDS)
    assert found.values[BONDS]["yield"] == pytest.approx(HIDDEN["yield"], rel=0.3)
    monkeypatch.setattr(open_set, "STARTS", 1)
    assert asked.fitted(problem.fitter, BONDS).score > 1.1 * found.score


def test_what_more_parameters_gain_by_chance_does_not_count(problem):
    fitter, base = problem.fitter, problem.base
    more = fitter.fit([*base.terms, BONDS], base.values)
    terms = more.size - base.size
    expected = fitter.rows.independent * np.log(more.score / base.score)
    assert bic(fitter, more) - bic(fitter, base) == pytest.approx(
        expected + terms * np.log(fitter.rows.independent)
    )
    assert terms >= 3
