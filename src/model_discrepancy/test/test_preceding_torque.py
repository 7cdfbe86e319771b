"""What the muscles held before a movement holds nothing of the response to it."""

from dataclasses import replace

import numpy as np
import pytest

from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.held_torque import BESIDE_GUARD_S, BESIDE_WINDOW_S, torque_beside
from model_discrepancy.fit.movements import find_onsets
from model_discrepancy.fit.preceding_torque import (
    GUARD_S,
    MIN_MOVEMENTS,
    RESTLESS_WINDOW_S,
    SHORTEST_REST_S,
    preceding_torque,
)
from model_discrepancy.fit.response_sizes import single_responses, without_response_sizes
from model_discrepancy.fit.rows import Rows
from model_discrepancy.problem import prepare
from model_discrepancy.recording.motion import motion_of
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import with_term
from model_discrepancy.search.trials import RESTLESS_FACTOR, judged, preceding_gain, refitted
from simulation_study.planted_trials import simulate_trial
from simulation_study.verdict_cases import Plan, made, plans

REFLEX = {"G": 6.0, "delay": 0.04, "omega": 20.0, "z": 0.9}


@pytest.fixture(scope="module")
def columns():
    recording = simulate_trial({}, seed=3, duration=25.0, rate=1024.0, protocol="equal")
    fitter = Fitter.of(motion_of(recording))
    return fitter.columns


def test_torque_during_a_movement_does_not_count_before_the_next_one(columns):
    motion = columns.motion
    onsets = np.round(find_onsets(columns).time * motion.rate).astype(int)
    assert len(onsets) > MIN_MOVEMENTS
    steady = np.full(len(motion.time), 1.5)
    held = preceding_torque(columns, steady)
    assert held[onsets[0] + 5 :] == pytest.approx(1.5 + motion.torque.mean())
    # A response that begins 20 ms after one onset and ends before the next one's window.
    response = np.zeros(len(steady))
    response[onsets[7] + 10 : onsets[7] + 60] = 4.0
    held = preceding_torque(columns, steady + response)
    assert held[onsets[7] : onsets[8]] == pytest.approx(1.5 + motion.torque.mean())


def test_a_continuous_movement_has_nothing_before_it(columns):
    swinging = replace(columns.motion, velocity=np.sin(20.0 * columns.motion.time))
    assert preceding_torque(Columns(swinging, columns.rows), np.zeros(len(swinging.time))) is None


@pytest.fixture(scope="module")
def hurried(columns):
    """Return the columns of the same movements in half the time."""
    motion = columns.motion
    half = {n: getattr(motion, n)[::2] for n in ("position", "velocity", "torque")}
    return Columns(replace(motion, **half), Rows(len(half["torque"]), motion.rate))


def test_where_movements_follow_each_other_fast_a_longer_time_before_them_counts(hurried):
    motion = hurried.motion
    onsets = np.round(find_onsets(hurried).time * motion.rate).astype(int)
    assert np.median(np.diff(onsets)) < SHORTEST_REST_S * motion.rate
    after = slice(onsets[9] + 1, onsets[10])
    torque = np.zeros(len(motion.time))
    earliest = onsets[9] - round((RESTLESS_WINDOW_S + GUARD_S) * motion.rate) - 1
    torque[earliest : onsets[9]] = 4.0
    assert preceding_torque(hurried, torque)[after] == pytest.approx(motion.torque.mean() + 4.0)


def test_sizes_of_responses_that_overlap_are_told_from_slow_torque(hurried):
    motion, values = hurried.motion, {"reflex": REFLEX}
    responses = single_responses(hurried, values)
    sizes = np.random.default_rng(1).normal(0.0, 0.3, len(responses))
    slow = np.sin(2.0 * np.pi * 0.4 * motion.time)
    left = slow.copy()
    for size, (first, response) in zip(sizes, responses, strict=True):
        left[first : first + len(response)] += size * response[: len(left) - first]
    steady = without_response_sizes(hurried, values, left)
    assert np.std(steady - slow) < 0.4 * np.std(left - slow)
    # A model without a reflex has no responses, nor has a movement that never begins.
    assert without_response_sizes(hurried, {}, left) is left
    swinging = replace(motion, velocity=np.sin(20.0 * motion.time))
    assert without_response_sizes(Columns(swinging, hurried.rows), values, left) is left


