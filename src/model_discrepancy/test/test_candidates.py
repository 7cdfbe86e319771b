"""Candidates begin where a fit leads to them: other terms may have bent to take their place."""

import pytest

from model_discrepancy.problem import prepare
from model_discrepancy.search.candidates import Candidates
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import grid
from model_discrepancy.search.term_search import search
from simulation_study.planted_trials import simulate_trial


@pytest.mark.slow
def test_a_late_reflex_is_found_where_the_first_response_was_drawn_out():
    """From the base model's own values a fit ends where the first response holds most of it."""
    planted = {
        "reflex": {"G": 8.0, "delay": 0.044, "omega": 42.0, "z": 0.9},
        "long_latency_reflex": {"Gl": 5.0, "delay": 0.085, "omega": 22.0},
    }
    problem = prepare(simulate_trial(planted, seed=3, duration=40.0))
    null = Null.of(problem.noise, problem.fitter.rows.time, problem.fitter.rows.used)
    assert problem.base.values["reflex"]["z"] > 1.4
    grids = Grids(["long_latency_reflex"], 40.0)
    trials, _ = Candidates(problem.fitter, null, grids, lambda _: None).best(problem.base)
    assert trials[0].accepted
    found = trials[0].fit.values
    assert found["long_latency_reflex"]["Gl"] == pytest.approx(5.0, rel=0.1)
    assert found["reflex"]["z"] == pytest.approx(0.9, abs=0.05)


def test_straps_are_tried_from_their_whole_grid_where_nothing_is_found():
    problem = prepare(simulate_trial({}, seed=3, duration=20.0, protocol="random"))
    null = Null.of(problem.noise, problem.fitter.rows.time, problem.fitter.rows.used)
    said = []
    grids = Grids(("fixation_compliance", "tendon"), 20.0)
    trials, _ = Candidates(problem.fitter, null, grids, said.append).best(problem.base)
    assert not any(trial.accepted for trial in trials)
    assert any("fixation_compliance, which is usual" in line for line in said)


def test_a_damping_that_levels_off_is_no_dry_friction_however_slowly():
    planted = {"saturating_damping": {"D": 6.0, "vs": 0.1}}
    problem = prepare(simulate_trial(planted, seed=3, duration=40.0, protocol="random"))
    null = Null.of(problem.noise, problem.fitter.rows.time, problem.fitter.rows.used)
    library = ("saturating_damping", "coulomb_friction")
    found = search(problem.fitter, problem.base, null, library)
    assert [effect.trial.name for effect in found.effects] == ["saturating_damping"]
    assert found.final.values["saturating_damping"]["vs"] == pytest.approx(0.1, rel=0.2)


@pytest.mark.parametrize(
    ("size", "power"), [(4.0, 0.5), pytest.param(1.5, 2.0, marks=pytest.mark.slow)]
)
def test_a_damping_that_follows_a_power_of_speed_is_told_from_one_that_levels_off(size, power):
    planted = {"power_damping": {"D": size, "p": power}}
    problem = prepare(simulate_trial(planted, seed=3, duration=40.0, protocol="random"))
    null = Null.of(problem.noise, problem.fitter.rows.time, problem.fitter.rows.used)
    library = ("saturating_damping", "coulomb_friction", "asymmetric_damping", "power_damping")
    found = search(problem.fitter, problem.base, null, library)
    assert [effect.trial.name for effect in found.effects] == ["power_damping"]
    assert found.final.values["power_damping"]["p"] == pytest.approx(power, rel=0.1)


def test_a_threshold_is_found_in_slow_movements():
    points = [point["vt"] for point in grid("reflex_threshold", 60.0)]
    assert min(points) <= 0.02 < 0.5 < max(points)
