"""The course of the stiffness follows from all pieces of a recording but the one that it is for."""

from dataclasses import replace

import numpy as np
import pytest

from model_discrepancy.diagnose import diagnose
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.stiffness_course import (
    COCONTRACTION,
    PIECE_S,
    better_course,
    predicted,
    stiffness_course,
)
from model_discrepancy.problem import BETTER_COURSE, prepare, with_better_course
from model_discrepancy.recording.motion import Motion
from model_discrepancy.report.fitted_model import fitted_model
from model_discrepancy.tools.resimulation import resimulate
from simulation_study.planted_trials import INTERNAL_RATE, contraction, simulate_trial

SEED, DURATION_S, RATE = 11, 60.0, 1024.0
PLANTED = {COCONTRACTION: {"kc": 25.0}}
RIVALS = (
    COCONTRACTION,
    "stiffness_drift",
    "settling_stiffness",
    "activation_stiffness",
    "position_dependent_stiffness",
)


@pytest.fixture(scope="module")
def recording():
    return simulate_trial(PLANTED, seed=SEED, duration=DURATION_S, rate=RATE)


@pytest.fixture(scope="module")
def problem(recording):
    return prepare(recording)


def own(motion: Motion) -> np.ndarray:
    """Return the course that was planted, at the model's rate."""
    fine = np.arange(int(DURATION_S * INTERNAL_RATE)) / INTERNAL_RATE
    return np.interp(motion.time, fine, contraction(SEED, fine))


def observed(change: np.ndarray, random: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Return what pieces show of a change in noise, and the power of their regressors."""
    power = random.uniform(0.2, 2.0, len(change))
    return power * change + np.sqrt(power) * random.standard_normal(len(change)), power


def process(count: int, correlation_s: float, random: np.random.Generator) -> np.ndarray:
    step = np.exp(-PIECE_S / correlation_s)
    course = np.zeros(count)
    for k in range(1, count):
        course[k] = step * course[k - 1] + np.sqrt(1.0 - step**2) * random.standard_normal()
    return course


def test_the_course_of_a_piece_follows_from_the_others():
    random = np.random.default_rng(1)
    change = process(400, 3.0, random)
    told = predicted(*observed(change, random), 1.0)
    assert np.corrcoef(told, change)[0, 1] > 0.7


def test_what_a_piece_and_its_neighbours_show_has_no_part_in_its_own_course():
    random = np.random.default_rng(2)
    shown, power = observed(process(400, 3.0, random), random)
    other = shown.copy()
    other[200] += 0.05
    moved = np.abs(predicted(other, power, 1.0) - predicted(shown, power, 1.0))
    # What is left is that spread and time of the process follow from all pieces.
    assert max(moved[199:202]) < 0.02 * min(moved[[198, 202]])


def test_a_constant_stiffness_has_no_course_that_explains_anything():
    gains = []
    for seed in range(8):
        random = np.random.default_rng(seed)
        shown, power = observed(np.zeros(400), random)
        told = predicted(shown, power, 1.0)
        gains.append(float(told @ shown) / np.sqrt(float(told**2 @ power)))
    # Each is a standard normal number: with a part of its own noise it would be large.
    assert np.mean(gains) < 1.5


def test_the_course_of_a_contraction_is_found(problem):
    found = problem.fitter.motion.cocontraction
    assert np.mean(found) == pytest.approx(0.0, abs=1e-9)
    assert np.mean(found**2) == pytest.approx(1.0)
    assert np.corrcoef(found, own(problem.fitter.motion))[0, 1] > 0.7


def test_a_better_course_is_known_beside_a_better_model(problem):
    """A course that is another one's gains little; the search begins again with the right one."""
    shuffled = problem.fitter.motion.cocontraction[::-1].copy()
    wrong = problem.fitter.along(replace(problem.fitter.motion, cocontraction=shuffled))
    assert better_course(wrong, problem.base)[1] > BETTER_COURSE
    again = with_better_course(replace(problem, fitter=wrong), problem.base)
    assert again is not None
    assert np.corrcoef(again.fitter.motion.cocontraction, own(wrong.motion))[0, 1] > 0.7
    assert better_course(problem.fitter, problem.base)[1] < BETTER_COURSE


@pytest.mark.parametrize("by_emg", [True, False])
def test_a_better_course_does_not_let_emg_predict_its_own_response(problem, by_emg):
    """A reflex that varies shows in the EMG of its response; no regressors follow it there."""
    motion = problem.fitter.motion
    shuffled = motion.cocontraction[::-1].copy()
    wrong = problem.fitter.along(
        replace(motion, cocontraction=shuffled, preceding=motion.activation)
    )
    before = replace(problem, fitter=wrong, activation_by_emg=by_emg, bank_over_torque=None)
    again = with_better_course(before, problem.base)
    assert again is not None
    assert (again.bank_over_torque is None) == by_emg


def test_a_model_without_stiffness_has_no_course(problem):
    bare = problem.fitter.fit(["inertia", "viscosity"])
    assert stiffness_course(problem.fitter, bare) is None
    assert better_course(problem.fitter, bare) == (None, 0.0)


def test_a_recording_that_is_short_has_no_course():
    short = simulate_trial({}, seed=1, duration=7.0, rate=RATE)
    fitter = Fitter.of(prepare(short).fitter.motion)
    base = fitter.fit(["inertia", "viscosity", "stiffness"])
    assert stiffness_course(fitter, base) is None


@pytest.mark.parametrize("library", [RIVALS, pytest.param(None, marks=pytest.mark.slow)])
@pytest.mark.parametrize("planted", [PLANTED, pytest.param({}, marks=pytest.mark.slow)])
def test_a_contraction_is_named_where_there_is_one(planted, library, tmp_path):
    """K is the mean over the recording, and the simulation makes more of the torque with it."""
    recording = simulate_trial(planted, seed=SEED, duration=DURATION_S, rate=RATE)
    diagnosis = diagnose(recording, out=tmp_path, library=library)
    drawn = "The stiffness in the course of the recording" in (tmp_path / "report.html").read_text()
    assert drawn == bool(planted)
    names = [effect.trial.name for effect in diagnosis.found.effects]
    assert names == list(planted)
    if planted:
        values = diagnosis.found.final.values
        # What is known of the course changes less than the whole.
        assert 15.0 < values[COCONTRACTION]["kc"] < 25.0
        base, augmented = (
            fitted_model(fit, "found") for fit in (diagnosis.found.base, diagnosis.found.final)
        )
        vaf = resimulate(recording, base, augmented).vaf
        assert vaf["augmented"] > vaf["base"] + 0.5
