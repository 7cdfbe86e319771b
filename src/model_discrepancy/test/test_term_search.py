"""The search adds terms, and exchanges one that only stood in for another."""

from dataclasses import replace
from types import SimpleNamespace

import pytest

from model_discrepancy.problem import prepare
from model_discrepancy.search import exchange as exchanging
from model_discrepancy.search import harm, term_search
from model_discrepancy.search.candidates import _near_best, special_cases
from model_discrepancy.search.exchange import (
    better_rivals,
    ends_at_bound,
    exchange,
    second_effect,
    specialise,
)
from model_discrepancy.search.found import Effect, Found, Trial
from model_discrepancy.search.grids import Grids
from model_discrepancy.search.null import Null
from model_discrepancy.search.term_search import search
from model_discrepancy.search.trials import joint_change, judged, refitted
from simulation_study.planted_trials import simulate_trial

RELATIVES = ("dahl_hysteresis", "saturating_damping")


def test_a_term_that_only_stood_in_for_another_is_exchanged():
    planted = {"maxwell_relaxation": {"k": 60.0, "T": 0.1}}
    problem = prepare(simulate_trial(planted, seed=3, duration=40.0, protocol="random"))
    fitter = problem.fitter
    rows = fitter.rows
    null = Null.of(problem.noise, rows.time, rows.used)
    found = search(fitter, problem.base, null, RELATIVES)
    assert {effect.trial.name for effect in found.effects} <= set(RELATIVES)
    assert found.effects
    grids = Grids([*RELATIVES, "maxwell_relaxation"], 40.0)
    score = found.final.score
    exchange(fitter, found, grids, null, rows.gain(), lambda _: None)
    assert [effect.trial.name for effect in found.effects] == ["maxwell_relaxation"]
    assert found.final.score < 0.9 * score


def test_a_curve_that_turns_beside_the_mean_angle_is_one_term():
    planted = {"hardening_stiffness": {"k1": 9000.0, "k3": 9e4}}
    problem = prepare(simulate_trial(planted, seed=3, duration=40.0, protocol="random"))
    null = Null.of(problem.noise, problem.fitter.rows.time, problem.fitter.rows.used)
    library = ("asymmetric_damping", "position_dependent_stiffness", "hardening_stiffness")
    found = search(problem.fitter, problem.base, null, library)
    assert [effect.trial.name for effect in found.effects] == ["hardening_stiffness"]
    values = found.final.values["hardening_stiffness"]
    assert values["k1"] == pytest.approx(9000.0, rel=0.1)
    assert values["k3"] == pytest.approx(9e4, rel=0.2)


@pytest.mark.parametrize(("exchanged", "searches"), [(False, 1), (True, 2)])
def test_after_an_exchange_the_search_goes_on_beside_the_new_term(monkeypatch, exchanged, searches):
    """What was nearly taken beside the old term says nothing about the new one."""
    planted = {"maxwell_relaxation": {"k": 60.0, "T": 0.1}}
    problem = prepare(simulate_trial(planted, seed=3, duration=20.0, protocol="random"))
    null = Null.of(problem.noise, problem.fitter.rows.time, problem.fitter.rows.used)
    seen = []

    def exchange(fitter, found, *_):
        seen.append(found)
        found.near = ["stale"]
        return exchanged

    monkeypatch.setattr(term_search, "exchange", exchange)
    found = search(problem.fitter, problem.base, null, ["maxwell_relaxation", "tendon"])
    assert len(seen) == searches
    assert found is seen[-1]
    if exchanged:
        assert found is not seen[0]
        assert found.effects == seen[0].effects


@pytest.mark.parametrize(
    ("chance", "left"), [(0.01, "fixation_compliance"), (-0.01, "stiffening_fixation")]
)
def test_a_general_term_gives_way_to_its_special_case_where_it_gains_as_little_as_by_chance(
    chance, left
):
    planted = {
        "fixation_compliance": {"k_s": 700.0, "b_s": 1.0},
        "footplate_inertia": {"Ip": 0.005},
    }
    problem = prepare(simulate_trial(planted, seed=3, duration=30.0))
    fitter, base = problem.fitter, problem.base
    trial = refitted(
        *(fitter, base, "stiffening_fixation"),
        {**base.values, "stiffening_fixation": {"k_s": 800.0, "b_s": 1.0, "curvature": 5.0}},
    )
    found = Found(base, trial.fit, effects=[Effect(trial, errors=None)])
    specialise(fitter, found, SimpleNamespace(threshold_of=lambda name, fit: chance))
    assert found.effects[0].trial.name == left
    assert left in found.final.terms
    assert found.final.values[left]["k_s"] == pytest.approx(700.0, rel=0.05)