def test_the_response_of_one_movement_is_that_of_the_reflex_term(columns):
    motion = columns.motion
    whole = np.zeros(len(motion.time))
    for first, response in single_responses(columns, {"reflex": REFLEX}):
        whole[first : first + len(response)] += response[: len(whole) - first]
    term = columns.spectra({"reflex": REFLEX})["reflex", "G"] * REFLEX["G"]
    expected = columns.rows.torque(term)
    used = slice(round(motion.rate), -round(motion.rate))
    gap = (whole - whole.mean() - expected + expected.mean())[used]
    assert np.std(gap) < 0.1 * np.std(expected[used])


@pytest.mark.slow
def test_a_reflex_that_varies_does_not_follow_torque():
    """The independent rig without a mismatch: slow torque holds a part of each response."""
    *_, plan = plans({"null": 12}, 555)
    trial = _followed(made(plan).recording)
    assert trial.gain > 2.0 * trial.by_chance
    assert not trial.exceeds_chance


def test_a_reflex_that_follows_torque_exceeds_chance():
    recording = simulate_trial({"activation_reflex_gain": {"Gn": 4.0}}, seed=12, duration=40.0)
    trial = _followed(recording)
    assert trial.preceding_gain > 0.2 * trial.gain
    assert trial.exceeds_chance


@pytest.mark.parametrize(
    ("hidden", "seed", "name", "follows"),
    [
        ((), 9004, "activation_reflex_gain", False),
        pytest.param(
            ("stiffness_follows_torque",),
            9002,
            "activation_stiffness",
            True,
            marks=pytest.mark.slow,
        ),
    ],
)
def test_without_rest_between_movements_too_only_what_follows_torque_exceeds_chance(
    hidden, seed, name, follows
):
    """The independent rig with a binary sequence, and a reflex that varies."""
    kind = "effect" if hidden else "null"
    conditions = dict(velocity=False, reference=False, noise="quiet", variability="large")
    plan = Plan(kind, 0, seed, hidden, "stiff", "binary", 1000.0, **conditions)
    trial = _followed(made(plan).recording, name)
    assert trial.gain > trial.by_chance
    assert trial.exceeds_chance == follows


def test_what_is_held_beside_a_moment_holds_nothing_of_that_moment():
    rate, count = 500.0, 5000
    far, near = ((BESIDE_GUARD_S + BESIDE_WINDOW_S) * rate, BESIDE_GUARD_S * rate)
    pulse = np.zeros(count)
    pulse[2500] = 1.0
    beside = torque_beside(rate, pulse, np.ones(count))
    away = np.abs(np.flatnonzero(beside > 1e-9) - 2500)
    assert near <= away.min() + 1
    assert away.max() <= far + 1
    assert torque_beside(rate, np.full(count, 3.0), np.full(count, 2.0)) == pytest.approx(1.5)


@pytest.mark.parametrize(
    ("hidden", "number", "follows"),
    [pytest.param((), 64, False, marks=pytest.mark.slow), (("reflex_follows_torque",), 0, True)],
)
def test_of_a_continuous_movement_only_a_reflex_that_follows_torque_exceeds_chance(
    hidden, number, follows
):
    """The independent rig with a sum of sines, and a reflex that varies."""
    conditions = dict(velocity=True, reference=True, noise="quiet", variability="large")
    plan = Plan("effect", number, 68435725, hidden, "stiff", "multisine", 1000.0, **conditions)
    recording = made(plan).recording
    assert prepare(recording).fitter.motion.continuous
    assert _followed(recording).exceeds_chance == follows


def test_what_a_term_gains_without_rest_between_movements_counts_less():
    recording = simulate_trial({"activation_reflex_gain": {"Gn": 4.0}}, seed=12, duration=40.0)
    fitter, trial = prepare(recording).fitter, _followed(recording)
    restless = fitter.along(replace(fitter.motion, restless=True))
    assert preceding_gain(restless, trial) == pytest.approx(trial.preceding_gain / RESTLESS_FACTOR)


def _followed(recording, name="activation_reflex_gain"):
    problem = prepare(recording)
    fitter, base = problem.fitter, problem.base
    start = fitter.start_values(with_term(base.terms, name), base.values)
    trial = refitted(fitter, base, name, start)
    null = Null.of(problem.noise, fitter.rows.time, fitter.rows.used)
    return judged(fitter, base, trial, null.threshold(name))
