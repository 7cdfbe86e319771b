"""Generic regressors over time see a joint that changes slowly."""

import pytest

from model_discrepancy.criticism.remainder import remainder
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.generic_bank import GenericBank
from model_discrepancy.problem import prepare
from model_discrepancy.recording.motion import motion_of
from model_discrepancy.search.null import Null
from simulation_study.planted_trials import simulate_trial


@pytest.mark.parametrize(
    ("planted", "seen"), [({"stiffness_drift": {"kt": -0.6}}, (True, False)), ({}, (False, False))]
)
def test_a_joint_that_tires_is_predictable_over_time_only(planted, seen):
    problem = prepare(simulate_trial(planted, seed=6, duration=40.0))
    fitter, base = problem.fitter, problem.base
    null = Null.of(problem.noise, fitter.rows.time, fitter.rows.used)
    found = tuple(
        remainder(bank, fitter, base.residual, base.plain, problem.parts, null.drawn).criticises
        for bank in (problem.bank_over_time, problem.bank)
    )
    assert found == seen


def test_each_regressor_states_what_it_is_made_of():
    fitter = Fitter.of(motion_of(simulate_trial({}, seed=6, duration=10.0)))
    constant, changing = (GenericBank(fitter.columns, over_time=over) for over in (False, True))
    assert changing.whitened().shape == (fitter.rows.count, len(changing.inputs))
    assert not set(constant.inputs) & set(changing.inputs)
