"""Concealed effects are named, nothing is named where nothing is missing, and the files say so."""

import json
import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.signal import butter, lfilter

from ankle_physics.memory_elements import BacklashOperator
from ankle_physics.model import PAPER_TERMS, Model
from ankle_physics.signals import Signals
from ankle_physics.virtual_rig import simulate
from model_discrepancy.criticism import criticism
from model_discrepancy.criticism.ceiling import unexplainable_power
from model_discrepancy.diagnose import diagnose
from model_discrepancy.problem import prepare
from model_discrepancy.recording.compliance import Compliance
from model_discrepancy.recording.recording import Recording
from model_discrepancy.report.html_report import explained, headline
from model_discrepancy.report.verdict import Verdict
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings
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
    "lost_motion",
    "cyclic_angle_error",
    "backlash",
)
"""Terms of every place; the whole library is searched where nothing is missing."""
FEW_RIVALS = RIVALS[:4]
RATE = 2048.0  # Hz
GAP = 0.004  # rad
PERIOD = 0.03  # rad


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


def test_the_headline_of_a_report_names_what_is_likely_and_counts_the_others():
    effect = {
        "name": "fixation_compliance",
        "stated": "resonance in the load path",
        "probability": 0.5,
        "family_probability": 0.57,
    }
    sure = {**effect, "stated": effect["name"], "probability": 0.88}
    weak = {**effect, "name": "tendon", "stated": "reflex lag", "family_probability": 0.21}
    verdict = Verdict("explained", [sure, weak, *(effect for _ in range(3)), weak])
    text = headline(SimpleNamespace(verdict=verdict))
    assert "fixation compliance (probability 0.88)" in text
    family = "resonance in the load path such as fixation compliance (probability 0.57)"
    assert text.count(family) == 2
    assert "1 more below" in text
    assert "2 less likely ones below" in text
    assert "tendon" not in text
    few = headline(SimpleNamespace(verdict=Verdict("unexplained", [effect])))
    assert "the library's terms do not account for all of it" in few
    assert "below" not in few
    best = headline(SimpleNamespace(verdict=Verdict("unexplained", [weak, weak])))
    assert "reflex lag such as tendon (probability 0.21)" in best
    assert "1 less likely one below" in best


def test_a_report_says_how_much_torque_is_explained_on_data_that_were_not_fitted():
    fit = {"baseline_vaf_holdout": 91.0, "augmented_vaf_holdout": 96.3, "ceiling_vaf": 97.2}
    assert re.findall(r"[\d.]+ %", explained(fit)) == ["91.0 %", "96.3 %", "97.2 %"]
    alone = explained({**fit, "augmented_vaf_holdout": 91.0})
    assert re.findall(r"[\d.]+ %", alone) == ["91.0 %", "97.2 %"]
    assert explained({}) == ""


@pytest.mark.parametrize(
    ("name", "values", "checked", "library"),
    [
        ("channel_skew", {"skew": 0.003}, {"skew": 0.05}, FEW_RIVALS),
        *(
            pytest.param(*case, RIVALS, marks=pytest.mark.slow)
            for case in (
                ("maxwell_relaxation", {"k": 35.0, "T": 0.1}, {"k": 0.1, "T": 0.15}),
                ("channel_skew", {"skew": 0.003}, {"skew": 0.05}),
                ("lost_motion", {"gap": 0.004}, {"gap": 0.1}),
            )
        ),
    ],
)
def test_a_planted_effect_is_named_with_its_size(
    tmp_path, undocumented_keys, name, values, checked, library
):
    recording = simulate_trial({name: values}, seed=5, duration=30.0)
    diagnosis = diagnose(recording, tmp_path, library=library)
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
    for key, symbol in (("K[N.m/rad]", "K"), ("G[N.m.s/rad]", "G")):
        assert model.stated[symbol].standard_error == verdict.parameters[key]["standard_error"]
    report = (tmp_path / "report.html").read_text()
    assert "http" not in report.replace("http-equiv", "")
    for section in ("Equations and sources", "excluded, and by what", "stiffness and reflex gain"):
        assert section in report
    content = json.loads((tmp_path / "verdict.json").read_text())
    assert undocumented_keys(content) == set()
    (effect,) = content["effects"]
    without, stiffness, error = effect["on_impedance"]["K[N.m/rad]"]
    assert stiffness == verdict.parameters["K[N.m/rad]"]["augmented"]
    assert without != stiffness
    assert error > 0.0
    assert effect["excluded"]
    assert not set(effect["excluded"]) & set(effect["set"])


def test_names_that_are_too_small_to_be_stated_widen_the_errors(monkeypatch):
    recording = simulate_trial({"channel_skew": {"skew": 0.003}}, seed=5, duration=30.0)
    monkeypatch.setattr(criticism, "judge", lambda *_: ("no_mismatch", float("nan")))
    diagnosis = diagnose(recording, library=("channel_skew",))
    assert diagnosis.verdict.effects == []
    assert any("errors allow for the values with it" in why for why in diagnosis.verdict.reasons)
    stated = diagnosis.verdict.parameters["K[N.m/rad]"]
    apart = abs(stated["augmented"] - diagnosis.found.final.values["stiffness"]["K"])
    assert apart > 5.0
    assert stated["standard_error"] > 0.6 * apart


