"""An investigation keeps what no recording excludes, ends by itself, and asks before it moves."""

import json
from html import escape
from types import SimpleNamespace

import numpy as np
import pytest

from ankle_physics.joint_profile import JointProfile
from ankle_physics.model import Model
from ankle_physics.term import term_library
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import faults
from model_discrepancy.report.investigation_report import write_investigation
from model_discrepancy.tools import investigation, movement_ranking
from model_discrepancy.tools.candidate_movements import Candidate
from model_discrepancy.tools.investigation import Investigation, investigate
from model_discrepancy.tools.movement_ranking import Proposal, RivalSet, _ranked
from model_discrepancy.tools.open_set import OpenSet, remaining
from model_discrepancy.tools.recording_judgement import judge_alone, open_sets
from model_discrepancy.tools.shared_effects import Member, Together
from model_discrepancy.tools.simulated_conduct import SimulatedConduct
from simulation_study.planted_trials import simulate_trial

CONDITIONS = {"whitening_rate[Hz]": 200.0}


STRETCHES = 40
FIRST_DIAGNOSIS = SimpleNamespace(problem=SimpleNamespace(told_compliance=None))
"""A diagnosis that does not tell how far the servo gives way."""


def errors_of(mean, spread=0.05, seed=0, recordings=1):
    """Return the error of each stretch of some recordings: that of the other name, plus this."""
    random = np.random.default_rng(seed)
    return [100.0 + mean + spread * random.standard_normal(STRETCHES) for _ in range(recordings)]


def judged(errors, evidence):
    one = OpenSet(next(iter(errors)), {name: {} for name in errors})
    one.errors, one.evidence = errors, evidence
    return remaining(one, list(errors))


@pytest.mark.parametrize(
    ("mean", "spread", "evidence", "left"),
    [
        (0.4, 0.5, 60.0, ["tendon"]),
        # A few stretches are against it, and most are not.
        (0.4, 3.0, 60.0, ["tendon", "reflex_threshold"]),
        # So little that what the models make of the noise decides.
        (0.4, 0.5, 6.0, ["tendon", "reflex_threshold"]),
    ],
)
def test_a_name_goes_that_is_less_likely_from_stretch_to_stretch(mean, spread, evidence, left):
    errors = {"tendon": errors_of(0.0, 0.0), "reflex_threshold": errors_of(mean, spread)}
    assert judged(errors, {"tendon": 0.0, "reflex_threshold": evidence}) == left


def test_a_name_goes_where_the_recordings_add_up_against_it():
    evidence = {"tendon": 0.0, "reflex_threshold": 90.0}

    def left(recordings):
        return judged(
            {
                "tendon": errors_of(0.0, 0.0, recordings=recordings),
                "reflex_threshold": errors_of(0.4, 1.2, seed=1, recordings=recordings),
            },
            evidence,
        )

    assert left(1) == ["tendon", "reflex_threshold"]
    assert left(4) == ["tendon"]


def test_a_name_that_was_excluded_earlier_is_compared_where_both_were_judged():
    one = OpenSet("tendon", {"tendon": {}, "reflex_threshold": {}})
    one.evidence = {"tendon": 0.0, "reflex_threshold": 60.0}
    one.errors = {
        "tendon": errors_of(0.0, 0.0, recordings=3),
        "reflex_threshold": errors_of(0.4, 0.5),
    }
    apart = one.above_likeliest
    assert apart["tendon"] == 0.0
    assert apart["reflex_threshold"] == pytest.approx(0.4 / 0.5 * np.sqrt(STRETCHES), rel=0.4)


def test_a_general_term_that_does_no_better_than_its_special_case_says_nothing():
    names = {"short_range_stiffness": [], "distributed_short_range_stiffness": []}
    assert judged(names, dict.fromkeys(names, 0.0)) == ["short_range_stiffness"]
    # A Maxwell element is a special case of bonds with a yield, and so of many such bonds.
    names = {"maxwell_relaxation": [], "distributed_short_range_stiffness": []}
    assert judged(names, dict.fromkeys(names, 0.0)) == ["maxwell_relaxation"]
    better = {"maxwell_relaxation": 8.0, "distributed_short_range_stiffness": 0.0}
    assert judged(names, better) == ["distributed_short_range_stiffness", "maxwell_relaxation"]


def test_a_pair_that_no_movement_decides_hides_no_other():
    steps, sines = Candidate("steps", {}), Candidate("sines", {})
    hopeless, open_ = ("a", "b"), ("a", "c")
    ranked = _ranked(
        [
            (steps, {hopeless: 0.004, open_: 0.01}, False),
            (sines, {hopeless: 0.001, open_: 0.20}, False),
        ],
        CONDITIONS,
    )
    assert [p.candidate.title for p in ranked] == ["sines", "steps"]
    assert ranked[0].pair == open_
    assert ranked[0].minutes < 1.0


