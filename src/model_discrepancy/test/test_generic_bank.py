"""Generic regressors over time see a joint that changes slowly."""

import pytest

from model_discrepancy.criticism.remainder import remainder
from model_discrepancy.fit import held_torque
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.generic_bank import GenericBank
from model_discrepancy.problem import prepare
from model_discrepancy.recording.motion import motion_of
from model_discrepancy.search.null import Null
from simulation_study.planted_trials import simulate_trial
from simulation_study.verdict_cases import Plan, made


def recorded_binary():
    """A binary sequence without a mismatch, of a subject whose reflex varies."""
    plan = Plan(
        *("null", 16, 1665214809977070823, (), "stiff", "binary", 2048.0),
        velocity=False,
        reference=True,
        noise="noisy",
        variability="large",
    )
    return made(plan).recording


@pytest.mark.parametrize(
    ("planted", "seen"),
    [
        ({"stiffness_drift": {"kt": -0.6}}, (True, False, False)),
        ({"activation_stiffness": {"ka": 20.0}}, (False, True, False)),
        ({}, (False, False, False)),
    ],
)
def test_a_joint_that_changes_is_predictable_over_what_it_changes_with_only(planted, seen):
    problem = prepare(simulate_trial(planted, seed=6, duration=60.0))
    fitter, base = problem.fitter, problem.base
    null = Null.of(problem.noise, fitter.rows.time, fitter.rows.used)
    found = tuple(
        remainder(bank, fitter, base.residual, base.plain, problem.parts, null.drawn).criticises
        for bank in (problem.bank_over_time, problem.bank_over_torque, problem.bank)
    )
    assert found == seen


def test_what_a_bank_predicts_does_not_raise_what_it_predicts_by_chance():
    for planted, lower in (({"activation_stiffness": {"ka": 20.0}}, True), ({}, False)):
        problem = prepare(simulate_trial(planted, seed=6, duration=60.0))
        fitter, base, bank = problem.fitter, problem.base, problem.bank_over_torque
        used = fitter.rows.used
        null = Null.of(problem.noise, fitter.rows.time, used)
        rest = null.drawn_from(bank.unpredicted(problem.noise, problem.parts)[used])
        whole, without = (
            remainder(bank, fitter, base.residual, base.plain, problem.parts, noise).by_chance
            for noise in (null.drawn, rest)
        )
        assert (without < 0.5 * whole) == lower
        assert without <= whole


def test_each_regressor_states_what_it_is_made_of():
    fitter = Fitter.of(motion_of(simulate_trial({}, seed=6, duration=10.0)))
    constant, changing = (GenericBank(fitter.columns, over=over) for over in (None, "time"))
    assert changing.whitened().shape == (fitter.rows.count, len(changing.inputs))
    assert not set(constant.inputs) & set(changing.inputs)


def test_without_rests_nobody_knows_the_preceding_torque():
    fitter = Fitter.of(motion_of(simulate_trial({}, seed=6, duration=10.0)))
    assert fitter.motion.preceding is None
    with pytest.raises(ValueError, match="held before each movement"):
        GenericBank(fitter.columns, over="preceding torque")


def test_responses_that_overlap_are_no_joint_that_follows_torque():
    """In a binary sequence the response to one movement, whose size varies, is under way just
    before the next one, and lasts on.
    """
    recording, shares = recorded_binary(), []
    for least_rested in (held_torque.LEAST_RESTED, 0.0):
        with pytest.MonkeyPatch.context() as patch:
            patch.setattr(held_torque, "LEAST_RESTED", least_rested)
            problem = prepare(recording)
        base = problem.base
        shares.append(
            remainder(
                problem.bank_over_torque, problem.fitter, base.residual, base.plain, problem.parts
            ).share
        )
    assert shares[0] < 0.02
    assert shares[1] > 0.05
