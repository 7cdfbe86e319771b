"""The servo of the independent rig, as the diagnosis reads it from a recording."""

import numpy as np
import pytest

from blind_rig.mechanics import servo_gains
from model_discrepancy.recording.motion import motion_step
from model_discrepancy.recording.servo import identify_servo
from simulation_study.verdict_cases import Plan, made, trial_of


def test_a_servo_that_gives_way_resonates_as_a_mass_on_a_spring():
    plan = Plan(
        "null", 0, 31, (), "compliant", "pulse_step", 1000.0, True, True, "quiet", "large", True
    )
    stiffness, damping, inertia = servo_gains(trial_of(plan)[0].setup)
    frequency = np.array([0.0, 5.0, 10.0, 20.0, 30.0])
    s = 2j * np.pi * frequency
    right = 1.0 / (inertia * s**2 + damping * s + stiffness)
    recording = made(plan).recording
    found = identify_servo(recording, motion_step(recording)).compliance.response(frequency)
    assert np.abs(found / right - 1.0) == pytest.approx(0, abs=0.1)
