"""The search follows a second candidate that did about as well as the one that it chose."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.search import candidates, hypotheses, hypothesis, trials
from model_discrepancy.search.acting_stretches import FEWEST_STRETCHES
from model_discrepancy.search.candidates import Candidates
from model_discrepancy.search.found import DISPLACING_GAIN, Effect, Trial
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.hypotheses import MOST_FORKS, Hypotheses

# What each set of terms leaves. "relaxation" stands in for two terms, and nothing after it leads to
# the pair that leaves least.
SCORES = {
    (): 100.0,
    ("maxwell_relaxation",): 40.0,
    ("dahl_hysteresis",): 45.0,
    ("maxwell_relaxation", "tendon"): 35.0,
    ("maxwell_relaxation", "tendon", "backlash"): 33.0,
    ("dahl_hysteresis", "long_latency_reflex"): 10.0,
}


def fit_of(terms):
    return SimpleNamespace(
        terms=terms, score=SCORES[terms], size=len(terms), values={}, at_bounds=()
    )


class Scripted(Hypotheses):
    """Takes its trials from the table of scores."""

    def __init__(self):
        fitter = SimpleNamespace(rows=SimpleNamespace(independent=1000))
        grids = Grids(None, 60.0)
        super().__init__(fitter, fit_of(()), None, grids, None, lambda line: self.said.append(line))
        self.said = []
        self.steps = []

    def _step(self, hypothesis):
        current = hypothesis.current
        self.steps.append(current.terms)
        longer = [t for t in SCORES if t[:-1] == current.terms and len(t) > len(current.terms)]
        tried = [
            Trial(t[-1], fit_of(t), gain, (gain, gain), -1.0, torque_share=1.0)
            for t in longer
            for gain in [1.0 - SCORES[t] / current.score]
        ]
        return sorted(tried, key=lambda t: -t.gain), 0.0

    def _add(self, hypothesis, trial):
        hypothesis.current = trial.fit
        hypothesis.found.effects.append(Effect(trial, errors=None))
        hypothesis.scores[len(hypothesis.found.effects)] = trial.fit.score


@pytest.fixture(autouse=True)
def plain_errors(monkeypatch):
    monkeypatch.setattr(trials, "halves_errors", lambda fitter, fit, plain: (fit.score, fit.score))


def test_the_better_of_two_hypotheses_wins_whichever_term_came_first():
    best = Scripted().best()
    assert [e.trial.name for e in best.found.effects] == [
        "dahl_hysteresis",
        "long_latency_reflex",
    ]
    assert best.current.score == 10.0


def test_a_term_that_only_follows_the_torque_takes_no_place_among_the_near_misses(monkeypatch):
    refused = [
        Trial(name, None, gain, (gain, gain), 0.0, by_chance=0.01, preceding_gain=preceding)
        for name, gain, preceding in (
            ("activation_reflex_gain", 0.2, 0.0),
            ("activation_stiffness", 0.1, None),
            ("activation_reflex_gain", 0.08, 0.05),
            ("plate_appendage", 0.04, None),
        )
    ]
    scripted = Scripted()
    monkeypatch.setattr(scripted, "_step", lambda _: (refused, 0.0))
    assert scripted.best().found.near == refused[2:]


@pytest.mark.parametrize(("left", "others"), [(10.4, 1), (10.6, 0)])
def test_another_hypothesis_that_leaves_about_as_little_is_kept(monkeypatch, left, others):
    monkeypatch.setitem(SCORES, ("maxwell_relaxation", "tendon", "backlash"), left)
    best = Scripted().best()
    assert best.current.score == 10.0
    assert [fit.score for fit in best.found.other_models] == [left][:others]


def test_what_another_search_found_is_a_hypothesis_that_takes_the_place_of_the_forks(monkeypatch):
    def refitted(fitter, current, name, start):
        terms = (*current.terms, name)
        gain = 1.0 - SCORES[terms] / current.score
        return Trial(name, fit_of(terms), gain, (gain, gain), -1.0, torque_share=1.0)

    monkeypatch.setattr(hypotheses, "refitted", refitted)
    monkeypatch.setattr(hypotheses, "judged", lambda fitter, current, trial, by_chance: trial)

    def searched_after(*names):
        search = Scripted()
        search._null = SimpleNamespace(threshold_of=lambda name, fit: 0.0)
        effects = [SimpleNamespace(trial=SimpleNamespace(name=name)) for name in names]
        before = SimpleNamespace(effects=effects, refinements=[], final=SimpleNamespace(values={}))
        return search.best(before), search.said

    best, said = searched_after("dahl_hysteresis")
    assert best.current.score == 10.0
    assert not any("another hypothesis" in line for line in said)
    # A worse one is given up.
    assert searched_after("maxwell_relaxation")[0].current.score == 33.0


def test_a_search_that_never_forks_stays_with_what_it_took_first(monkeypatch):
    monkeypatch.setattr(hypotheses, "MOST_FORKS", 0)
    assert Scripted().best().current.score == 33.0
    assert MOST_FORKS > 0


def test_a_model_of_two_terms_is_left_to_the_exchange_of_rivals(monkeypatch):
    monkeypatch.delitem(SCORES, ("maxwell_relaxation", "tendon", "backlash"))
    search = Scripted()
    assert search.best().current.score == 35.0
    assert not any("hypothesis" in line for line in search.said)


def test_a_hypothesis_that_stays_behind_is_given_up(monkeypatch):
    monkeypatch.delitem(SCORES, ("dahl_hysteresis", "long_latency_reflex"))
    monkeypatch.setitem(SCORES, ("dahl_hysteresis", "tendon"), 44.0)
    monkeypatch.setitem(SCORES, ("dahl_hysteresis", "tendon", "backlash"), 1.0)
    assert Scripted().best().current.score == 33.0


def test_where_all_hypotheses_need_many_terms_the_best_one_goes_on_alone(monkeypatch):
    monkeypatch.setattr(hypotheses, "MOST_TERMS_SIDE_BY_SIDE", 3)
    ahead = ("maxwell_relaxation", "tendon", "backlash")
    behind = ("dahl_hysteresis", "long_latency_reflex", "backlash")
    monkeypatch.setitem(SCORES, behind[:2], 34.0)
    monkeypatch.setitem(SCORES, behind, 33.5)
    monkeypatch.setitem(SCORES, (*ahead, "lost_motion"), 32.0)
    monkeypatch.setitem(SCORES, (*behind, "lost_motion"), 1.0)
    search = Scripted()
    assert search.best().current.terms == (*ahead, "lost_motion")
    assert behind not in search.steps
    monkeypatch.setattr(hypotheses, "MOST_TERMS_SIDE_BY_SIDE", 4)
    search = Scripted()
    assert search.best().current.terms == (*behind, "lost_motion")


def test_the_first_hypothesis_is_given_up_where_a_fork_is_well_ahead(monkeypatch):
    first = ("maxwell_relaxation", "tendon", "backlash")
    ahead = ("dahl_hysteresis", "long_latency_reflex", "backlash")
    monkeypatch.setitem(SCORES, (*first, "lost_motion"), 32.0)
    monkeypatch.setitem(SCORES, ahead, 9.0)
    search = Scripted()
    assert search.best().current.terms == ahead
    assert first not in search.steps
    # As far as nothing is ahead, it is followed.
    monkeypatch.delitem(SCORES, ahead)
    monkeypatch.setitem(SCORES, ahead[:2], 34.5)
    search = Scripted()
    assert search.best().current.score == 32.0
    assert first in search.steps


def test_a_usual_first_term_is_given_up_where_it_is_far_behind(monkeypatch):
    monkeypatch.delitem(SCORES, ("dahl_hysteresis", "long_latency_reflex"))
    monkeypatch.setitem(SCORES, ("fixation_compliance",), 60.0)
    monkeypatch.setitem(SCORES, ("fixation_compliance", "tendon"), 53.0)
    monkeypatch.setitem(SCORES, ("fixation_compliance", "tendon", "backlash"), 1.0)
    search = Scripted()
    assert search.best().current.score == 33.0
    assert ("fixation_compliance", "tendon") not in search.steps
    monkeypatch.setitem(SCORES, ("fixation_compliance", "tendon"), 52.0)
    assert Scripted().best().current.score == 1.0


@pytest.mark.parametrize(
    ("third", "first"), [("backlash", "fixation_compliance"), ("fixation_stops", "lost_motion")]
)
def test_straps_need_not_come_first_where_the_model_holds_some(monkeypatch, third, first):
    """Stops are straps, too: an error that is smaller by 4 % decides there."""
    for terms in list(SCORES)[1:]:
        monkeypatch.delitem(SCORES, terms)
    best = ("lost_motion", "tendon", third)
    for terms, score in ((best[:1], 40.0), (best[:2], 35.0), (best, 33.0)):
        monkeypatch.setitem(SCORES, terms, score)
    usual = ("fixation_compliance", "tendon")
    monkeypatch.setitem(SCORES, usual[:1], 44.0)
    monkeypatch.setitem(SCORES, usual, 34.3)
    assert Scripted().best().found.effects[0].trial.name == first


@pytest.mark.parametrize(("alone", "names"), [(36.0, 1), (39.0, 3)])
def test_one_term_that_explains_as_much_alone_is_preferred(monkeypatch, alone, names):
    # The first choice is not the better one alone: it predicts the plain torque best.
    monkeypatch.delitem(SCORES, ("dahl_hysteresis", "long_latency_reflex"))
    monkeypatch.setitem(SCORES, ("dahl_hysteresis",), alone)
    monkeypatch.setattr(
        trials,
        "halves_errors",
        lambda fitter, fit, plain: (float("maxwell_relaxation" not in fit.terms),) * 2,
    )
    found = Scripted().best().found.effects
    assert len(found) == names
    first = "dahl_hysteresis" if names == 1 else "maxwell_relaxation"
    assert found[0].trial.name == first


def test_a_hypothesis_that_a_fork_followed_to_its_end_is_not_followed_again(monkeypatch):
    monkeypatch.setitem(SCORES, ("fixation_compliance",), 44.0)
    monkeypatch.setitem(SCORES, ("fixation_compliance", "tendon"), 34.0)
    monkeypatch.delitem(SCORES, ("dahl_hysteresis",))
    monkeypatch.delitem(SCORES, ("dahl_hysteresis", "long_latency_reflex"))
    search = Scripted()
    assert search.best().found.effects[0].trial.name == "fixation_compliance"
    assert any("what is usual: fixation_compliance" in line for line in search.said)
    assert len(search.steps) == len(set(search.steps))


@pytest.mark.parametrize(
    ("left", "first"), [(34.0, "fixation_compliance"), (36.0, "maxwell_relaxation")]
)
def test_what_every_rig_has_is_preferred_where_it_is_not_behind(monkeypatch, left, first):
    monkeypatch.delitem(SCORES, ("dahl_hysteresis", "long_latency_reflex"))
    monkeypatch.setitem(SCORES, ("fixation_compliance",), 60.0)
    monkeypatch.setitem(SCORES, ("fixation_compliance", "tendon"), left)
    assert Scripted().best().found.effects[0].trial.name == first


@pytest.mark.parametrize(
    ("left", "first"), [(35.2, "fixation_compliance"), (35.5, "maxwell_relaxation")]
)
def test_of_two_terms_straps_are_preferred_where_they_leave_about_as_little(
    monkeypatch, left, first
):
    monkeypatch.delitem(SCORES, ("dahl_hysteresis", "long_latency_reflex"))
    monkeypatch.delitem(SCORES, ("maxwell_relaxation", "tendon", "backlash"))
    monkeypatch.setitem(SCORES, ("fixation_compliance",), 60.0)
    monkeypatch.setitem(SCORES, ("fixation_compliance", "tendon"), left)
    assert Scripted().best().found.effects[0].trial.name == first


def test_a_term_alone_that_needs_as_many_others_is_not_preferred_to_straps(monkeypatch):
    """It explains as much alone at first, but a second term is worth it beside it, too."""
    for terms in list(SCORES):
        if len(terms) > 1:
            monkeypatch.delitem(SCORES, terms)
    monkeypatch.setitem(SCORES, ("maxwell_relaxation",), 36.0)
    monkeypatch.setitem(SCORES, ("maxwell_relaxation", "tendon"), 35.0)
    monkeypatch.setitem(SCORES, ("fixation_compliance",), 60.0)
    monkeypatch.setitem(SCORES, ("fixation_compliance", "tendon"), 35.2)
    found = Scripted().best().found.effects
    assert [effect.trial.name for effect in found] == ["fixation_compliance", "tendon"]


def test_a_model_that_leaves_the_joint_no_inertia_loses_to_one_that_does(monkeypatch):
    monkeypatch.setattr(hypothesis, "has_joint", lambda fit: fit.terms[:1] != ("dahl_hysteresis",))
    best = Scripted().best()
    assert best.found.effects[0].trial.name == "maxwell_relaxation"


def test_a_term_that_takes_the_inertia_once_it_is_fitted_to_the_end_is_taken_back(monkeypatch):
    monkeypatch.setattr(hypothesis, "has_joint", lambda fit: "backlash" not in fit.terms)
    search = Scripted()
    best = search.best()
    assert [effect.trial.name for effect in best.found.effects] == ["maxwell_relaxation", "tendon"]
    assert best.current.terms[-1] == "tendon"
    assert "backlash leaves the joint no plausible inertia" in search.said


def test_a_term_that_takes_the_joints_inertia_is_not_accepted():
    taking = Trial("plate_appendage", None, 0.6, (0.6, 0.6), -1.0, torque_share=1.0)
    assert taking.accepted
    assert not replace(taking, takes_joint=True).accepted


def test_straps_that_change_little_torque_are_accepted_where_they_gain_far_beyond_chance():
    little = Trial("fixation_compliance", None, 0.05, (0.05, 0.05), -1.0, 0.004, 2e-4)
    little = replace(little, joint_change=0.05)
    assert little.accepted
    assert not replace(little, joint_change=0.01).accepted
    assert not replace(little, by_chance=0.03).accepted
    assert not replace(little, held_out=(0.05, -0.01)).accepted
    assert not replace(little, name="torque_sensor_mode").accepted


def test_a_term_that_acts_in_few_stretches_is_not_accepted():
    trial = Trial("reflex_threshold", None, 0.6, (0.6, 0.6), -1.0, torque_share=1.0)
    assert replace(trial, stretches=FEWEST_STRETCHES).accepted
    assert not replace(trial, stretches=FEWEST_STRETCHES - 1.0).accepted


@pytest.mark.parametrize(("gain", "accepted"), [(0.5, True), (0.5 * DISPLACING_GAIN, False)])
def test_a_small_term_may_not_do_away_with_the_joints_viscosity(gain, accepted):
    trial = Trial("saturating_damping", None, gain, (gain, gain), -1.0, torque_share=1.0)
    assert trial.accepted
    displacing = Trial(
        *("saturating_damping", None, gain, (gain, gain), -1.0),
        torque_share=1.0,
        displaced=("viscosity.B",),
    )
    assert displacing.accepted == accepted


def test_a_rejected_candidate_does_not_hide_one_that_gains_less(monkeypatch):
    gains = {"activation_reflex_gain": 0.30, "long_latency_reflex": 0.05, "tendon": 0.01}

    def refitted(fitter, current, name, start, evaluations=12):
        fit = SimpleNamespace(values={})
        return Trial(name, fit, gains[name], (0.0, 0.0), -1.0, torque_share=1.0)

    def judged(fitter, current, trial, by_chance):
        followed = None if trial.name != "activation_reflex_gain" else 0.0
        return replace(trial, held_out=(0.04, 0.04), by_chance=by_chance, preceding_gain=followed)

    monkeypatch.setattr(candidates, "refitted", refitted)
    monkeypatch.setattr(candidates, "judged", judged)
    few = [SimpleNamespace(name=name, start={}, share=gain) for name, gain in gains.items()]
    null = SimpleNamespace(threshold_of=lambda name, fit: 0.02)
    search = Candidates(None, null, None, lambda line: None)
    current = SimpleNamespace(values={})
    judged = search._refitted_and_judged(current, few, dict.fromkeys(gains, 0.02))
    assert [t.name for t in judged] == list(gains)
    assert [t.accepted for t in judged] == [False, True, False]


def test_a_refit_that_takes_off_less_than_promised_begins_again_elsewhere(monkeypatch):
    """Two minima of a relaxation, of which the one that the screening led to is the worse."""
    gain_from = {0.1: 0.2, 0.2: 0.2, 1.0: 0.6}
    begun = []

    def refitted(fitter, current, name, start, evaluations=12, limit=math.inf):
        period = start[name]["T"]
        begun.append((period, limit))
        fit = SimpleNamespace(values=start, score=1.0 - gain_from[period])
        return Trial(name, fit, gain_from[period], (0.0, 0.0), -1.0)

    def screen(fitter, current, points):
        (tried,) = points.values()
        shares = tuple((0.5 + 0.1 * point["T"], point) for point in tried)
        return [SimpleNamespace(tried=shares, starts=tuple(tried))]

    monkeypatch.setattr(candidates, "refitted", refitted)
    monkeypatch.setattr(candidates, "screen", screen)
    grids = SimpleNamespace(whole=lambda name: [{"T": 0.1}, {"T": 0.2}, {"T": 1.0}])
    null = SimpleNamespace(threshold_of=lambda name, fit: 0.05)
    search = Candidates(None, null, grids, lambda line: None)
    current = SimpleNamespace(values={}, score=1.0)
    start = {"k": 3.0, "T": 0.1}
    first = refitted(None, current, "maxwell_relaxation", {"maxwell_relaxation": start})
    kept = search._refitted_to_the_end(current, first, 0.2, start)
    assert kept.gain == 0.2
    begun.clear()
    moved = search._refitted_to_the_end(current, first, 0.6, start)
    assert moved.gain == 0.6
    # Not where it began before, and no longer than it may do better.
    assert begun == [(0.1, math.inf), (1.0, 0.8), (0.2, 0.8)]


def test_forks_are_followed_side_by_side_and_learn_on_their_own():
    search = Scripted()
    fork = hypothesis.Fork(
        [],
        fit_of(()),
        Trial("dahl_hysteresis", fit_of(("dahl_hysteresis",)), 0.5, (0.5, 0.5), -1.0),
    )
    other = search._another(fork)
    search._follow(other)
    assert other.current.score == 10.0
    assert "dahl_hysteresis first: looking for term 2: screening" in search.said
    assert other.candidates is not search._candidates
    alone = search._candidates.alone(search._progress)
    alone._grids.learn(
        [SimpleNamespace(name="tendon", tried=tuple((k, {"w": k}) for k in range(9)))]
    )
    assert alone._grids._kept
    assert not search._candidates._grids._kept


def test_a_fork_is_taken_out_of_others_that_hold_arrays():
    fit = Fit({}, np.zeros(3), np.zeros(3), None, 1.0, 0)
    forks = [
        hypothesis.Fork([], replace(fit), Trial("tendon", replace(fit), 0.5, (0.5, 0.5), -1.0))
        for _ in range(2)
    ]
    last = forks[1]
    forks.remove(last)
    assert len(forks) == 1
    assert forks[0] is not last


def test_a_term_that_ends_at_a_bound_stands_in_for_one_that_does_not():
    def trial(name, gain, at_bounds):
        return Trial(name, SimpleNamespace(at_bounds=at_bounds), gain, (gain, gain), -1.0)

    mode = trial("partial_sensor_mode", 0.9, ("partial_sensor_mode.damping",))
    lag = trial("torque_sensor_lag", 0.8, ("reflex.delay",))
    assert trials.equals([mode, lag]) == [lag]
    assert trials.equals([mode]) == [mode]
    assert trials.equals([mode, trial("torque_sensor_lag", 0.1, ())]) == [mode]
