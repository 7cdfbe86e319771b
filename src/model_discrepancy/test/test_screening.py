"""A small effect lies near a point that is tried, so that its term is promising."""

import pytest

from model_discrepancy.problem import prepare
from model_discrepancy.search.candidates import Candidates
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import grid, screen
from simulation_study.planted_trials import simulate_trial
from simulation_study.verdict_cases import Plan, made


@pytest.mark.parametrize(
    ("name", "values", "least"),
    [
        ("channel_skew", {"skew": 0.003}, 0.7),
        ("backlash", {"gap": 0.0006}, 0.3),
        ("torque_sensor_lag", {"T": 0.0005}, 0.3),
    ],
)
def test_a_small_effect_is_promising(name, values, least):
    problem = prepare(simulate_trial({name: values}, seed=3, duration=40.0))
    found = screen(problem.fitter, problem.base, {name: grid(name, 40.0)})[0]
    assert found.share > least


@pytest.mark.slow
def test_torque_that_is_two_milliseconds_early_is_promising_on_another_engine():
    """4 ms away from the right skew the torque is described no better than without any."""
    plan = Plan(
        "effect", 36, 2219671537640731230, ("torque_delay",), "stiff", "pulse_step", 2048.0, False,
        True, "noisy", "small", True,
    )  # fmt: skip
    problem = prepare(made(plan).recording)
    found = screen(problem.fitter, problem.base, {"channel_skew": grid("channel_skew", 60.0)})[0]
    assert found.share > 0.7


@pytest.mark.parametrize(
    ("name", "values", "seed"),
    [
        ("partial_sensor_mode", {"frequency": 32.3, "damping": 0.012, "share": 0.345}, 1),
        ("plate_appendage", {"frequency": 57.1, "damping": 0.03, "Ia": 0.004}, 2),
    ],
)
def test_a_light_vibration_is_fitted_to_the_end(name, values, seed):
    """From the best point of the grid alone the fit ends beside it, with too much damping."""
    problem = prepare(simulate_trial({name: values}, seed=seed, duration=30.0))
    rows = problem.fitter.rows
    null = Null.of(problem.noise, rows.time, rows.used)
    candidates = Candidates(problem.fitter, null, Grids([name], 30.0), lambda _: None)
    (trial, *_), _ = candidates.best(problem.base)
    found = trial.fit.values[name]
    assert found["frequency"] == pytest.approx(values["frequency"], rel=0.003)
    assert found["damping"] == pytest.approx(values["damping"], rel=0.1)
