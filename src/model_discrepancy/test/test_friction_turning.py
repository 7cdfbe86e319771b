"""Friction that turns in another way than its equation says: a term frees how it turns."""

import numpy as np
import pytest

from ankle_physics.terms.coulomb_friction import CoulombFriction
from model_discrepancy.problem import prepare
from model_discrepancy.search.screening import with_turning, without_term
from simulation_study.planted_trials import simulate_trial

TURNED = "friction_turning"
FRICTION = {"F": 1.2, "v0": 0.01}


def turns_at_once(self, signals, values, state):
    """Return friction that turns within less than its equation can, and 1 ms sooner."""
    return {"F": np.clip((signals.velocity + 0.001 * signals.acceleration) / 0.005, -1.0, 1.0)}


def fits(recording):
    """Return fits of the base model with friction, without and with a turning of its own."""
    problem = prepare(recording)
    values = {**problem.base.values, "coulomb_friction": FRICTION}
    plain = problem.fitter.fit(list(values), values)
    return plain, with_turning(problem.fitter, plain)


@pytest.fixture(scope="module")
def other_turning():
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(CoulombFriction, "torque", turns_at_once)
        recording = simulate_trial({"coulomb_friction": FRICTION}, seed=3, duration=30.0)
    return fits(recording)


def test_a_turning_of_its_own_takes_what_the_equation_leaves(other_turning):
    plain, freed = other_turning
    assert freed.score < 0.8 * plain.score


def test_the_size_of_the_friction_stays_that_of_its_own_term(other_turning):
    freed = other_turning[1]
    assert freed.values["coulomb_friction"]["F"] == pytest.approx(1.2, rel=0.1)
    assert max(abs(amount) for amount in freed.values[TURNED].values()) > 0.01


def test_the_turning_comes_with_friction_and_goes_with_it(other_turning):
    plain, freed = other_turning
    assert TURNED not in plain.terms
    assert set(freed.terms) == {*plain.terms, TURNED}
    assert with_turning(None, freed) is freed
    assert not {"coulomb_friction", TURNED} & set(without_term(freed.terms, "coulomb_friction"))
    # The friction of a calibrated rig needs it still.
    beside = [*freed.terms, "footplate_friction"]
    assert set(beside) - set(without_term(beside, "coulomb_friction")) == {"coulomb_friction"}