def test_where_nothing_can_be_decided_the_least_hopeless_leads():
    ranked = _ranked(
        [
            (Candidate("steps", {}), {("a", "b"): 0.004}, False),
            (Candidate("sines", {}), {("a", "b"): 0.001}, False),
        ],
        CONDITIONS,
    )
    assert ranked[0].candidate.title == "steps"
    assert investigation.Design([RivalSet({"a": {}, "b": {}}, 0.0)], ranked, []).undecided == [
        ("a", "b")
    ]


def test_a_movement_that_left_the_rivals_open_is_not_proposed_again(monkeypatch):
    movements = {"steps": 0.2, "sines": 0.1}
    monkeypatch.setattr(
        movement_ranking, "candidates_for", lambda *_: [Candidate(t, {}) for t in movements]
    )
    monkeypatch.setattr(
        movement_ranking,
        "_excesses",
        lambda candidate, *_, **__: {("a", "b"): movements[candidate.title]},
    )
    conditions = {**CONDITIONS, "movement[rad]": 0.08}
    sets = [RivalSet({"a": {}, "b": {}}, 0.0)]
    first = movement_ranking.rank(sets, conditions)
    assert [p.candidate.title for p in first] == ["steps", "sines"]
    second = movement_ranking.rank(sets, conditions, made=["steps"])
    assert [p.candidate.title for p in second] == ["sines"]


def test_the_next_movement_is_designed_with_what_the_last_recording_made_of_each_name(monkeypatch):
    def aligned(fitter, fit):
        return fitter.fit([*fit.terms, "channel_skew"], fit.values, evaluations=2)

    monkeypatch.setattr("model_discrepancy.tools.open_set.align", aligned)
    planted = {"maxwell_relaxation": {"k": 40.0, "T": 0.1}}
    recording = simulate_trial(planted, seed=3, duration=30.0, rate=1024.0, protocol="equal")
    base = {"inertia": {}, "viscosity": {}, "stiffness": {}, "reflex": {}}
    models = {
        name: {e.term.name: dict(e.values) for e in Model.of({**base, name: {}}).entries}
        for name in ("maxwell_relaxation", "short_range_stiffness")
    }
    one = OpenSet("maxwell_relaxation", dict(models))
    judge_alone([one], recording, None)
    assert one.models["maxwell_relaxation"]["maxwell_relaxation"]["T"] == pytest.approx(
        0.1, rel=0.3
    )
    assert one.models["short_range_stiffness"] != models["short_range_stiffness"]
    # Each recording has an alignment of its own.
    assert not any("channel_skew" in values for values in one.models.values())


@pytest.mark.parametrize(("named", "sets"), [([], []), (["tendon"], ["tendon"])])
def test_only_what_the_first_recording_names_is_asked_about(named, sets):
    def trial(name, score):
        return SimpleNamespace(name=name, fit=SimpleNamespace(score=score, values={name: {}}))

    skew = {"channel_skew": {"skew": 1e-5}}
    final = SimpleNamespace(score=100.0, values={"tendon": {}, **skew}, terms=["tendon", *skew])
    motion = SimpleNamespace(sample_time=1e-3)
    problem = SimpleNamespace(fitter=SimpleNamespace(columns=SimpleNamespace(motion=motion)))
    rivals = [trial("reflex_threshold", 101.0)]
    found = SimpleNamespace(
        final=final,
        compared=final,
        effects=[SimpleNamespace(trial=trial("tendon", 100.0), rivals=rivals)],
    )
    verdict = SimpleNamespace(effects=[{"name": name} for name in named])
    first = SimpleNamespace(found=found, verdict=verdict, problem=problem)
    asked = open_sets(first)
    assert [one.effect for one in asked] == sets
    # Each recording has an alignment of its own.
    assert all(one.models["tendon"] == {"tendon": {}} for one in asked)


def test_torque_levels_are_simulated_one_after_the_other():
    model = Model.of({"stiffness": {"K": 50.0}, "inertia": {}, "voluntary_torque": {"rms": 0.0}})
    steps = {"signal": "random_steps", "amplitude": 0.01, "direction": "both"}
    made = SimulatedConduct(model)(Candidate("steps", steps, levels=True), 15.0, 1)
    means = made.torque.reshape(3, -1).mean(axis=1)
    np.testing.assert_allclose(means, [0.0, 4.0, 8.0], atol=0.5)
    assert made.reference is not None


