"""Counts of verdicts, on hand-made results, and the plan of the study."""

import json

import numpy as np
import pytest

from ankle_physics.term import term_library
from blind_rig.strength import STRENGTHS
from simulation_study import verdict_cases
from simulation_study.verdict_cases import IN_HUMAN_TRIALS, KINDS, made, plans
from simulation_study.verdict_report import (
    named,
    rate_with_interval,
    reliability,
    report,
    stated_names,
    table,
)
from simulation_study.verdict_study import families, library_of, ordered, read_cases, right_names

COUNTS = {
    "null": 6,
    "effect": 30,
    "pair": 6,
    "foreign": 8,
    "left_out": 6,
    "planted": 4,
    "planted_from_rig": 4,
}


def _entry(kind, right, effects, verdict="explained", **plan):
    given = {
        "kind": kind,
        "hidden": [],
        "servo": "stiff",
        "protocol": "pulse_step",
        "rate": 1000.0,
        "velocity": True,
        "reference": True,
        "noise": "quiet",
        "variability": "small",
    }
    return {
        "case": f"{kind} {right}",
        "plan": given | plan,
        "right": right,
        "verdict": verdict,
        "seconds": 5.0,
        "effects": [
            {"name": n, "probability": p, "family": f, "family_probability": q, "set": [n]}
            for n, p, f, q in effects
        ],
    }


def test_a_study_can_be_drawn_again_and_one_kind_does_not_change_another():
    first = list(plans(COUNTS, 5, ["a", "b"]))
    assert first == list(plans(COUNTS, 5, ["a", "b"]))
    fewer = list(plans(COUNTS | {"effect": 2}, 5, ["a", "b"]))
    assert [p for p in fewer if p.kind == "null"] == [p for p in first if p.kind == "null"]
    assert list(plans(COUNTS, 6, ["a", "b"])) != first
    assert {p.kind for p in first} == set(KINDS)


def test_an_unfinished_study_holds_some_of_each_kind():
    begun = ordered(COUNTS, 5, ["a", "b"])[:12]
    assert {p.kind for p in begun} == set(KINDS)


def test_a_reflex_curve_is_hidden_only_where_stretches_differ():
    drawn = [p for p in plans(COUNTS, 5, ["a"]) if p.kind not in IN_HUMAN_TRIALS]
    curved = [plan for plan in drawn if "reflex_threshold" in plan.hidden]
    assert {plan.protocol for plan in curved} == {"random_levels"}


def test_the_whole_family_is_left_out():
    plan = next(p for p in plans(COUNTS, 5) if p.kind == "left_out")
    left = library_of(plan)
    gone = set(term_library()) - set(left)
    assert gone
    assert not families(list(gone)) & families(left)
    assert right_names(plan) == [[]]


def test_a_family_counts_where_its_name_is_not_sure():
    names = [["maxwell_relaxation"]]
    exact = _entry("effect", names, [("maxwell_relaxation", 0.8, "intrinsic memory", 0.9)])
    relative = _entry("effect", names, [("thixotropy", 0.5, "intrinsic memory", 0.8)])
    wrong = _entry("effect", names, [("thixotropy", 0.8, "intrinsic memory", 0.9)])
    silent = _entry("effect", names, [], verdict="no_mismatch")
    assert stated_names(exact) == [("maxwell_relaxation", 0.8, True)]
    assert stated_names(relative) == [("intrinsic memory", 0.8, True)]
    assert stated_names(wrong) == [("thixotropy", 0.8, False)]
    assert [named(e, True) for e in (exact, relative, silent)] == [True, False, False]
    assert [named(e, False) for e in (exact, relative, silent)] == [True, True, False]
    counts = dict(table([exact, relative, wrong, silent]))
    assert counts["stated with 0.7 or more and wrong, one effect"].startswith("1 of 3")
    assert counts["one effect: named exactly"].startswith("1 of 4")
    assert counts["one effect: overlooked"].startswith("1 of 4")


def test_where_the_family_is_left_out_recordings_count_that_state_any_name():
    sure = _entry(
        "left_out", [[]], [("tendon", 0.8, "a", 0.9), ("maxwell_relaxation", 0.9, "b", 0.9)]
    )
    unsure = [_entry("left_out", [[]], [("tendon", p, "a", p)]) for p in (0.3, 0.6)]
    counts = dict(table([sure, *unsure, _entry("left_out", [[]], [], "unexplained")]))
    assert counts["family left out: a name is stated with 0.7 or more"].startswith("1 of 4")


