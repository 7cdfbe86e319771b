"""The trend of a conditioning course: found where there is one, seldom where there is none."""

import math
from dataclasses import replace

import numpy as np
import pytest
from course_files import written

from biofeedback.session.course import CONDITIONED, CONTROL, DOWN, load_course
from biofeedback.session.course_record import SessionResult, new_record
from biofeedback.session.course_trend import comparisons, error_rate, trend
from biofeedback.session.simulated_learner import Learner, SimulatedLearner, run_course


def course_of(name, change, seed):
    course = load_course(name)
    record = new_record(course, "S01")
    run_course(course, record, SimulatedLearner(Learner(change), course, seed))
    assert len(record.results) == 30
    return record, course


def test_thirty_sessions_of_a_subject_who_learns():
    """2 % a session over 24 sessions: about 62 % of the baseline in the middle of the last six."""
    record, course = course_of("down_training", 0.02, seed=5)
    found = trend(record, course)
    assert found.found == DOWN
    expected = 100.0 * 0.98**21
    assert found.lower - 5.0 < expected < found.upper + 5.0
    assert trend(record, course, CONTROL).found == DOWN
    # The criterion follows, so that success stays in reach.
    rates = [r.success_rate for r in record.results[course.baseline_sessions :]]
    assert np.mean(rates) == pytest.approx(course.success_rate, abs=0.06)


def test_thirty_sessions_of_a_subject_who_does_not_learn():
    record, course = course_of("down_training", 0.0, seed=6)
    found = trend(record, course)
    assert found.found == "none"
    assert found.lower < 100.0 < found.upper
    assert found.upper - found.lower < 50.0


@pytest.mark.slow
def test_up_training_goes_up():
    record, course = course_of("up_training", 0.02, seed=7)
    assert trend(record, course).found == "up"


def record_of(course, logs):
    """The record of a subject with these logarithms of the reflex, one for each session."""
    record = new_record(course, "S01")
    record.results = [
        SessionResult(n, "2026-01-01", 225, 225, size, size, 0.5)
        for n, size in enumerate(np.exp(logs).tolist(), 1)
    ]
    return record


def wandering(course, correlation, random):
    """Logarithms of a reflex that nobody trains: each session resembles the one before."""
    logs = random.normal(0.0, 0.08, course.sessions)
    for n in range(1, course.sessions):
        logs[n] = correlation * logs[n - 1] + math.sqrt(1.0 - correlation**2) * logs[n]
    return logs


def states_a_trend(course, logs):
    """Whether any of the comparisons that are made during a course states a trend."""
    return any(
        trend(record_of(course, logs[:end]), course).found != "none" for end in comparisons(course)
    )


@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_at_most_one_of_twenty_courses_without_a_change_ever_shows_a_trend(correlation):
    """Three of 60 subjects may show one; at a rate of 5 % more than 7 do in one of 80 studies."""
    course, random = load_course("down_training"), np.random.default_rng(11)
    logs = [wandering(course, correlation, random) for _ in range(60)]
    assert sum(states_a_trend(course, one) for one in logs) <= 7


def test_learning_is_found_in_spite_of_correlated_sessions():
    course, random = load_course("down_training"), np.random.default_rng(12)
    learnt = math.log(0.98) * np.maximum(np.arange(1, 31) - course.baseline_sessions, 0)
    records = [record_of(course, wandering(course, 0.4, random) + learnt) for _ in range(20)]
    assert sum(trend(record, course).found == DOWN for record in records) >= 17


def test_a_course_is_compared_at_fixed_sessions_that_share_one_error_rate(tmp_path):
    course = load_course("down_training")
    assert comparisons(course) == [12, 18, 24, 30]
    rates = [error_rate(course, end) for end in comparisons(course)]
    assert sum(rates) == pytest.approx(0.03)
    assert rates[-1] == max(rates)
    record = record_of(course, np.sin(np.arange(30.0)))
    assert trend(replace(record, results=record.results[:11]), course) is None
    early = trend(replace(record, results=record.results[:17]), course)
    assert (early.compared, early.final) == ((7, 12), False)
    assert early.level > trend(record, course).level
    short = load_course(written(tmp_path, baseline_sessions=2, conditioning_sessions=3))
    assert comparisons(short) == [5]


def test_equal_reflexes_in_every_session_are_no_change():
    course = load_course("down_training")
    found = trend(record_of(course, np.zeros(30)), course)
    assert (found.found, found.percent) == ("none", pytest.approx(100.0))


def test_a_session_broken_off_early_is_left_out_of_the_trend(tmp_path):
    course = load_course(written(tmp_path, baseline_sessions=3, conditioning_sessions=3))
    record = new_record(course, "S02")
    run_course(course, record, SimulatedLearner(Learner(0.0), course, seed=2))
    whole = trend(record, course)
    assert whole.sessions == (3, 3)
    record.results[-1] = replace(record.results[-1], trials=5, conditioned=1e-9)
    assert trend(record, course).sessions == (2, 3)
    assert trend(record, course, CONDITIONED).percent == pytest.approx(whole.percent, rel=0.2)
