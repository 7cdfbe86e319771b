"""What chance finds is known for each recording, and human variability is no mismatch."""

from dataclasses import replace

import numpy as np
import pytest

from model_discrepancy.criticism.variability import variability
from model_discrepancy.problem import prepare
from model_discrepancy.search.acting_stretches import FEWEST_STRETCHES, acting_in
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
    other = burst * np.random.default_rng(1).standard_normal(12_000)
    null.observe("other", other[:, None] / np.linalg.norm(other))
    assert null.gains["other"].max() < 0.3
    assert null.threshold("other") > np.median(null.gains["other"])


def test_an_effect_in_the_noise_does_not_raise_its_own_threshold():
    generator = np.random.default_rng(2)
    time = np.arange(12_000) / 200.0
    # Large in a few stretches only, as torque that follows activation is.
    column = generator.standard_normal(12_000) * (np.sin(0.3 * time) > 0.8)
    span = column[:, None] / np.linalg.norm(column)
    noise = generator.standard_normal(12_000)
    effect = 60.0 * span[:, 0]

    def threshold(rows):
        null = Null.of(rows, time, np.ones(len(time), bool))
        null.observe("column", span)
        return null.threshold("column")

    share = float(effect @ effect) / float((noise + effect) @ (noise + effect))
    assert share > 0.2
    assert threshold(noise + effect) < 1.5 * threshold(noise) < 0.1 * share


def test_a_candidate_that_acts_in_few_stretches_must_gain_more():
    generator = np.random.default_rng(2)
    time = np.arange(12_000) / 200.0
    noise = generator.standard_normal(12_000)

    def threshold(active):
        null = Null.of(noise, time, np.ones(len(time), bool))
        column = generator.standard_normal(12_000) * active
        null.observe("column", column[:, None] / np.linalg.norm(column))
        return null.threshold("column")

    assert threshold(time < 12.0) > 1.5 * threshold(time >= 0.0)


def test_a_point_that_answers_to_single_stretches_is_no_candidate():
    generator = np.random.default_rng(2)
    time = np.arange(12_000) / 200.0
    null = Null.of(generator.standard_normal(12_000), time, np.ones(len(time), bool))
    column = generator.standard_normal(12_000) * (time < FEWEST_STRETCHES - 2.0)
    null.observe("column", column[:, None] / np.linalg.norm(column))
    assert not null.observed
    assert acting_in(time, column) == pytest.approx(FEWEST_STRETCHES - 2.0, rel=0.05)
    assert acting_in(time, np.ones(12_000)) == pytest.approx(60.0)


def test_a_candidate_that_gains_much_by_chance_does_not_hide_one_that_does_not():
    generator = np.random.default_rng(3)
    time = np.arange(12_000) / 200.0
    noise = generator.standard_normal(12_000)

    def threshold_of_one(*rivals):
        null = Null.of(noise, time, np.ones(len(time), bool))
        null.observe("one", generator.standard_normal((12_000, 1)) / np.sqrt(12_000))
        for size in rivals:
            wide = np.linalg.qr(generator.standard_normal((12_000, size)))[0]
            null.observe(f"of {size}", wide)
        return null.threshold("one"), null.threshold("of 60")

    alone = threshold_of_one()[0]
    beside, wide = threshold_of_one(60)
    assert 0.5 * alone < beside < 2.0 * alone
    assert wide > 5.0 * beside


def test_a_point_that_gains_much_by_chance_does_not_hide_another_one():
    """Only the fastest movements pass a high threshold; most of them pass a low one."""
    generator = np.random.default_rng(4)
    time = np.arange(12_000) / 200.0
    # The noise is large in the stretches in which the high threshold acts, as that of a reflex is.
    fast = time < FEWEST_STRETCHES + 4.0
    noise = generator.standard_normal(12_000) * np.where(fast, 5.0, 1.0)
    null = Null.of(noise, time, np.ones(len(time), bool))
    for threshold, active in ((0.05, time >= 0.0), (0.1, time >= 0.0), (1.6, fast)):
        column = generator.standard_normal(12_000) * active
        span = column[:, None] / np.linalg.norm(column)
        null.observe("reflex_threshold", span, {"vt": threshold})
    low, high = (null.threshold("reflex_threshold", {"vt": vt}) for vt in (0.06, 1.5))
    assert high > 2.0 * low
    assert null.threshold("reflex_threshold") == high
    # Between two points the larger threshold holds.
    assert null.threshold("reflex_threshold", {"vt": 0.5}) == high


@pytest.fixture(scope="module")
def steady():
    return simulate_trial({}, seed=21, duration=40.0, protocol="equal")


def test_the_library_gains_less_on_a_clean_recording_than_by_chance(steady):
    problem = prepare(steady)
    rows = problem.fitter.rows
    null = Null.of(problem.noise, rows.time, rows.used)
    points = {name: grid(name, problem.recording.duration) for name in candidates(problem.base)}
    best = screen(problem.fitter, problem.base, points, null)[0]
    assert 0.0 < null.threshold(best.name) < 0.1
    assert best.share < null.threshold(best.name)


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
    found = variability(varied.fitter, varied.base, varied.recording.torque)
    assert found.reflex is not None
    assert 0.12 < found.reflex[0] < 0.4
    assert found.unusual == []
    still = variability(fitter, base, steady.torque)
    assert still.reflex is None or still.reflex[0] < 0.1
