"""What a report says in words agrees with the numbers that stand beside it."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.term import term_library
from model_discrepancy.report.effect_section import effect_sections, equations
from model_discrepancy.report.html_report import (
    explained,
    headline,
    other_terms,
    what_next,
    why_unexplained,
    write_report,
)
from model_discrepancy.report.plain_words import (
    location_rows,
    rounded_vaf,
    sentence,
    vaf_text,
    variability_rows,
)
from model_discrepancy.report.result_folder import save_stated
from model_discrepancy.report.verdict import Verdict, alternatives
from model_discrepancy.search.found import Found, Trial

EFFECT = {
    "name": "coulomb_friction",
    "family": "intrinsic memory",
    "stated": "intrinsic memory",
    "belongs_to": "rig",
    "location": "coupling between footplate and foot",
    "parameters": {},
    "probability": 0.27,
    "family_probability": 0.31,
    "tentative": True,
    "set": ["coulomb_friction"],
    "sentence": "Dry friction.",
}
FIT = {
    "baseline_vaf_holdout": 98.46,
    "augmented_vaf_holdout": 99.94,
    "ceiling_vaf": 99.941,
    "gap_closed": 0.995,
    "remaining_predictable_share": 0.1265,
}
SOURCE = re.compile(r"[A-Z][\w'&.-]+( et al\.)?,?( \(| )(18|19|20)\d\d\b|By reasoning: ")


def fit(score, size):
    return SimpleNamespace(score=score, size=size, residual=np.zeros(100), values={})


def trial(name, found, bic):
    return Trial(name, found, 0.1, (0.1, 0.1), bic)


def test_a_term_that_fits_better_has_a_negative_change_of_bic_in_the_report():
    """In place of another term and in addition: 10 and 20 of BIC to the better and to the worse."""
    chosen = fit(1.0, 5)
    better, worse = (fit(float(np.exp(change / 100.0)), 5) for change in (-10.0, 20.0))
    effect = SimpleNamespace(
        trial=trial("maxwell_relaxation", chosen, -90.0),
        rivals=[trial("thixotropy", better, 0.0), trial("short_range_stiffness", worse, 0.0)],
    )
    near = [trial("tendon", better, -10.0), trial("backlash", worse, 20.0)]
    listed = alternatives(Found(chosen, chosen, effects=[effect], near=near))
    assert [entry["delta_score"] for entry in listed] == [10.0, -20.0, 10.0, -20.0]
    text = other_terms(listed)
    assert "below 0: it fits better" in text
    for name, how, change in (
        ("thixotropy", "instead of maxwell relaxation", "-10"),
        ("short range stiffness", "instead of maxwell relaxation", "+20"),
        ("tendon", "in addition", "-10"),
        ("backlash", "in addition", "+20"),
    ):
        assert f"<td>{name}</td><td>{how}</td><td>{change}</td>" in text


def test_the_headline_of_an_unexplained_recording_agrees_with_the_gap_that_is_closed():
    verdict = Verdict("unexplained", [EFFECT], fit=FIT)
    text = headline(SimpleNamespace(verdict=verdict))
    assert "do not account for all of it. Likeliest: intrinsic memory such as coulomb" in text
    assert "not in the library" not in text
    assert all(part[0].isupper() for part in re.split(r"(?<=[.]) (?=[A-Za-z])", text))
    assert "closes 99.5 % of the gap" in why_unexplained(verdict)
    assert "12.7 % of what it leaves can still be predicted" in why_unexplained(verdict)
    otherwise = {**FIT, "remaining_predictable_share": 0.0}
    assert "Remarks" in why_unexplained(Verdict("unexplained", [EFFECT], fit=otherwise))
    without = Verdict("unexplained", fit={**FIT, "gap_closed": 0.0})
    assert "no term of the library accounts for it" in headline(SimpleNamespace(verdict=without))
    assert why_unexplained(without) == ""
    assert why_unexplained(Verdict("explained", [EFFECT], fit=FIT)) == ""


@pytest.mark.parametrize(("probability", "word"), [(0.69, "Likeliest"), (0.7, "Stated")])
def test_only_what_is_said_with_confidence_is_called_stated(probability, word):
    effect = {**EFFECT, "family_probability": probability}
    text = "".join(effect_sections([effect]))
    assert f"{word}: intrinsic memory such as coulomb friction" in text
    said = headline(SimpleNamespace(verdict=Verdict("explained", [effect])))
    assert ("Likeliest: intrinsic" in said) == (word == "Likeliest")


def test_every_term_that_may_be_named_has_a_source_in_the_report():
    named = [t for t in term_library().values() if t.searched or t.flexible]
    assert len(named) > 30
    without = [t.name for t in named if not SOURCE.search("".join(equations([{"name": t.name}])))]
    assert not without


def test_a_vaf_near_100_keeps_the_digits_that_tell_it_from_another():
    shown = {91.04: "91.0", 98.22: "98.2", 99.9: "99.90", 99.9691: "99.969", 99.99991: "99.999910"}
    assert {vaf: vaf_text(vaf) for vaf in shown} == shown
    assert [vaf_text(vaf) for vaf in (100.0, -3.21, float("nan"))] == ["100.0", "-3.2", "-"]
    assert [rounded_vaf(vaf) for vaf in (91.0449, 99.969123)] == [91.04, 99.969]
    fit = {**FIT, "baseline_vaf_holdout": 99.961, "augmented_vaf_holdout": 99.989}
    assert re.findall(r"[\d.]+ %", explained(fit)) == ["99.961 %", "99.989 %", "99.941 %"]


def test_keys_of_the_verdict_are_words_with_units_in_the_report():
    where = {
        "path": "intrinsic",
        "window_s": [0.04, 0.2],
        "band_hz": [8.0, 30.0],
        "direction": "both",
        "symmetry": "odd",
        "depends_on": "size of the movement",
        "missing_block": {},
    }
    rows = location_rows(where)
    assert ["time after a movement begins", "40 to 200 ms"] in rows
    assert ["frequencies", "8 to 30 Hz"] in rows
    assert ["torque that is missing", "opposite in the two directions"] in rows
    unseen = location_rows({"window_s": "not seen", "band_hz": "not seen", "symmetry": "not seen"})
    assert [text for _, text in unseen] == ["not seen"] * 3
    varies = {
        "slow_torque": {"rms[N.m]": 0.0247},
        "tremor": {"frequency[Hz]": [8.1, 0.2]},
        "reflex_from_stretch_to_stretch": {
            "share_of_mean[1]": [0.12, 0.01],
            "timing[s]": [0.0018, 0.0003],
        },
    }
    assert variability_rows(varies) == [
        ["slow torque: root mean square [N·m]", "0.0247"],
        ["tremor: frequency [Hz]", "8.10 ± 0.20"],
        ["reflex from stretch to stretch: variation [% of the mean]", "12.0 ± 1.0"],
        ["reflex from stretch to stretch: variation of its time [ms]", "1.80 ± 0.30"],
    ]
    assert not re.search(r"_|\[1\]|\[s\]", str(rows) + str(variability_rows(varies)))


@pytest.mark.parametrize(
    ("remark", "said"),
    [
        ("footplate_inertia.Ip ended at the bound", "Ip of footplate inertia ended at the bound."),
        ("base model: reflex.omega ran", "Base model: omega of reflex ran."),
        (
            "cubic_stiffness_of_mine fits (K[N.m/rad] 80)",
            "Cubic_stiffness_of_mine fits (K[N.m/rad] 80).",
        ),
        (
            "hardening_stiffness would improve the fit.",
            "Hardening stiffness would improve the fit.",
        ),
    ],
)
def test_a_remark_is_a_sentence_with_the_names_of_terms_in_words(remark, said):
    assert sentence(remark) == said


def test_the_report_of_a_bad_recording_says_each_fault_once(null_recording, tmp_path):
    reasons = ["the torque has the wrong sign", "the clocks are apart"]
    recording = replace(null_recording, name="bad")
    diagnosis = SimpleNamespace(
        recording=recording,
        verdict=Verdict("bad_recording", reasons=reasons),
        found=None,
        criticism=None,
    )
    write_report(diagnosis, tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text().lower()
    assert [text.count(reason) for reason in reasons] == [1, 1]
    assert len(what_next(diagnosis)) == 1


def test_a_model_file_states_the_errors_that_hold_beside_those_of_its_terms(tmp_path):
    model = Model.of()
    for term, symbol in (("stiffness", "K"), ("reflex", "G")):
        model.entry(term).standard_errors = {symbol: 0.02}
    parameters = {
        "K[N.m/rad]": {"base": 77.0, "augmented": 80.03, "standard_error": 1.68},
        "B[N.m.s/rad]": {"base": 0.7, "augmented": 0.629, "standard_error": 0.019},
        "G[N.m.s/rad]": {"base": 12.0, "augmented": 11.98, "standard_error": None},
    }
    save_stated(model, parameters, tmp_path / "model.yaml")
    again = Model.load(tmp_path / "model.yaml")
    assert again.stated == {"K": (80.03, 1.68)}
    assert again.entry("stiffness").standard_errors == {"K": 0.02}
    text = (tmp_path / "model.yaml").read_text(encoding="utf-8")
    assert "holds only if the terms below are the right ones" in text.split("model:")[0]
    assert "K [N·m/rad]: 80.0 ± 1.7" in text
    assert "B [N·m·s/rad]: 0.629 ± 0.019" in text
    assert "G [N·m·s/rad]: 12.0\n" in text
    parameters.pop("K[N.m/rad]")
    save_stated(Model.of({"inertia": {}}), parameters, tmp_path / "other.yaml")
    assert Model.load(tmp_path / "other.yaml").stated == {}
