"""What belongs to the subject is found anew beside the rig and each kind of straps."""

from types import SimpleNamespace

import numpy as np
import pytest

from model_discrepancy.problem import prepare
from model_discrepancy.search import subject_anew as stage
from model_discrepancy.search import term_search
from model_discrepancy.search.found import Effect, Found, Trial, is_usual
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.harm import LEAST_HARM, predicts_worse
from model_discrepancy.search.hypotheses import Hypotheses
from model_discrepancy.search.null import Null
from model_discrepancy.search.screening import with_term
from model_discrepancy.search.subject_anew import subject_anew
from model_discrepancy.search.term_search import choose_anew
from simulation_study.planted_trials import simulate_trial

STRAPS = {"fixation_compliance": {"k_s": 900.0, "b_s": 3.0}}
MODE = {"torque_sensor_mode": {"frequency": 45.0, "damping": 0.2}}
MEMORY = {"maxwell_relaxation": {"k": 30.0, "T": 0.05}}
SKEW = {"channel_skew": {"skew": 0.002}}
ALLOWED = [*STRAPS, *MODE, *MEMORY, *SKEW]
SECONDS = 20.0


@pytest.fixture(scope="module")
def searched():
    """Return a recording with straps, relaxation and a skew, ready for a search."""
    planted = STRAPS | MEMORY | SKEW
    recording = simulate_trial(planted, seed=4, duration=SECONDS, protocol="random")
    problem = prepare(recording)
    rows = problem.fitter.rows
    null = Null.of(problem.noise, rows.time, rows.used)
    null.gains = {name: np.full(160, 0.002) for name in ALLOWED}
    return problem, null


def hypotheses_of(problem, null, grids):
    """Return what follows hypotheses about the recording."""
    gain = problem.fitter.rows.gain()
    return Hypotheses(problem.fitter, problem.base, null, grids, gain, print)


def found_with(problem, terms):
    """Return what a search would have found that ended with these terms."""
    start = {**problem.base.values, **terms}
    names = problem.base.terms
    for name in terms:
        names = with_term(names, name)
    final = problem.fitter.fit(names, start, evaluations=60)
    effects = [Effect(Trial(name, final, 0.5, (0.5, 0.5), -100.0), np.zeros(2)) for name in terms]
    return Found(problem.base, final, effects)


def names_of(hypothesis):
    """Return the names of a hypothesis' effects."""
    return [effect.trial.name for effect in hypothesis.found.effects]


def test_all_of_the_subject_is_found_where_a_mode_of_the_sensor_stood_for_the_straps(searched):
    problem, null = searched
    found, grids = found_with(problem, MODE | SKEW), Grids(ALLOWED, SECONDS)
    other = subject_anew(hypotheses_of(problem, null, grids), problem.fitter, found, grids, print)
    # The straps take the first place of what was found of the subject.
    assert names_of(other)[:2] == [*STRAPS, *SKEW]
    assert set(MEMORY) <= set(names_of(other))
    assert other.current.values["fixation_compliance"]["k_s"] == pytest.approx(900.0, rel=0.1)
    assert other.current.values["channel_skew"]["skew"] == pytest.approx(0.002, rel=0.1)
    assert other.current.score < 0.9 * found.final.score
    # Each effect is measured beside those before it, whatever was left before.
    errors = [effect.errors for effect in other.found.effects]
    assert np.all(np.diff(errors, axis=0)[:, 0] < 0.0)


def test_what_is_right_is_not_found_a_second_time(searched):
    problem, null = searched
    found, grids = found_with(problem, SKEW | STRAPS | MEMORY), Grids(ALLOWED, SECONDS)
    begun = hypotheses_of(problem, null, grids)
    assert subject_anew(begun, problem.fitter, found, grids, print) is None


def test_what_belongs_to_the_rig_alone_is_left_as_it_is(searched, monkeypatch):
    problem, null = searched
    monkeypatch.setattr(stage, "begun_anew", lambda *_: pytest.fail("straps were begun"))
    found, grids = found_with(problem, SKEW), Grids(ALLOWED, SECONDS)
    begun = hypotheses_of(problem, null, grids)
    assert subject_anew(begun, problem.fitter, found, grids, print) is None


def test_straps_that_are_behind_from_the_first_are_not_followed(searched, monkeypatch):
    problem, _ = searched
    scores = {"fixation_compliance": 106.0, "fixation_stops": 104.0, "stiffening_fixation": 100.0}
    followed = []
    monkeypatch.setattr(
        stage,
        "begun_anew",
        lambda fitter, bare, name, *_: Trial(
            name, SimpleNamespace(score=scores[name]), 0.5, (0.5, 0.5), -100.0
        ),
    )
    monkeypatch.setattr(stage, "_in_order", lambda *_: [])
    monkeypatch.setattr(stage, "in_parallel", lambda function, items: [*map(function, items)])
    hypotheses = SimpleNamespace(
        followed=lambda begun, alone: followed.append(alone) or SimpleNamespace(plausible=False)
    )
    grids = Grids([*ALLOWED, *scores], SECONDS)
    found = found_with(problem, MODE | SKEW)
    assert subject_anew(hypotheses, problem.fitter, found, grids, print) is None
    assert sorted(followed) == ["fixation_stops", "stiffening_fixation"]


def test_only_straps_that_may_be_named_are_begun(searched):
    problem, null = searched
    grids = Grids([*MODE, *MEMORY, *SKEW], SECONDS)
    begun = hypotheses_of(problem, null, grids)
    said = []
    found = found_with(problem, MODE | SKEW)
    assert subject_anew(begun, problem.fitter, found, grids, said.append) is None
    assert not said


@pytest.mark.parametrize("worse", [False, True])
def test_the_end_decides_whether_the_subject_was_found_better(searched, monkeypatch, worse):
    problem, null = searched
    found = found_with(problem, MODE | SKEW)
    term_search._score_both(problem.fitter, found, Grids(ALLOWED, SECONDS), null, print)
    monkeypatch.setattr(term_search, "predicts_worse", lambda *_: worse)
    monkeypatch.setattr(term_search, "chosen_anew", lambda *_: None)
    monkeypatch.setattr(term_search, "SHORTEST_COMPLETED_S", 0.9 * SECONDS)
    new = choose_anew(problem.fitter, found, null, ALLOWED)
    assert (new is found) == worse
    if not worse:
        assert set(STRAPS) <= set(new.final.terms)
        assert new.final_held_out.vaf > found.final_held_out.vaf


def test_a_short_recording_does_not_tell_what_of_the_subject_is_anew(searched, monkeypatch):
    problem, null = searched
    monkeypatch.setattr(term_search, "subject_anew", lambda *_: pytest.fail("it was found anew"))
    monkeypatch.setattr(term_search, "chosen_anew", lambda *_: None)
    found = found_with(problem, MODE | SKEW)
    assert choose_anew(problem.fitter, found, null, ALLOWED) is found


@pytest.mark.parametrize(
    ("score", "left", "worse"),
    [(90.0, 2.0 * LEAST_HARM + 0.01, False), (90.0, 2.3, True), (100.0, 2.2, True)],
)
def test_a_model_may_leave_more_plain_torque_by_as_much_as_it_fits_better(score, left, worse):
    now, other = (SimpleNamespace(score=s) for s in (100.0, score))
    assert predicts_worse(now, 98.0, other, 100.0 - left) == worse


def test_what_holds_a_usual_special_case_is_usual():
    assert is_usual("fixation_compliance")
    assert is_usual("stiffening_fixation")
    assert not is_usual("torque_sensor_mode")
