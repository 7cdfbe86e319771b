"""Torque that is read late, of a plate whose servo gives way and whose command nobody recorded."""

import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ankle_physics.model import Model
from model_discrepancy.diagnose import diagnose
from model_discrepancy.late_torque import late_torque
from model_discrepancy.problem import prepare
from model_discrepancy.recording.known_rig import on_time
from model_discrepancy.report.verdict import Verdict
from model_discrepancy.search.found import Found
from simulation_study.verdict_cases import Plan, made

LATE_S = 0.005


def recording_of(late, protocol="equal_steps", **conditions):
    """A recording of the independent rig without a mismatch but that its torque is late."""
    given = dict(velocity=False, reference=False, noise="quiet", variability="small", **conditions)
    made_so = made(Plan("null", 0, 9105, (), "compliant", protocol, 1000.0, **given)).recording
    return replace(made_so, torque=on_time(made_so.torque, made_so.rate, -late))


def test_a_delay_is_found_where_it_decides_which_movement_the_plate_made():
    late, error = late_torque(prepare(recording_of(LATE_S)))
    assert late == pytest.approx(LATE_S, abs=1e-4)
    assert error < 1e-4


def test_without_a_delay_none_is_looked_for(monkeypatch):
    problem = prepare(recording_of(0.0))
    monkeypatch.setattr(sys.modules[late_torque.__module__], "in_parallel", None)
    assert late_torque(problem) is None


@pytest.mark.parametrize(("alone", "kept"), [("no_mismatch", 0), ("explained", 1)])
def test_beside_a_channel_put_right_nothing_is_named_that_would_be_no_mismatch(
    null_recording, monkeypatch, alone, kept
):
    """A velocity channel that is late, and a search that named something."""
    stage = sys.modules[diagnose.__module__]
    late = replace(null_recording, velocity=np.roll(null_recording.velocity, 20))
    told = []

    def searched(problem, *_):
        found = Found(problem.base, problem.base, [SimpleNamespace()])
        found.base_held_out = found.final_held_out = None
        return found, None

    def criticise(problem, found, null, findings, progress):
        return SimpleNamespace(verdict=alone if not findings else "explained")

    def conclude(recording, problem, found, *_):
        told.append(found)
        return Verdict("explained")

    monkeypatch.setattr(stage, "_searched", searched)
    monkeypatch.setattr(stage, "criticise", criticise)
    monkeypatch.setattr(stage, "conclude", conclude)
    for unused in ("knows_movement_better", "better_reading", "with_better_course"):
        monkeypatch.setattr(stage, unused, lambda *_: None)
    monkeypatch.setattr(stage, "is_misshapen", lambda *_: False)
    monkeypatch.setattr(stage, "complete", lambda *_: None)
    diagnosis = diagnose(late)
    assert diagnosis.findings
    assert len(told[0].effects) == kept


@pytest.mark.slow
def test_it_is_named_and_put_right_and_stands_in_the_model(tmp_path):
    recording = recording_of(LATE_S, "pulse_step")
    truth = diagnose(recording_of(0.0, "pulse_step")).verdict.parameters["K[N.m/rad]"]
    verdict = diagnose(recording, tmp_path).verdict
    assert verdict.verdict == "explained"
    assert [effect["name"] for effect in verdict.effects] == ["channel_skew"]
    stiffness = verdict.parameters["K[N.m/rad]"]["augmented"]
    assert stiffness == pytest.approx(truth["augmented"], rel=0.01)
    (entry,) = [
        entry
        for entry in Model.load(tmp_path / "model.yaml").entries
        if entry.term.name == "channel_skew"
    ]
    assert entry.values["skew"] == pytest.approx(LATE_S, abs=1e-4)