SECOND = Trial(
    "reflex_depression", None, gain=0.4, held_out=(0.3, 0.35), bic=-50.0, torque_share=0.003
)


@pytest.mark.parametrize(
    ("changes", "named", "at_bounds", "is_effect"),
    [
        ({}, "short_range_stiffness", (), True),
        ({"held_out": (0.4, 0.1)}, "short_range_stiffness", (), False),
        ({"torque_share": 8e-4}, "short_range_stiffness", (), False),
        ({"name": "maxwell_relaxation"}, "short_range_stiffness", (), False),
        ({}, "short_range_stiffness", ("reflex_depression.size",), False),
        ({}, "short_range_stiffness", ("short_range_stiffness.recovery",), True),
    ],
)
def test_the_only_refinement_is_an_effect_where_it_takes_off_much_of_what_is_left(
    changes, named, at_bounds, is_effect
):
    """A term of a named family corrects its shape; a value at a bound is none that was found."""
    final = SimpleNamespace(at_bounds=at_bounds)
    found = second_effect(final, [replace(SECOND, **changes)], [named])
    assert (found == replace(SECOND, **changes).name) == is_effect


@pytest.mark.parametrize(
    ("gains", "second"),
    [((0.4, 0.1), "reflex_depression"), ((0.4, 0.4), None), ((0.1, 0.1), None)],
)
def test_one_refinement_is_an_effect_where_it_alone_takes_off_much(gains, second):
    """Several that do so have not the shape of what is missing."""
    names = (SECOND.name, "thixotropy")
    trials = [replace(SECOND, name=n, gain=g) for n, g in zip(names, gains, strict=True)]
    final = SimpleNamespace(at_bounds=())
    assert second_effect(final, trials, ["tendon"]) == second


@pytest.mark.parametrize(
    ("name", "gain", "preceding", "exceeds"),
    [
        ("activation_reflex_gain", 0.3, 0.15, True),
        ("activation_reflex_gain", 0.3, 0.05, False),  # less than by chance
        ("activation_reflex_gain", 0.9, 0.12, False),  # little beside what follows its own response
        ("activation_stiffness", 0.9, None, False),  # nobody knows
    ],
)
def test_a_term_that_follows_torque_follows_what_was_held_before(name, gain, preceding, exceeds):
    trial = Trial(name, None, gain, (gain, gain), 0.0, by_chance=0.1, torque_share=0.01)
    trial = replace(trial, preceding_gain=preceding)
    assert (trial.exceeds_chance, trial.accepted) == (exceeds, exceeds)
    # Written about the mean torque, it leaves the base model its own part.
    assert not replace(trial, gain=0.09, by_chance=0.01, displaced=("reflex.G",)).accepted
    assert replace(trial, name="tendon", gain=0.11).exceeds_chance


def test_the_change_of_the_joint_is_the_larger_one_of_stiffness_and_viscosity():
    def fit(**values: float) -> SimpleNamespace:
        terms = {"K": "stiffness", "B": "viscosity", "I": "inertia"}
        return SimpleNamespace(values={terms[s]: {s: v} for s, v in values.items()})

    assert joint_change(fit(K=80.0, B=1.0), fit(K=100.0, B=1.1)) == pytest.approx(0.2)
    assert joint_change(fit(K=80.0, B=1.0), fit(K=80.0, B=-1.0)) == pytest.approx(2.0)
    assert joint_change(fit(I=12.0), fit(I=6.0)) == 0.0


@pytest.mark.parametrize(
    ("name", "accepted"), [("activation_reflex_gain", False), ("position_reflex", True)]
)
def test_slow_torque_that_follows_in_one_half_only_does_so_by_accident(name, accepted):
    trial = Trial(name, None, 0.28, (0.4, 0.3), 0.0, torque_share=0.01, preceding_gain=0.2)
    assert trial.accepted
    assert replace(trial, held_out=(0.38, 0.01)).accepted == accepted