def test_names_that_no_movement_tells_apart_are_checked_in_another_one_once(monkeypatch, tmp_path):
    recording = simulate_trial({}, seed=4, duration=20.0, rate=1024.0, protocol="equal")
    hopeless = Proposal(Candidate("steps", {}), 0.001, 1.0, ("a", "b"), {}, True)
    design = investigation.Design([RivalSet({"a": {}, "b": {}}, 0.0)], [hopeless], [])
    monkeypatch.setattr(investigation, "_design", lambda *_: design)
    monkeypatch.setattr(investigation, "judge_alone", lambda *_: "nothing excluded")
    sets = [OpenSet("a", {"a": {}, "b": {}})]
    story = investigation.Investigation(FIRST_DIAGNOSIS, sets, recordings=[recording])

    def next_round():
        return investigation._next_round(story, lambda *_: recording, tmp_path, 3, lambda _: None)

    assert next_round() == ""
    assert len(story.recordings) == 2
    assert design.sentence.startswith("No perturbation within the limits tells a from b")
    assert story.rounds[0].proposal == (
        f"{design.sentence} It is recorded all the same: it shows whether either holds at all."
    )
    assert next_round() == design.sentence
    assert len(story.recordings) == 2


@pytest.mark.parametrize(
    ("rounds", "words"), [(1, "budget of 1 recording is"), (2, "budget of 2 recordings is")]
)
def test_a_budget_that_is_spent_is_counted_in_words(rounds, words, tmp_path):
    story = Investigation(None, [OpenSet("a", {"a": {}, "b": {}})])
    story.rounds = [investigation.Round("", "", "sines", 20.0, "")] * rounds
    ended = investigation._next_round(story, lambda *_: None, tmp_path, rounds, lambda _: None)
    assert words in ended


def test_what_holds_is_asked_of_more_than_two_names_too():
    one, other = OpenSet("a", {"a": {}, "b": {}}), OpenSet("c", {"c": {}, "d": {}})
    assert investigation._any_of([one]) == "either holds"
    assert investigation._any_of([one, other]) == "any of them holds"


def test_an_error_that_no_model_is_meant_for_is_capped(monkeypatch):
    recording = simulate_trial(
        {"hardening_stiffness": {"k3": 1e5}},
        seed=3,
        duration=30.0,
        rate=1024.0,
        protocol="equal",
    )
    terms = {"inertia": {}, "viscosity": {}, "stiffness": {}, "reflex": {}}
    values = {
        e.term.name: dict(e.values)
        for e in Model.of({**terms, "hardening_stiffness": {"k3": 1e5}}).entries
    }
    one = OpenSet("hardening_stiffness", {"hardening_stiffness": values})
    without = SimpleNamespace(score=float("inf"))
    monkeypatch.setattr(OpenSet, "fitted_without", lambda *_: without)
    answer = judge_alone([one], recording, None)
    assert "without any of them more than 1000 %" in answer


def test_a_simulated_recording_is_kept_as_a_bag_with_its_command(tmp_path):
    model = Model.of({"stiffness": {"K": 50.0}, "inertia": {}})
    steps = Candidate("steps", {"signal": "random_steps", "amplitude": 0.01, "direction": "both"})
    made = SimulatedConduct(model, out=tmp_path)(steps, 3.0, 2)
    kept = Recording.from_bag(tmp_path / "round_2")
    np.testing.assert_allclose(kept.torque, made.torque)
    np.testing.assert_allclose(kept.reference, made.reference, atol=1e-9)


def test_an_axis_that_moves_along_a_line_is_simulated_in_metres_and_newtons(tmp_path):
    axis = JointProfile(
        "axis",
        "m",
        "N",
        inertia_range=(1.0, 100.0),
        torque_scale=1000.0,
        terms=("inertia", "viscosity"),
    )
    with axis.in_force():
        model = Model.of({"inertia": {"I": 10.0}, "viscosity": {"B": 40.0}})
        steps = {"signal": "random_steps", "amplitude": 0.01, "direction": "both"}
        made = SimulatedConduct(model, out=tmp_path)(Candidate("steps", steps), 25.0, 1)
        assert faults(made) == []
        kept = Recording.from_bag(tmp_path / "round_1")
        np.testing.assert_allclose(kept.position, made.position)


FITTED = {"K[N.m/rad]": {"base": 90.0, "augmented": 80.0, "standard_error": 2.0}}


