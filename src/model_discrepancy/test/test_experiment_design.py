"""A design keeps within the generator's limits, tells models apart by what they predict, and
settles a real ambiguity.
"""

import json

import numpy as np
import pytest
import yaml

from ankle_physics.joint_profile import ANKLE, JointProfile
from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from model_discrepancy.diagnose import diagnose
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.recording import Recording
from model_discrepancy.tools.candidate_movements import Candidate, candidates_for
from model_discrepancy.tools.experiment_design import (
    Design,
    design_experiment,
)
from model_discrepancy.tools.movement_ranking import Proposal, RivalSet, percent, rank
from perturbation_generator.limits import Limits
from simulation_study.planted_trials import simulate_trial

PAPER = {e.term.name: dict(e.values) for e in Model.of().entries}
CONDITIONS = {
    "movement[rad]": 0.04,
    "movement_rms[rad]": 0.013,
    "background_torque[N.m]": 0.0,
    "whitening_rate[Hz]": 200.0,
    "whitening[1/N.m]": [20.0, -10.0],
}


def typical(name):
    return dict(Model.of({name: {}}).entries[0].values)


def test_candidates_keep_within_the_limits():
    candidates = candidates_for(0.04, levels=True)
    assert {c.parameters["signal"] for c in candidates} == {
        "pulse_step",
        "random_steps",
        "prbs",
        "multisine",
    }
    assert any(c.levels for c in candidates)
    for candidate in candidates[::5]:
        reference = candidate.reference(20.0)
        assert np.abs(reference[:, 0]).max() <= Limits.amplitude
        assert np.abs(reference[:, 2]).max() <= Limits.acceleration
    # Over 0.5 rad nothing is allowed.
    assert candidates_for(1.0, levels=False) == []


def test_no_movement_is_much_larger_than_what_was_recorded():
    """One-sided pulses stay at the end of a range that random levels rarely reach."""
    rare, usual = (
        {c.title for c in candidates_for(0.03, levels=False, rms=rms)} for rms in (0.009, 0.014)
    )
    larger = {title for title in usual - rare if "over 60 mrad" in title}
    assert rare < usual
    assert larger == usual - rare
    assert any(title.startswith("pulses and steps over 60 mrad") for title in larger)
    assert any(title.startswith("sum of sines") and "over 60 mrad" in title for title in rare)
    assert usual == {c.title for c in candidates_for(0.03, levels=False)}


def test_equal_models_cannot_be_told_apart_and_different_ones_can(monkeypatch):
    few = [Candidate("steps", {"signal": "random_steps", "amplitude": 0.03, "direction": "both"})]
    monkeypatch.setattr("model_discrepancy.tools.movement_ranking.candidates_for", lambda *_: few)
    relaxing = {**PAPER, "maxwell_relaxation": typical("maxwell_relaxation")}
    late = {**PAPER, "long_latency_reflex": typical("long_latency_reflex")}
    (same,) = rank([RivalSet({"a": relaxing, "b": relaxing}, 0.0)], CONDITIONS)
    (other,) = rank([RivalSet({"a": relaxing, "b": late}, 0.0)], CONDITIONS)
    assert same.excess < 1e-6
    assert other.excess > 1e-3
    assert other.refitted


def test_the_slowest_movements_can_be_drawn(tmp_path):
    """Their longest cycle is longer than what the picture shows."""
    slowest = [c for c in candidates_for(0.09, levels=False) if "150 ms" in c.title]
    assert slowest
    for number, candidate in enumerate(slowest):
        proposals = [Proposal(candidate, 0.01, 1.0, ("a", "b"), {("a", "b"): 0.01}, True)]
        Design([], proposals, []).save(tmp_path / str(number))
        assert (tmp_path / str(number) / "design.yaml").is_file()


def test_what_is_no_verdict_is_refused(tmp_path):
    with pytest.raises(DiagnosisError, match="not a verdict"):
        design_experiment(tmp_path)
    (tmp_path / "verdict.json").write_text(json.dumps({"verdict": "bad_recording"}))
    with pytest.raises(DiagnosisError, match="record again"):
        design_experiment(tmp_path)


@pytest.mark.parametrize(
    ("verdict", "tentative", "needs"),
    [
        ("mismatch", True, "maxwell relaxation) needs a second recording of the same kind"),
        ("mismatch", False, "nothing open that needs a second recording"),
        ("unexplained", False, "What is missing has no name yet"),
    ],
)
def test_a_verdict_without_rivals_says_what_needs_another_recording(
    tmp_path, verdict, tentative, needs
):
    effect = {"name": "maxwell_relaxation", "set": ["maxwell_relaxation"], "tentative": tentative}
    content = {
        "verdict": verdict,
        "effects": [effect],
        "alternatives": [],
        "recording": {"duration[s]": 60.0, **CONDITIONS},
    }
    (tmp_path / "verdict.json").write_text(json.dumps(content))
    Model.of().save(tmp_path / "model.yaml")
    found = design_experiment(tmp_path).sentences
    assert needs in found[-1]
    assert ("nothing open" in found[-1]) is (verdict == "mismatch" and not tentative)


