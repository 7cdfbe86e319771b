"""What chance finds is known for each recording, and human variability is no mismatch."""

from dataclasses import replace

import numpy as np
import pytest

from model_discrepancy.criticism.variability import variability
from model_discrepancy.problem import prepare
from model_discrepancy.search.null import FALSE_ALARM, Null, exceeded_by_chance
from model_discrepancy.search.screening import candidates, grid, screen
from simulation_study.planted_trials import simulate_trial


def test_the_threshold_is_exceeded_as_rarely_as_it_says():
    generator = np.random.default_rng(0)
    maxima = generator.gumbel(0.02, 0.004, (400, 160))
    exceeded = np.mean([row[0] > exceeded_by_chance(row[1:]) for row in maxima])
    assert exceeded < 4.0 * FALSE_ALARM


def test_surrogates_keep_size_and_place_and_lose_what_repeats():
    time = np.arange(12_000) / 200.0
    burst = np.where((time % 1.0) < 0.2, 1.0, 0.0)
    null = Null.of(burst, time, np.ones(len(time), bool))
    np.testing.assert_array_equal(np.abs(null.noise), np.abs(burst)[:, None] * np.ones(160))
    null.observe(burst[:, None] / np.linalg.norm(burst))
    assert null.largest.max() < 0.3
    assert null.threshold > np.median(null.largest)


@pytest.fixture(scope="module")
def steady():
    return simulate_trial({}, seed=21, duration=40.0, protocol="equal")


def test_the_library_gains_less_on_a_clean_recording_than_by_chance(steady):
    problem = prepare(steady)
    rows = problem.fitter.rows
    null = Null.of(problem.noise, rows.time, rows.used)
    points = {name: grid(name, problem.recording.duration) for name in candidates(problem.base)}
    best = screen(problem.fitter, problem.base, points, null)[0]
    assert 0.0 < null.threshold < 0.1
    assert best.share < null.threshold


def test_a_reflex_that_varies_is_measured_and_is_usual(steady):
    problem = prepare(steady)
    fitter, base = problem.fitter, problem.base
    generator = np.random.default_rng(4)
    reflex = base.values["reflex"]["G"] * fitter.columns.spectra(base.values)["reflex", "G"]
    rate = fitter.motion.rate
    torque = fitter.rows.torque(reflex)
    scale = np.repeat(1.0 + 0.25 * generator.standard_normal(200), int(0.6 * rate))[: len(torque)]
    step = round(steady.rate / rate)
    added = np.repeat(torque * (scale - 1.0), step)[: len(steady.torque)]
    varied = prepare(replace(steady, torque=steady.torque + added))
    found = variability(varied.fitter, varied.base)
    assert found.reflex is not None
    assert 0.12 < found.reflex[0] < 0.4
    assert found.unusual == []
    still = variability(fitter, base)
    assert still.reflex is None or still.reflex[0] < 0.1