def recorded_before(motor, plate, random, name):
    """An encoder on the motor's side, and the torque of the paper's model along the plate."""
    velocity = np.gradient(plate) * RATE
    signals = Signals(RATE, plate, velocity, np.gradient(velocity) * RATE)
    torque = Model.of({term: {} for term in PAPER_TERMS}).torque(signals)
    noise = random.standard_normal((2, len(torque)))
    noisy = torque + 0.02 * np.std(torque) * noise[1]
    return Recording(RATE, motor + 2e-5 * noise[0], noisy, name=name)


@pytest.mark.slow
def test_play_with_sharp_edges_in_the_drive_is_lost_motion():
    random = np.random.default_rng(8)
    steps = np.repeat(random.uniform(-0.03, 0.03, 240), round(0.25 * RATE))
    motor = lfilter(*butter(4, 40.0, fs=RATE), steps)
    # The plate's mass on the contact, without which it would jump.
    plate = lfilter(*butter(2, 150.0, fs=RATE), BacklashOperator().run(motor, GAP))
    recording = recorded_before(motor, plate, random, "loose shaft")
    found = diagnose(recording, library=RIVALS).found.final
    assert found.values["lost_motion"]["gap"] == pytest.approx(GAP, rel=0.15)


@pytest.mark.slow
def test_a_gear_whose_error_is_no_sine_is_a_cyclic_angle_error():
    random = np.random.default_rng(11)
    steps = np.repeat(random.uniform(-0.03, 0.03, 240), round(0.25 * RATE))
    motor = lfilter(*butter(4, 40.0, fs=RATE), steps)
    turn = 2.0 * np.pi / PERIOD
    plate = motor + 6e-4 * (np.sin(turn * motor) + 0.3 * np.sin(2.0 * turn * motor + 1.0))
    recording = recorded_before(motor, plate, random, "uneven gear")
    found = diagnose(recording, library=RIVALS).found
    assert found.effects[0].trial.name == "cyclic_angle_error"
    values = found.final.values["cyclic_angle_error"]
    assert values["p"] == pytest.approx(PERIOD, rel=0.1)
    assert np.hypot(values["s"], values["c"]) == pytest.approx(6e-4, rel=0.3)


@pytest.mark.slow
@pytest.mark.parametrize("holds_tell", [True, False])
def test_play_is_measured_behind_a_servo_that_gives_way(holds_tell, monkeypatch):
    """No command is recorded. Where the holds do not tell how the servo gives way, what a found
    model leaves clears the movement for another search.
    """
    if not holds_tell:
        monkeypatch.setattr(Compliance, "precise", property(lambda _: False))
    names = (*PAPER_TERMS, "voluntary_torque", "lost_motion", "servo_compliance")
    sizes = {
        "lost_motion": {"gap": GAP},
        "servo_compliance": {"k_a": 3000.0},
        # Little of the subject's own: most of what the base model leaves is the play's.
        "voluntary_torque": {"rms": 0.25},
    }
    reference = PulseStep(Settings(rate=RATE, seed=9)).next(int(40 * RATE))
    made = simulate(reference, RATE, Model.of({n: sizes.get(n, {}) for n in names}), seed=9)
    recording = Recording(RATE, made.position, made.torque, name="loose shaft")
    lines = []
    found = diagnose(recording, library=("lost_motion", "backlash"), progress=lines.append).found
    assert found.final.values["lost_motion"]["gap"] == pytest.approx(GAP, rel=0.15)
    again = any("movement that torque made is known better" in line for line in lines)
    assert again is not holds_tell


def test_a_bad_recording_gets_no_physics_story(null_recording, tmp_path):
    verdict = diagnose(replace(null_recording, torque=-null_recording.torque), tmp_path).verdict
    assert verdict.verdict == "bad_recording"
    assert verdict.effects == []
    assert "wrong sign" in (tmp_path / "report.html").read_text()
    assert not (tmp_path / "model.yaml").exists()


# A trial takes several minutes of one core.
@pytest.mark.slow
@pytest.mark.timeout(1200)
def test_both_real_trials_gain_on_unseen_data(real_recording):
    diagnosis = diagnose(real_recording)
    fit = diagnosis.verdict.fit
    # What is still predictable of them decides between the two.
    assert diagnosis.verdict.verdict in ("explained", "unexplained")
    assert diagnosis.verdict.effects
    assert fit["augmented_vaf_holdout"] > fit["baseline_vaf_holdout"] + 1.0
    assert fit["whitened_error_cut"] > 0.5
    assert np.isfinite(fit["remaining_predictable_share"])


def test_a_movement_that_never_comes_again_bounds_nothing():
    """Of a single sweep no two moments have the same history."""
    time = np.arange(40 * 1024) / 1024.0
    position = 0.02 * np.sin(2.0 * np.pi * (0.1 * time + 0.2 * time**2))
    velocity = np.gradient(position) * 1024.0
    torque = 80.0 * position + 0.8 * velocity + 0.014 * np.gradient(velocity) * 1024.0
    noise = 0.1 * np.random.default_rng(1).standard_normal(len(time))
    sweep = Recording(1024.0, position, torque + noise, name="sweep")
    problem = prepare(sweep)
    assert unexplainable_power(problem.fitter.columns, problem.base) == 0.0