def test_an_effect_that_can_hardly_be_seen_is_counted_apart():
    names = [["tendon"]]
    seen = _entry("effect", names, [("tendon", 0.8, "a", 0.9)]) | {"shares": {"tendon": 0.021}}
    hardly = _entry("effect", names, [], "no_mismatch") | {"shares": {"tendon": 0.001}}
    counts = dict(table([seen, hardly]))
    assert counts["one effect: named exactly"].startswith("1 of 1")
    assert counts["one effect: overlooked"].startswith("0 of 1")
    assert next(v for k, v in counts.items() if k.startswith("hidden, but")).startswith("0 of 1")


def test_whatever_is_stated_is_wrong_where_the_library_lacks_the_effect():
    entry = _entry("foreign", [[]], [("backlash", 0.9, "backlash", 0.9)])
    assert stated_names(entry) == [("backlash", 0.9, False)]


def test_false_alarms_are_counted_in_each_stratum():
    entries = [
        _entry("null", [], [], verdict="no_mismatch"),
        _entry("null", [], [], verdict="unexplained", servo="compliant"),
    ]
    hidden = _entry("effect", [["tendon"]], [], hidden=["tendon"]) | {"shares": {"tendon": 0.0214}}
    assert "| effect: tendon (2.1 %) |" in report([hidden], "command")
    counts = dict(table(entries))
    assert counts["false alarms, servo compliant"].startswith("1 of 1")
    assert counts["false alarms, servo stiff"].startswith("0 of 1")
    assert "| null: nothing | compliant |" in report(entries, "command")


def test_an_interval_is_that_of_the_binomial():
    assert rate_with_interval(0, 8) == "0 of 8 (0 %, 0 to 37 %)"
    assert rate_with_interval(0, 0) == "none"


def test_the_later_result_of_a_case_counts(tmp_path):
    first, second = _entry("null", [], [], "unexplained"), _entry("null", [], [], "no_mismatch")
    (tmp_path / "cases-1.jsonl").write_text(json.dumps(first) + "\n" + json.dumps(second) + "\n")
    assert [e["verdict"] for e in read_cases(tmp_path)] == ["no_mismatch"]


def test_unknown_kinds_are_not_drawn():
    with pytest.raises(StopIteration):
        next(plans({"null": 0}, 1))


def test_stated_probabilities_are_held_against_how_often_they_are_right():
    cases = [
        _entry("effect", [["tendon"]], [("tendon", 0.9, "a", 0.9)]),
        _entry("effect", [["tendon"]], [("backlash", 0.9, "backlash", 0.9)]),
        _entry("null", [], [("tendon", 0.1, "tendon", 0.2)]),
    ]
    counted = dict(reliability(cases))
    assert counted["names stated with 0.90 on average: right"].startswith("1 of 2")
    assert counted["names stated with 0.10 on average: right"].startswith("0 of 1")
    assert counted["families stated with 0.20 on average: right"].startswith("0 of 1")


@pytest.fixture(scope="module")
def made_once():
    """Make the first case of 20 s that hides an effect, once for all tests."""
    cases = {}

    def make(name):
        if name not in cases:
            plan = next(p for p in plans({"effect": 60}, 8) if p.hidden == (name,))
            cases[name] = plan, made(plan)
        return cases[name]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(verdict_cases, "DURATION_S", 20.0)
        yield make


@pytest.mark.parametrize(
    "name",
    ["late_reflex", pytest.param("stiffness_follows_torque", marks=pytest.mark.slow)],
)
def test_an_effect_is_as_strong_in_this_subject_as_it_is_said_to_be(name, made_once):
    _, case = made_once(name)
    assert case.shares[name] == pytest.approx(STRENGTHS["moderate"], rel=0.5)


def test_a_case_is_made_again_alone(made_once):
    plan, case = made_once("late_reflex")
    assert np.array_equal(case.recording.torque, made(plan).recording.torque)


def test_what_a_human_trial_shows_itself_counts_for_no_planted_effect():
    own = {"trial": ["short_range_stiffness"]}
    tendon = _entry("planted", [["tendon"]], [("tendon", 0.2, "a", 0.2)], protocol="trial")
    memory = _entry(
        "planted",
        [["maxwell_relaxation"]],
        [("maxwell_relaxation", 0.2, "intrinsic memory", 0.2)],
        protocol="trial",
    )
    counts = dict(table([tendon, memory], own))
    words = "planted in human trials and not shown by the trial itself"
    assert counts["planted in human trials: named exactly"].startswith("2 of 2")
    assert counts[f"{words}: named exactly"].startswith("2 of 2")
    # Its family is there already: another member of it says nothing new.
    assert counts[f"{words}: its family named"].startswith("1 of 1")
