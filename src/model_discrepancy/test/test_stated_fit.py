"""A model that lacks physics is stated by the torque that it can explain, a right one by all."""

from dataclasses import replace

import numpy as np
import pytest

from model_discrepancy.criticism.remainder import Remainder, remainder
from model_discrepancy.criticism.stated_fit import stated_fit
from model_discrepancy.fit.standard_errors import with_errors
from model_discrepancy.problem import prepare
from simulation_study.planted_trials import simulate_trial


@pytest.fixture(scope="module")
def lacking():
    """The base model of a joint whose muscles also relax, and what it leaves predictable."""
    problem = prepare(simulate_trial({"maxwell_relaxation": {"k": 35.0, "T": 0.05}}, 1, 40.0))
    base = with_errors(problem.fitter, problem.base)
    after = remainder(problem.bank, problem.fitter, base.residual, base.plain, problem.parts)
    return problem.fitter, base, after


def test_values_of_a_model_that_lacks_physics_leave_less_of_the_plain_torque(lacking):
    fitter, base, after = lacking
    assert after.share > 0.2
    stated = stated_fit(fitter, base, after)
    used = fitter.rows.used
    assert stated.terms == base.terms
    assert np.var(stated.plain[used]) < 0.95 * np.var(base.plain[used])
    assert stated.errors["stiffness"]["K"] > 0.0


def test_a_fit_without_errors_is_stated_without_errors(lacking):
    fitter, base, after = lacking
    bare = fitter.fit(base.terms, base.values)
    assert not stated_fit(fitter, bare, after).errors


@pytest.mark.parametrize(
    "little",
    [
        Remainder(0.05, 0.04, {}, 0.5, 0.01),
        Remainder(0.5, 0.4, {}, 0.5, 1e-5),
        Remainder(0.5, 0.4, {}, 0.5, 0.01, by_chance=0.6),
    ],
)
def test_a_model_of_which_little_is_missing_is_stated_as_it_was_found(lacking, little):
    fitter, base, _ = lacking
    assert stated_fit(fitter, base, little) is base


def test_a_model_with_a_flexible_term_is_stated_by_the_plain_torque(lacking):
    fitter, base, _ = lacking
    little = Remainder(0.05, 0.04, {}, 0.5, 0.01)
    final = fitter.fit([*base.terms, "uneven_damping"], base.values, evaluations=5)
    stated = stated_fit(fitter, final, little)
    used = fitter.rows.used
    assert np.var(stated.plain[used]) < 0.95 * np.var(final.plain[used])


def test_what_is_predicted_in_a_loop_is_not_called_missing_physics():
    remainder = Remainder(0.3, 0.2, {}, 0.3, torque_share=0.01, by_chance=0.05)
    assert remainder.significant
    in_a_loop = replace(remainder, judged=False)
    assert in_a_loop.exceeds_chance
    assert not in_a_loop.significant
    assert not replace(remainder, by_chance=0.4).exceeds_chance
