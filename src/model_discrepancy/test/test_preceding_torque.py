"""What the muscles held before a movement holds nothing of the response to it."""

from dataclasses import replace

import numpy as np
import pytest

from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.movements import find_onsets
from model_discrepancy.fit.preceding_torque import (
    MIN_MOVEMENTS,
    begins_from_rest,
    preceding_torque,
)
from model_discrepancy.problem import prepare
from model_discrepancy.recording.motion import motion_of
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import with_term
from model_discrepancy.search.trials import judged, refitted
from simulation_study.planted_trials import simulate_trial
from simulation_study.verdict_cases import made, plans


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


@pytest.mark.slow
def test_movements_that_follow_each_other_fast_do_not_begin_from_rest(columns):
    assert begins_from_rest(columns)
    motion = columns.motion
    # The same movements in half the time.
    hurried = replace(motion, **{n: getattr(motion, n)[::2] for n in ("position", "velocity")})
    assert not begins_from_rest(Columns(hurried, columns.rows))


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


def _followed(recording):
    problem = prepare(recording)
    fitter, base = problem.fitter, problem.base
    name = "activation_reflex_gain"
    start = fitter.start_values(with_term(base.terms, name), base.values)
    trial = refitted(fitter, base, name, start)
    null = Null.of(problem.noise, fitter.rows.time, fitter.rows.used)
    return judged(fitter, base, trial, null.threshold(name))
