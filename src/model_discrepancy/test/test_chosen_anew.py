"""Terms that stand in for each other are chosen anew beside what was found meanwhile."""

from types import SimpleNamespace

import numpy as np
import pytest

from model_discrepancy.diagnose import is_misshapen
from model_discrepancy.problem import prepare
from model_discrepancy.search import chosen_anew as stage
from model_discrepancy.search.chosen_anew import chosen_anew
from model_discrepancy.search.found import Effect, Found, Trial
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.hypotheses import Hypotheses
from model_discrepancy.search.null import Null
from simulation_study.planted_trials import simulate_trial

STRAPS = {"fixation_compliance": {"k_s": 900.0, "b_s": 3.0}}
MODE = {"torque_sensor_mode": {"frequency": 45.0, "damping": 0.2}}
MEMORY = {"maxwell_relaxation": {"k": 30.0, "T": 0.05}}
SECONDS = 20.0


@pytest.fixture(scope="module")
def searched():
    """Return a recording with straps and relaxation, ready for a search, and what begins one."""
    recording = simulate_trial(STRAPS | MEMORY, seed=4, duration=SECONDS, protocol="random")
    problem = prepare(recording)
    rows = problem.fitter.rows
    null = Null.of(problem.noise, rows.time, rows.used)
    null.gains = {name: np.full(160, 0.002) for name in (*STRAPS, *MODE, *MEMORY)}
    grids = Grids([*STRAPS, *MODE, *MEMORY], SECONDS)
    begun = Hypotheses(problem.fitter, problem.base, null, grids, rows.gain(), print)
    return problem, begun, grids


def found_with(problem, terms):
    """Return what a search would have found that ended with these terms."""
    start = {**problem.base.values, **terms}
    final = problem.fitter.fit([*problem.base.terms, *terms], start, evaluations=60)
    effects = [Effect(Trial(name, final, 0.5, (0.5, 0.5), -100.0), np.zeros(2)) for name in terms]
    return Found(problem.base, final, effects)


def test_straps_are_chosen_where_a_mode_of_the_sensor_stood_for_them(searched):
    problem, begun, grids = searched
    found = found_with(problem, MODE | MEMORY)
    best = chosen_anew(begun, problem.fitter, found, grids, print)
    assert {effect.trial.name for effect in best.found.effects} == {*STRAPS, *MEMORY}
    assert best.current.score < 0.9 * found.final.score
    assert best.current.values["fixation_compliance"]["k_s"] == pytest.approx(900.0, rel=0.1)


def test_what_is_right_stays(searched):
    problem, begun, grids = searched
    assert (
        chosen_anew(begun, problem.fitter, found_with(problem, STRAPS | MEMORY), grids, print)
        is None
    )


def test_what_the_rig_is_known_to_hold_is_not_begun(searched):
    problem, begun, grids = searched
    found = found_with(problem, MODE | STRAPS | MEMORY)
    found.effects = [e for e in found.effects if e.trial.name not in STRAPS]
    said = []
    chosen_anew(begun, problem.fitter, found, grids, said.append)
    assert not any(line.startswith("fixation_compliance anew") for line in said)


def test_a_model_that_predicts_unseen_torque_worse_is_not_taken(searched, monkeypatch):
    problem, begun, grids = searched
    monkeypatch.setattr(stage, "harms", lambda *_: True)
    assert (
        chosen_anew(begun, problem.fitter, found_with(problem, MODE | MEMORY), grids, print) is None
    )


def test_less_is_predicted_of_what_the_right_terms_leave(searched):
    problem, _, _ = searched
    wrong, right = (found_with(problem, terms | MEMORY).final for terms in (MODE, STRAPS))
    assert problem.predicted(right) < 0.5 * problem.predicted(wrong)


@pytest.mark.parametrize(
    ("predicted", "terms", "asked"), [(0.2, 5, True), (0.05, 5, False), (0.2, 4, False)]
)
def test_terms_are_chosen_anew_where_many_leave_much_predictable(searched, predicted, terms, asked):
    found = found_with(searched[0], MODE | MEMORY)
    found.effects, found.refinements = found.effects[:1] * (terms - 1), found.effects[:1]
    assert is_misshapen(SimpleNamespace(predicted=lambda _: predicted), found) == asked
