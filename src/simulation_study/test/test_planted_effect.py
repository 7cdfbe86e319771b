"""An effect that is planted in a recording has a magnitude of its own, and the torque of it."""

import math
from dataclasses import replace

import numpy as np
import pytest

from ankle_physics.term import term_library
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.parallel import side_by_side
from model_discrepancy.recording.motion import motion_of
from simulation_study.planted_effect import MeasuredTrial, reaching
from simulation_study.planted_in_human import (
    MAGNITUDES,
    magnitudes,
    plant,
    term_values,
)
from simulation_study.planted_trials import simulate_trial

SECONDS = 20.0


@pytest.fixture(scope="module", autouse=True)
def few_threads():
    """Run the linear algebra without threads of its own, as the study does."""
    with side_by_side():
        yield


@pytest.fixture(scope="module")
def recording():
    """Return a trial in which nothing is planted."""
    return simulate_trial({}, seed=4, duration=SECONDS, rate=1024.0, velocity=False)


@pytest.mark.parametrize(("weak", "strong"), [(0.01, 10.0), (1e4, 1.0), (-0.01, -10.0)])
def test_the_first_magnitude_of_enough_strength_is_taken(weak, strong):
    wanted = math.copysign(math.sqrt(abs(weak * strong)), weak)
    sign = 1.0 if abs(strong) > abs(weak) else -1.0
    found = reaching(lambda m: abs(m / wanted) ** sign, weak, strong)
    assert found == pytest.approx(wanted, rel=0.03)


def test_an_effect_that_hides_again_is_taken_before_its_peak():
    found = reaching(lambda m: 2.0 * m * math.exp(1.0 - m), 0.01, 100.0)
    assert found < 1.0
    assert 2.0 * found * math.exp(1.0 - found) == pytest.approx(1.0, rel=0.05)


def test_the_magnitude_of_most_strength_is_taken_where_none_is_enough():
    assert reaching(lambda m: 0.1 * m, 0.01, 2.0) == pytest.approx(2.0)
    peaked = reaching(lambda m: 0.5 * m * math.exp(1.0 - m), 0.01, 100.0)
    assert peaked == pytest.approx(1.0, rel=1.0)


def test_no_magnitude_is_beyond_its_bounds():
    seen = []
    reaching(lambda m: seen.append(m) or m / 0.0019999, 1e-5, 0.002)
    assert max(seen) <= 0.002


def test_every_term_has_magnitudes_within_its_range():
    library = term_library()
    for name, term in library.items():
        if not term.searched or not (
            name in MAGNITUDES or any(p.linear and p.fitted for p in term.parameters)
        ):
            continue
        for magnitude in magnitudes(name):
            for symbol, value in term_values(name, magnitude).items():
                parameter = term.parameter(symbol)
                span = 1e-9 * (parameter.upper - parameter.lower)
                assert parameter.lower - span <= value <= parameter.upper + span, (name, symbol)


def _left(fit: Fit) -> float:
    """Return the rms of what a model leaves [N.m]."""
    return float(np.std(fit.plain[fit.rows.used]))


def test_what_is_planted_is_the_term_itself_and_no_multiple_of_it(recording):
    planted = plant(recording, "reflex_threshold")
    motion = motion_of(planted.recording)
    fitter = Fitter.of(motion)
    base = MeasuredTrial(planted.recording).base
    found = fitter.fit(
        (*base.terms, "reflex_threshold"),
        {**base.values, "reflex_threshold": {"vt": 0.5 * planted.magnitude}},
        evaluations=40,
    )
    assert found.values["reflex_threshold"]["vt"] == pytest.approx(planted.magnitude, rel=0.25)
    left = _left(found)
    assert left < 1.05 * _left(MeasuredTrial(recording).base)
    assert _left(base) > 1.05 * left


@pytest.mark.slow
def test_a_reflex_that_is_changed_keeps_its_size(recording):
    planted = plant(recording, "reflex_threshold").recording
    before, after = (MeasuredTrial(one).base.values["reflex"]["G"] for one in (recording, planted))
    assert after == pytest.approx(before, rel=0.4)


@pytest.mark.slow
def test_a_term_that_hardly_shows_is_planted_no_larger_than_its_bound(recording):
    measured = MeasuredTrial(recording)
    gentle = 1e-3 * np.sign(measured.motion.velocity)
    planted = measured.planted("gentle", lambda m: m * gentle, 0.1, 2.0)
    assert planted.magnitude == pytest.approx(2.0)
    assert planted.share < 1e-4


def test_slow_torque_is_no_strength(recording):
    measured = MeasuredTrial(recording)
    time = measured.motion.time
    slow, fast = (np.sin(2.0 * np.pi * hz * time) for hz in (0.2, 6.3))
    assert measured.unseen(slow) < 0.02
    assert measured.unseen(fast) == pytest.approx(math.sqrt(0.5), rel=0.1)


@pytest.mark.slow
def test_a_rhythm_of_stiffness_acts_about_the_angle_at_which_the_trial_was_recorded(recording):
    away = replace(recording, position=recording.position + 0.15)
    here, there = (plant(one, "cyclic_stiffness") for one in (recording, away))
    assert there.magnitude == pytest.approx(here.magnitude, rel=0.02)
    added = [p.recording.torque - recording.torque for p in (here, there)]
    assert added[1] == pytest.approx(added[0], abs=0.05 * np.std(added[0]))


def test_an_effect_without_torque_is_refused(recording):
    measured = MeasuredTrial(recording)
    nothing = np.zeros(len(measured.motion.time))
    with pytest.raises(DiagnosisError, match="nothing changes no torque"):
        measured.planted("nothing", lambda _: nothing, 0.1, 1.0)
