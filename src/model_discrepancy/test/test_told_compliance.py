"""How far a servo gives way is known in all recordings of a rig of which one tells it."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from model_discrepancy.problem import prepare
from model_discrepancy.recording.compliance import COMPLIANCE_POLES_S, Compliance
from model_discrepancy.recording.drive_mode import DriveMode
from model_discrepancy.recording.recording import Recording
from model_discrepancy.tools import several_recordings
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 512.0
# 2500 N.m/rad, with a mode that tells its course over frequency.
WEIGHTS = np.zeros(1 + len(COMPLIANCE_POLES_S))
WEIGHTS[0] = 4e-4
TOLD = Compliance(RATE, WEIGHTS, (4e-4, 1e-6), mode=DriveMode(40.0, 0.7))
LESS_WELL = replace(TOLD, magnitude=(4e-4, 5e-6))


def recorded(reference):
    core = {"inertia": {}, "viscosity": {}, "stiffness": {"K": 60.0}, "reflex": {}}
    model = Model.of({**core, "voluntary_torque": {}})
    made = simulate(reference, RATE, model, seed=1)
    return Recording(RATE, made.position, made.torque, made.velocity, name="no command")


def without_rest():
    time = np.arange(round(20.0 * RATE)) / RATE
    lines = np.arange(0.3, 8.0, 0.7)
    phases = 2.0 * np.pi * np.random.default_rng(2).random(len(lines))
    waves = np.sin(2.0 * np.pi * np.outer(time, lines) + phases)
    command = 0.006 * waves.sum(axis=1)
    slope = np.gradient(command, 1.0 / RATE)
    return np.column_stack([command, slope, np.gradient(slope, 1.0 / RATE)])


def test_a_movement_without_rest_has_the_compliance_of_another_recording():
    moving = recorded(without_rest())
    alone = prepare(moving)
    assert alone.told_compliance is None
    assert alone.in_a_loop
    told = prepare(moving, compliance=TOLD)
    assert told.compliance is TOLD
    assert not told.in_a_loop
    # The weights are those of its rate.
    assert prepare(moving, compliance=replace(TOLD, rate=1024.0)).compliance is None


def test_a_recording_whose_holds_tell_keeps_its_own(monkeypatch):
    own = replace(TOLD, magnitude=(2e-4, 1e-6))
    monkeypatch.setattr("model_discrepancy.problem.held_compliance", lambda *_: own)
    held = recorded(PulseStep(Settings(rate=RATE)).next(round(20.0 * RATE)))
    assert prepare(held, compliance=TOLD).compliance is own


@pytest.mark.parametrize(
    ("told", "given"), [([None, LESS_WELL, TOLD], [TOLD]), ([None, None], []), ([TOLD, TOLD], [])]
)
def test_the_recordings_that_do_not_tell_have_it_from_the_one_that_tells_best(
    told, given, monkeypatch
):
    made = []

    def member(number, rig, progress, found, reading, compliance=None):
        made.append(compliance)
        return SimpleNamespace(problem=SimpleNamespace(told_compliance=told[number]))

    monkeypatch.setattr(several_recordings, "_member", member)
    several_recordings._members(range(len(told)), None, lambda _: None)
    assert made[len(told) :] == given
