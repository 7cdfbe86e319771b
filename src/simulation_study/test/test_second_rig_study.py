"""Verdicts on a third engine: what counts, on hand-made results."""

import json
import sys

import pytest

from ankle_physics.term import term_library
from second_rig.draw import draw_cases
from second_rig.effects.register import EFFECTS
from second_rig.recording import record
from simulation_study import second_rig_study
from simulation_study.second_rig_answers import OF_SECOND_RIG, answers_of
from simulation_study.second_rig_report import counts, in_sets, is_right_about_unlisted, report
from simulation_study.second_rig_study import as_recording, ordered, truth_of

COUNTS = {"base": 4, "effect": 6, "pair": 2, "unlisted": 2}
K, G = "K[N.m/rad]", "G[N.m.s/rad]"


def _entry(kind, effects, said, verdict="explained", K_found=101.0):
    """A result with a truth of 100 and 10, a base model that is off by a fifth, and errors of 1."""
    return {
        "case": f"{kind} {effects}",
        "kind": kind,
        "protocol": "prbs",
        "servo": None,
        "right": answers_of(effects),
        "shares": dict.fromkeys(effects, 0.021),
        "truth": {K: 100.0, G: 10.0},
        "verdict": verdict,
        "effects": [
            {"name": n, "probability": p, "family": f, "family_probability": q, "set": s}
            for n, p, f, q, s in said
        ],
        "parameters": {
            K: {"base": 120.0, "augmented": K_found, "standard_error": 1.0},
            G: {"base": 8.0, "augmented": 10.0, "standard_error": 1.0},
        },
    }


EXACT = ("maxwell_relaxation", 0.9, "intrinsic memory", 0.9, ["maxwell_relaxation"])
OPEN = ("thixotropy", 0.4, "intrinsic memory", 0.8, ["thixotropy", "maxwell_relaxation"])
RELATIVE = ("thixotropy", 0.4, "intrinsic memory", 0.8, ["thixotropy"])
WRONG = ("backlash", 0.9, "backlash", 0.9, ["backlash"])


def test_every_effect_has_an_answer_of_the_library_or_none():
    assert set(OF_SECOND_RIG) == set(EFFECTS)
    named = {name for answer in OF_SECOND_RIG.values() for name in answer.names}
    assert named <= set(term_library())
    assert answers_of(("mains_hum", "hardening")) == [
        ["hardening_stiffness", "position_dependent_stiffness"]
    ]


def test_exact_names_families_and_sets_are_counted():
    entries = [_entry("effect", ["relaxation"], [said]) for said in (EXACT, OPEN, RELATIVE)]
    entries.append(_entry("effect", ["relaxation"], [WRONG]))
    entries.append(_entry("effect", ["relaxation"], [], "no_mismatch"))
    assert [in_sets(e) for e in entries] == [True, True, False, False, False]
    table = dict(counts(entries))
    assert table["one effect: named exactly"].startswith("1 of 5")
    assert table["one effect: its family named"].startswith("3 of 5")
    assert table["one effect: named or in an open set"].startswith("2 of 5")
    assert table["one effect: overlooked"].startswith("1 of 5")
    assert table["names and families stated with 0.7 or more: wrong"].startswith("1 of 4")


def test_both_effects_of_a_pair_are_to_be_named():
    strap = ("fixation_compliance", 0.9, "resonance in the load path", 0.9, None)
    threshold = ("reflex_threshold", 0.9, "reflex input curve", 0.9, None)
    pair = ["strap", "reflex_threshold"]
    table = dict(
        counts([_entry("pair", pair, [strap, threshold]), _entry("pair", pair, [threshold])])
    )
    assert table["two effects: both named exactly"].startswith("1 of 2")


def test_false_alarms_are_recordings_without_a_mismatch_that_are_called_so():
    entries = [_entry("base", [], [], v) for v in ("no_mismatch", "no_mismatch", "unexplained")]
    assert dict(counts(entries))["false alarms"].startswith("1 of 3")


def test_unlisted_physics_is_right_where_no_wrong_name_is_stated():
    hidden = ["spindle_slack"]
    silent = _entry("unlisted", hidden, [("backlash", 0.3, "backlash", 0.3, ["backlash"])])
    unexplained = _entry("unlisted", hidden, [WRONG], "unexplained")
    wrong = _entry("unlisted", hidden, [WRONG])
    assert [is_right_about_unlisted(e) for e in (silent, unexplained, wrong)] == [True, True, False]
    (count,) = [v for k, v in counts([silent, unexplained, wrong]) if "nobody lists: unex" in k]
    assert count.startswith("2 of 3")


def test_errors_of_K_and_G_are_stated_beside_those_of_the_base_model():
    entries = [_entry("base", [], [], "no_mismatch", found) for found in (101.0, 105.0, 101.5)]
    table = dict(counts(entries))
    assert table["K, without a mismatch: median error, that of the base model"] == "1.5 %, 20.0 %"
    assert table["K, without a mismatch: within two standard errors"].startswith("2 of 3")
    text = report(entries, "command")
    assert "| nothing | prbs | rigid | no_mismatch | nothing | none | 100, 120, 101 ± 1 |" in text
    nothing = _entry("base", [], [], "bad_recording") | {"parameters": {}}
    assert "100, -, -" in report([nothing], "command")


def test_an_unfinished_study_holds_some_of_each_kind():
    cases = ordered(3, COUNTS)
    assert sorted(c.name for c in cases) == sorted(c.name for c in draw_cases(3, COUNTS))
    assert {c.kind for c in cases[:6]} == set(COUNTS)


def test_the_diagnosis_is_handed_the_channels_and_scored_against_the_impulse():
    case = next(c for c in draw_cases(3) if c.effects == ("late_reflex",))
    made = record(case, 4.0)
    recording = as_recording(case, made)
    assert recording.rate == case.rate
    assert recording.reference is made.reference
    assert (recording.velocity is None) == (not case.velocity)
    impedance = made.truth.impedance
    late = made.truth.effects[0].parameters["engine"]["late_reflex.gain"]
    assert truth_of(made)[K] == impedance.K
    assert truth_of(made)[G] == pytest.approx(impedance.G_secant + late, rel=0.3)
    assert truth_of(made)[G] > impedance.G_secant


def test_a_study_goes_on_where_it_stopped_and_parts_share_it(tmp_path, monkeypatch):
    asked = []

    def counted(case):
        asked.append(case.name)
        return _entry(case.kind, list(case.effects), [], "no_mismatch") | {
            "case": case.name,
            "seconds": 1.0,
        }

    monkeypatch.setattr(second_rig_study, "counted", counted)
    sizes = ["--base", "2", "--effects", "2", "--pairs", "0", "--unlisted", "0"]
    options = ["study", "--seed", "3", "--out", str(tmp_path / "new"), *sizes]
    for part in ("1/2", "2/2", "1/2"):
        monkeypatch.setattr(sys, "argv", [*options, "--part", part])
        second_rig_study.main()
    assert len(asked) == len(set(asked)) == 4
    kept = [
        json.loads(line)["case"]
        for file in (tmp_path / "new").glob("results*.jsonl")
        for line in file.read_text().splitlines()
    ]
    assert sorted(kept) == sorted(asked)
    assert "4 recordings of `second_rig`" in (tmp_path / "new" / "second_rig.md").read_text()
    monkeypatch.setattr(sys, "argv", [*options[:2], "4", *options[3:]])
    with pytest.raises(SystemExit):
        second_rig_study.main()