def test_a_rival_that_runs_away_is_told_apart_without_an_absurd_number():
    runaway = PAPER | {"stiffness": PAPER["stiffness"] | {"K": 1e9}}
    sets = [RivalSet({"tendon": PAPER, "position_reflex_gain": runaway}, 0.0)]
    proposals = rank(sets, CONDITIONS, made=[c.title for c in candidates_for(0.04, False)[2:]])
    assert max(proposals[0].pairs.values()) == 10.0
    assert "at least 1000.0 % more" in Design(sets, proposals, []).sentence


@pytest.mark.slow
def test_the_proposed_perturbation_settles_a_set(tmp_path):
    """Steps of one size and speed do not tell a reflex threshold from an exponent; the second
    recording does.
    """
    planted = {"reflex_threshold": {}}
    first = simulate_trial(planted, seed=11, duration=60.0, protocol="equal")
    (effect,) = diagnose(first, tmp_path / "first").verdict.effects
    assert "reflex_threshold" in effect["set"]
    assert len(effect["set"]) > 1
    design = design_experiment(tmp_path / "first")
    design.save(tmp_path / "design")
    parameters = yaml.safe_load((tmp_path / "design" / "design.yaml").read_text())[
        "perturbation_generator"
    ]["ros__parameters"]
    reference = Candidate("proposed", parameters).reference(60.0)
    model = Model.of({**PAPER, **planted, "voluntary_torque": {"rms": 0.3}})
    second = simulate(reference, 2048.0, model, seed=12)
    verdict = diagnose(Recording(2048.0, second.position, second.torque, second.velocity)).verdict
    assert [e["set"] for e in verdict.effects] == [["reflex_threshold"]]


def verdict_folder(tmp_path, joint, rival, conditions):
    """Write a verdict with one open set and its model, in the units of a joint."""
    with joint.in_force():
        chosen = Model.of({"inertia": {}, "viscosity": {}, "coulomb_friction": {}})
        chosen.save(tmp_path / "model.yaml")
    values = {e.term.name: dict(e.values) for e in chosen.entries}
    other = {name: given for name, given in values.items() if name != "coulomb_friction"}
    content = {
        "verdict": "explained",
        "effects": [{"name": "coulomb_friction"}],
        "alternatives": [
            {
                "name": rival,
                "instead_of": "coulomb_friction",
                "delta_score": -1.0,
                "model": {**other, rival: {}},
            }
        ],
        "recording": {"duration[s]": 60.0, **conditions},
    }
    (tmp_path / "verdict.json").write_text(json.dumps(content))


def test_a_term_that_the_library_lacks_is_named_with_the_option_that_reads_it(tmp_path):
    verdict_folder(tmp_path, ANKLE, "own_cable", CONDITIONS)
    with pytest.raises(
        DiagnosisError, match=r"verdict\.json names the term 'own_cable', which.*--t"
    ):
        design_experiment(tmp_path)
    model = (tmp_path / "model.yaml").read_text()
    (tmp_path / "model.yaml").write_text(model.replace("coulomb_friction", "own_cable"))
    with pytest.raises(DiagnosisError, match=r"model\.yaml names the term 'own_cable', .*--terms"):
        design_experiment(tmp_path)


def test_a_verdict_on_an_axis_is_designed_for_in_its_own_units(tmp_path, monkeypatch):
    axis = JointProfile(
        "axis", "m", "N", inertia_range=(1.0, 100.0), torque_scale=1000.0, terms=("inertia",)
    )
    conditions = {axis.in_units(name): value for name, value in CONDITIONS.items()}
    verdict_folder(tmp_path, axis, "saturating_damping", conditions)
    few = [
        Candidate(
            "steps over 40 mrad",
            {"signal": "random_steps", "amplitude": 0.02, "direction": "both"},
        )
    ]
    monkeypatch.setattr("model_discrepancy.tools.movement_ranking.candidates_for", lambda *_: few)
    for function in ("separating_measurements", "repetition"):
        monkeypatch.setattr(f"model_discrepancy.tools.experiment_design.{function}", lambda _: [])
    monkeypatch.setattr(
        "model_discrepancy.tools.movement_ranking._excesses",
        lambda *_, **__: {("coulomb_friction", "saturating_damping"): 0.2},
    )
    found = design_experiment(tmp_path)
    assert "steps over 40 mm" in found.sentence
    found.save(tmp_path / "design")
    assert "40 mm" in (tmp_path / "design" / "design.yaml").read_text()


def test_an_excess_beyond_what_is_expected_is_only_said_to_be_larger():
    assert percent(0.0312) == "3.1"
    assert percent(10.0) == "1000.0"
    assert percent(186.5) == "more than 1000"