@pytest.mark.parametrize(
    ("name", "by_chance", "taken"),
    [
        ("maxwell_relaxation", 0.35, True),
        ("maxwell_relaxation", 0.45, False),
        ("activation_reflex_gain", 0.1, False),  # nobody knows what was held before
    ],
)
def test_a_rival_takes_no_place_with_what_it_takes_off_by_chance(name, by_chance, taken):
    fit = SimpleNamespace(size=5, score=60.0)
    rival = Trial(name, fit, gain=0.4, held_out=(0.0, 0.0), bic=0.0, by_chance=by_chance)
    effect = Effect(replace(SECOND, name="thixotropy"), errors=None, rivals=[rival])
    found = Found(None, SimpleNamespace(size=5, score=80.0), effects=[effect])
    assert (better_rivals(found) == [(effect, rival)]) == taken


@pytest.mark.parametrize(
    ("name", "preceding", "unconfirmed"),
    [
        ("activation_reflex_gain", 0.01, True),
        ("activation_reflex_gain", None, True),  # nobody knows what was held before
        ("activation_reflex_gain", 0.2, False),
        ("reflex_drift", None, False),
    ],
)
def test_a_rival_that_only_follows_the_torque_leaves_no_name_open(name, preceding, unconfirmed):
    rival = Trial(name, None, 0.3, (0.0, 0.0), 0.0, by_chance=0.1, preceding_gain=preceding)
    assert rival.unconfirmed == unconfirmed


@pytest.mark.parametrize(
    ("score", "by_chance", "taken"),
    [(70.0, 0.01, True), (75.0, 0.01, False), (70.0, 0.2, False)],
)
def test_a_rival_with_more_parameters_must_gain_more_than_these_do(score, by_chance, taken):
    fit = SimpleNamespace(size=7, score=score)
    rival = Trial(
        "maxwell_relaxation", fit, gain=0.4, held_out=(0.0, 0.0), bic=0.0, by_chance=by_chance
    )
    effect = Effect(replace(SECOND, name="thixotropy"), errors=None, rivals=[rival])
    found = Found(None, SimpleNamespace(size=5, score=80.0), effects=[effect])
    assert (better_rivals(found) == [(effect, rival)]) == taken


def test_a_rival_may_take_the_place_of_a_small_term_that_ends_at_a_bound():
    """A resonance of the sensor whose damping does so stands in for a lag."""
    fit = SimpleNamespace(size=5, score=60.0)
    rival = Trial("torque_sensor_lag", fit, gain=0.4, held_out=(0.4, 0.4), bic=-9.0, by_chance=0.01)
    small = Effect(replace(SECOND, name="torque_sensor_mode"), errors=None, rivals=[rival])
    final = SimpleNamespace(size=6, score=80.0, at_bounds=("torque_sensor_mode.damping",))
    assert ends_at_bound(final, "torque_sensor_mode")
    assert not ends_at_bound(final, "torque_sensor")
    found = Found(None, final, refinements=[small])
    assert better_rivals(found) == [(small, rival)]


@pytest.mark.parametrize(
    ("vaf", "score", "harms"),
    [(92.0, 98.0, True), (92.9, 98.0, False), (92.0, 80.0, False), (95.0, 98.0, False)],
)
def test_a_rival_that_predicts_unseen_torque_worse_than_it_helps_does_harm(
    vaf, score, harms, monkeypatch
):
    """A drift, say, that a half of the recording shows, and that the other does not continue."""
    unseen = {100.0: 93.0, score: vaf}
    monkeypatch.setattr(
        harm, "held_out", lambda fitter, fit: SimpleNamespace(vaf=unseen[fit.score])
    )
    final, other = SimpleNamespace(score=100.0), SimpleNamespace(score=score)
    assert harm.harms(None, final, other) == harms


def test_a_lag_takes_the_place_of_a_resonance_beside_a_much_larger_effect():
    """Beside it the resonance is small, and nobody would ask for its rivals."""
    planted = {"maxwell_relaxation": {"k": 600.0, "T": 0.02}, "torque_sensor_lag": {"T": 0.001}}
    problem = prepare(simulate_trial(planted, seed=5, duration=20.0, protocol="random"))
    fitter = problem.fitter
    null = Null.of(problem.noise, fitter.rows.time, fitter.rows.used)
    found = search(fitter, problem.base, null, ("maxwell_relaxation", "torque_sensor_mode"))
    grids = Grids(["maxwell_relaxation", "torque_sensor_mode", "torque_sensor_lag"], 20.0)
    assert {e.trial.name for e in found.effects} == {"maxwell_relaxation"}
    assert exchange(fitter, found, grids, null, fitter.rows.gain(), print)
    assert "torque_sensor_lag" in {effect.trial.name for effect in found.effects}
    assert found.final.values["torque_sensor_lag"]["T"] == pytest.approx(0.001, rel=0.1)