def test_the_story_holds_the_impedance_and_the_models(tmp_path):
    verdict = SimpleNamespace(verdict="no_mismatch", effects=[], parameters=FITTED)
    story = Investigation(SimpleNamespace(verdict=verdict), [])
    story.save(tmp_path)
    content = json.loads((tmp_path / "investigation.json").read_text())
    assert content["parameters"] == FITTED
    assert content["parameters_of"] == "first/model.yaml"
    assert content["models"] == ["first/model.yaml"]
    write_investigation(story, tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    assert "80.0 ± 2.0" in text
    assert "<a href='first/model.yaml'>" in text


def test_the_models_of_all_recordings_are_written_beside_the_story(tmp_path):
    problem = SimpleNamespace(recording=SimpleNamespace(name="recording_1"))
    fit = SimpleNamespace(values={"inertia": {"I": 0.01}}, errors={})
    together = Together([Member(problem, None, fit)])
    verdict = SimpleNamespace(verdict="explained", effects=[], parameters=FITTED)
    story = Investigation(SimpleNamespace(verdict=verdict), [], found=together)
    story.save(tmp_path)
    assert story.models == ["together/recording_1.yaml"]
    assert Model.load(tmp_path / story.models[0]).entry("inertia").values["I"] == 0.01
    write_investigation(story, tmp_path / "report.html")
    assert "together/report.html" in (tmp_path / "report.html").read_text()
    assert (tmp_path / "together" / "report.html").exists()


@pytest.mark.parametrize(("expected", "made"), [(6.0, True), (1.0, False)])
def test_a_further_recording_is_made_where_what_adds_up_may_exclude_a_name(
    monkeypatch, tmp_path, expected, made
):
    """Two recordings put a name 2 standard errors above the other; two of three minutes may come,
    and 5 are missing of 9: a misfit of 3.3 in each minute.
    """
    recording = simulate_trial({}, seed=4, duration=20.0, rate=1024.0, protocol="equal")
    pairs = {("a", "b"): 0.01, ("b", "a"): 0.02}
    small = Proposal(Candidate("steps", {}), 0.01, expected, ("a", "b"), pairs, True)
    design = investigation.Design([RivalSet({"a": {}, "b": {}}, 0.0)], [small], [])
    monkeypatch.setattr(investigation, "_design", lambda *_: design)
    monkeypatch.setattr(investigation, "judge_alone", lambda *_: "nothing excluded")
    more = np.resize([0.0, 2.0], STRETCHES) - 1.0
    more += 2.0 * np.std(more, ddof=1) / np.sqrt(STRETCHES)
    one = OpenSet("a", {"a": {}, "b": {}}, evidence={"a": 0.0, "b": 30.0})
    one.errors = {"a": [np.full(STRETCHES, 100.0)], "b": [100.0 + more]}
    assert one.apart("b", "a") == pytest.approx(2.0)
    story = investigation.Investigation(FIRST_DIAGNOSIS, [one], recordings=[recording, recording])
    story.rounds = [investigation.Round("", "", "sines", 20.0, "", judged=True)]
    ended = investigation._next_round(story, lambda *_: recording, tmp_path, 3, lambda _: None)
    assert (ended == "") == made
    assert len(story.recordings) == 2 + made


def test_the_report_says_what_each_name_does(tmp_path):
    verdict = SimpleNamespace(verdict="explained", effects=[{"name": "tendon"}], parameters={})
    names = ["tendon", "reflex_threshold"]
    asked = OpenSet("tendon", {name: {} for name in names})
    write_investigation(Investigation(SimpleNamespace(verdict=verdict), [asked]), tmp_path / "r")
    text = (tmp_path / "r").read_text()
    for name in names:
        assert escape(term_library()[name].sentence) in text


@pytest.mark.slow
def test_an_investigation_ends_with_the_planted_name_and_tells_its_story(tmp_path):
    planted = {"reflex_threshold": {}}
    first = simulate_trial(planted, seed=11, duration=60.0, rate=1024.0, protocol="equal")
    paper = {"inertia": {}, "viscosity": {}, "stiffness": {}, "reflex": {}}
    subject = Model.of({**paper, **planted, "voluntary_torque": {"rms": 0.3}})
    asked = []

    def conduct(candidate, duration, number):
        asked.append(candidate.title)
        return SimulatedConduct(subject)(candidate, duration, number)

    story = investigate(first, conduct, tmp_path, rounds=2)
    write_investigation(story, tmp_path / "report.html")
    assert story.sets
    assert asked == [r.title for r in story.rounds]
    assert "reflex_threshold" in story.names
    content = json.loads((tmp_path / "investigation.json").read_text())
    assert content["names"] == story.names
    assert "Round 1" in (tmp_path / "report.html").read_text()


@pytest.mark.slow
def test_without_consent_nothing_is_recorded(tmp_path):
    first = simulate_trial(
        {"reflex_threshold": {}}, seed=11, duration=60.0, rate=1024.0, protocol="equal"
    )
    story = investigate(first, lambda *_: None, tmp_path, rounds=3)
    assert len(story.rounds) == 1
    assert "did not consent" in story.ended
