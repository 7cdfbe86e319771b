"""Concealed effects are named, nothing is named where nothing is missing, and the files say so."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ankle_physics.model import Model
from model_discrepancy.diagnose import diagnose
from model_discrepancy.report.html_report import explained, headline
from model_discrepancy.report.verdict import Verdict
from simulation_study.planted_trials import simulate_trial

RIVALS = (
    "channel_skew",
    "torque_sensor_lag",
    "torque_sensor_mode",
    "partial_sensor_mode",
    "plate_appendage",
    "maxwell_relaxation",
    "fractional_damping",
    "asymmetric_damping",
    "coulomb_friction",
    "position_dependent_stiffness",
    "reflex_threshold",
    "long_latency_reflex",
)
"""Terms of every place; the whole library is searched where nothing is missing."""


def test_no_mismatch_is_recognised(null_recording, tmp_path):
    diagnosis = diagnose(null_recording, tmp_path)
    content = json.loads((tmp_path / "verdict.json").read_text())
    assert content["verdict"] == "no_mismatch"
    assert content["effects"] == []
    low, high = content["fit"]["ceiling_vaf_interval"]
    assert low <= high <= 100.0
    assert abs(content["fit"]["baseline_vaf_holdout"] - high) < 1.0
    assert "no structure is left" in (tmp_path / "report.html").read_text()
    assert not diagnosis.criticism.before.significant


def test_the_headline_of_a_report_names_the_first_effects_and_counts_the_others():
    effect = {
        "name": "fixation_compliance",
        "stated": "resonance in the load path",
        "probability": 0.5,
        "family_probability": 0.57,
    }
    sure = {**effect, "stated": effect["name"], "probability": 0.88}
    verdict = Verdict("explained", [sure, *(effect for _ in range(4))])
    text = headline(SimpleNamespace(verdict=verdict))
    assert "fixation compliance (probability 0.88)" in text
    family = "resonance in the load path such as fixation compliance (probability 0.57)"
    assert text.count(family) == 2
    assert "2 more below" in text
    few = headline(SimpleNamespace(verdict=Verdict("unexplained", [effect])))
    assert "not in the library" in few
    assert "more" not in few


def test_a_report_says_how_much_torque_is_explained_on_data_that_were_not_fitted():
    fit = {"baseline_vaf_holdout": 91.0, "augmented_vaf_holdout": 96.3, "ceiling_vaf": 97.2}
    assert re.findall(r"[\d.]+ %", explained(fit)) == ["91.0 %", "96.3 %", "97.2 %"]
    alone = explained({**fit, "augmented_vaf_holdout": 91.0})
    assert re.findall(r"[\d.]+ %", alone) == ["91.0 %", "97.2 %"]
    assert explained({}) == ""


@pytest.mark.parametrize(
    ("name", "values", "checked"),
    [
        pytest.param(
            "maxwell_relaxation",
            {"k": 35.0, "T": 0.1},
            {"k": 0.1, "T": 0.15},
            marks=pytest.mark.slow,
        ),
        ("channel_skew", {"skew": 0.003}, {"skew": 0.05}),
    ],
)
def test_a_planted_effect_is_named_with_its_size(tmp_path, name, values, checked):
    recording = simulate_trial({name: values}, seed=5, duration=30.0)
    diagnosis = diagnose(recording, tmp_path, library=RIVALS)
    verdict = diagnosis.verdict
    assert verdict.verdict == "explained"
    assert [e["name"] for e in verdict.effects] == [name]
    fitted = diagnosis.found.final.values[name]
    for symbol, tolerance in checked.items():
        assert fitted[symbol] == pytest.approx(values[symbol], rel=tolerance)
    assert verdict.fit["augmented_vaf_holdout"] > verdict.fit["baseline_vaf_holdout"]
    model = Model.load(tmp_path / "model.yaml")
    assert model.has(name)
    assert model.entry(name).standard_errors
    report = (tmp_path / "report.html").read_text()
    assert "http" not in report.replace("http-equiv", "")
    for section in ("Equations and sources", "excluded, and by what", "stiffness and reflex gain"):
        assert section in report
    (effect,) = json.loads((tmp_path / "verdict.json").read_text())["effects"]
    without, stiffness, error = effect["on_impedance"]["K[N.m/rad]"]
    assert stiffness == verdict.parameters["K[N.m/rad]"]["augmented"]
    assert without != stiffness
    assert error > 0.0
    assert effect["excluded"]
    assert not set(effect["excluded"]) & set(effect["set"])


def test_a_bad_recording_gets_no_physics_story(null_recording, tmp_path):
    verdict = diagnose(replace(null_recording, torque=-null_recording.torque), tmp_path).verdict
    assert verdict.verdict == "bad_recording"
    assert verdict.effects == []
    assert "wrong sign" in (tmp_path / "report.html").read_text()
    assert not (tmp_path / "model.yaml").exists()


@pytest.mark.slow
def test_both_real_trials_gain_on_unseen_data(real_recording):
    diagnosis = diagnose(real_recording)
    fit = diagnosis.verdict.fit
    assert diagnosis.verdict.verdict == "explained"
    assert fit["augmented_vaf_holdout"] > fit["baseline_vaf_holdout"] + 1.0
    assert fit["whitened_error_cut"] > 0.5
    assert np.isfinite(fit["remaining_predictable_share"])