def test_a_rival_begins_beside_the_others_as_they_are_with_the_effect(monkeypatch):
    """Without the effect, the others stand in for a part of it."""
    planted = {"maxwell_relaxation": {"k": 60.0, "T": 0.1}}
    problem = prepare(simulate_trial(planted, seed=3, duration=20.0, protocol="random"))
    fitter = problem.fitter
    null = Null.of(problem.noise, fitter.rows.time, fitter.rows.used)
    found = search(fitter, problem.base, null, ("maxwell_relaxation",))
    final, starts = found.final, {}

    def seen(fitter, current, name, start, *options):
        starts[name] = start
        return refitted(fitter, current, name, start, *options)

    monkeypatch.setattr(exchanging, "refitted", seen)
    exchange(fitter, found, Grids(["dahl_hysteresis"], 20.0), null, fitter.rows.gain(), print)
    (without,) = (effect.without for effect in found.effects)
    assert starts["dahl_hysteresis"]["viscosity"] == final.values["viscosity"]
    assert final.values["viscosity"] != without.values["viscosity"]


def test_a_soft_strap_is_found_where_the_base_model_is_far_from_the_joint():
    """The base model ends with the least inertia and half of the stiffness, about which no linear
    step shows what straps would do.
    """
    planted = {"fixation_compliance": {"k_s": 300.0, "b_s": 0.8}}
    problem = prepare(simulate_trial(planted, seed=8, duration=40.0, rate=1024.0))
    null = Null.of(problem.noise, problem.fitter.rows.time, problem.fitter.rows.used)
    library = (*planted, "partial_sensor_mode", "torque_sensor_mode", "plate_appendage")
    library = (*library, "torque_sensor_lag")
    found = search(problem.fitter, problem.base, null, library)
    assert [effect.trial.name for effect in found.effects] == ["fixation_compliance"]
    assert found.final.values["fixation_compliance"]["k_s"] == pytest.approx(300.0, rel=0.02)


def test_a_large_promise_is_followed_though_its_first_steps_lead_nowhere():
    """A soft strap takes the joint far from the base model; smaller promises are no reason."""
    strap, mode, lag = (
        Trial(name, None, gain, (0.0, 0.0), 0.0)
        for name, gain in (
            ("fixation_compliance", -0.08),
            ("partial_sensor_mode", 0.42),
            ("torque_sensor_lag", 0.1),
        )
    )
    chance = dict.fromkeys((strap.name, mode.name, lag.name), 0.004)
    promised = {strap.name: 0.4, mode.name: 0.52, lag.name: 0.2}
    assert _near_best([strap, mode, lag], chance, promised) == ([strap, mode], [lag])
    promised[strap.name] = 0.2
    assert _near_best([strap, mode, lag], chance, promised) == ([mode], [strap, lag])


def test_a_special_case_is_tried_where_a_general_term_was_accepted():
    """Straps of one stiffness: the general term stiffens them, by a curvature next to nothing."""
    trial = simulate_trial({"fixation_compliance": {}}, seed=4, duration=20.0)
    problem = prepare(trial)
    fitter, null = problem.fitter, SimpleNamespace(threshold_of=lambda name, fit: 0.005)
    start = {"stiffening_fixation": {"k_s": 2000.0, "b_s": 1.0, "curvature": 20.0}}
    general = refitted(
        fitter, problem.base, "stiffening_fixation", {**problem.base.values, **start}
    )
    general = judged(fitter, problem.base, general, 0.005)
    assert general.accepted
    (special,) = special_cases(fitter, problem.base, [general], null)
    assert special.name == "fixation_compliance"
    assert special.accepted
    assert special.gain > general.gain - 0.005
    assert special_cases(fitter, problem.base, [replace(general, held_out=(0.0, 0.0))], null) == []
