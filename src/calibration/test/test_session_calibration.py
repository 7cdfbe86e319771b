"""The subject's part of a diagnosed model."""

from dataclasses import replace
from datetime import datetime, timezone

import pytest

from ankle_physics.joint_profile import JointProfile
from ankle_physics.model import Model, StatedValue
from ankle_physics.rig_file import Measured, RigFile
from ankle_physics.term import term_library
from calibration.errors import CalibrationError
from calibration.session_calibration import (
    CalibratedSession,
    require_subject,
    session_library,
    stated_values,
    subject_model,
)
from calibration.session_statements import described_session, session_warnings
from impedance_estimator.known_physics import KnownPhysics

RIG = RigFile(
    "test",
    datetime(2026, 1, 1, tzinfo=timezone.utc),
    torque_delay=Measured(0.003),
    zero_position=0.1,
    zero_torque=-0.5,
    model=Model.of({"footplate_inertia": {"Ip": 0.004}, "torque_sensor_lag": {"T": 0.002}}),
)


def diagnosed():
    model = Model.of(
        {
            "inertia": {"I": 0.018},
            "viscosity": {},
            "stiffness": {"K": 80.0},
            "reflex": {"G": 7.0},
            "fixation_compliance": {},
            "antagonist_reflex": {},
            "footplate_inertia": {},
            "torque_sensor_lag": {},
            "channel_skew": {},
            "voluntary_torque": {},
        }
    )
    model.entry("stiffness").standard_errors = {"K": 1.5}
    return model


def test_what_the_rig_file_states_is_left_to_it_and_the_core_is_tracked():
    found = diagnosed()
    model = subject_model(found, "subject 3", RIG)
    assert {entry.term.name: entry.tracked for entry in model.entries} == {
        "fixation_compliance": False,
        "inertia": True,
        "stiffness": True,
        "viscosity": True,
        "antagonist_reflex": False,
        "reflex": True,
    }
    assert model.entry("stiffness").standard_errors == {"K": 1.5}
    assert not found.entry("stiffness").tracked


def test_without_a_rig_file_what_was_found_of_the_rig_stays_and_the_estimator_takes_it():
    model = subject_model(diagnosed(), "subject 3")
    assert model.has("torque_sensor_lag")
    assert model.has("channel_skew")
    assert not model.has("voluntary_torque")
    assert model.entry("inertia").values["I"] == pytest.approx(0.018)
    assert KnownPhysics(RIG, model).plate_inertia == pytest.approx(0.004)


def test_what_a_diagnosis_states_of_the_whole_joint_is_handed_on_with_its_errors():
    parameters = {
        "K[N.m/rad]": {"base": 90.0, "augmented": 80.0, "standard_error": 9.0},
        "G[N.m.s/rad]": {"base": 5.0, "augmented": 7.0, "standard_error": None},
        "B[N.m.s/rad]": {"base": 1.0, "augmented": 1.1, "standard_error": 0.1},
    }
    assert stated_values(parameters) == {"K": (80.0, 9.0)}


def test_what_an_empty_plate_would_have_shown_of_the_sensor_is_not_found_of_a_subject():
    # A file that no recording gave says nothing of what it leaves out.
    assert session_library(RIG) == session_library(None)
    names = session_library(replace(RIG, bag="plate_empty"))
    sensor = {"torque_sensor_lag", "torque_sensor_mode", "partial_sensor_mode", "channel_skew"}
    assert not sensor & set(names)
    assert {"fixation_compliance", "plate_appendage", "maxwell_relaxation"} <= set(names)


def test_a_session_is_calibrated_without_what_follows_the_torque_of_the_muscles():
    without = set(term_library()) - set(session_library(None))
    assert without == {"activation_reflex_gain", "activation_stiffness"}


def required(K, I, **parameters):
    model = Model.of({"stiffness": {"K": K}, "inertia": {"I": I}})
    require_subject(model, parameters, "visit 2")


def test_a_recording_without_a_subject_is_refused_with_the_least_plausible_value():
    required(80.0, 0.018)
    with pytest.raises(
        CalibrationError, match=r"K = 0\.014 N\.m/rad is less than 1 N\.m/rad, the least .*'ankle'"
    ):
        required(0.014, 0.018)
    with pytest.raises(CalibrationError, match=r"I = 0\.0002 kg\.m\^2 is less than 0\.00125 kg"):
        required(80.0, 0.0002)
    # All of the stiffness may be one with memory: the subject is there.
    required(0.0, 0.018, **{"K_effective[N.m/rad]": {"augmented": 60.0}})
    with JointProfile.load("wrist").in_force():
        required(0.3, 0.0005)
        with pytest.raises(CalibrationError, match=r"less than 0\.25 N\.m/rad.*'wrist'"):
            required(0.2, 0.0005)


def calibrated(K_error, G_error, verdict="no_mismatch"):
    model = Model.of({"stiffness": {"K": 80.0}, "reflex": {"G": 7.0}})
    model.stated = {"K": StatedValue(80.0, K_error), "G": StatedValue(7.0, G_error)}
    parameters = {
        "G[N.m.s/rad]": {"augmented": 7.0, "standard_error": G_error},
        "K[N.m/rad]": {"augmented": 80.0, "standard_error": K_error},
        "K_effective[N.m/rad]": {"augmented": 91.0, "standard_error": None},
    }
    return CalibratedSession(model, {"verdict": verdict, "effects": [], "parameters": parameters})


def test_k_and_g_are_shown_with_errors_and_where_later_estimates_will_be_doubted():
    lines = [" ".join(line.split()) for line in described_session(calibrated(2.0, 0.5))]
    assert lines == [
        "K[N.m/rad] 80 ± 2",
        "K_effective[N.m/rad] 91 without a standard error",
        "G[N.m.s/rad] 7 ± 0.5",
        "with standard errors above 14 % of K or 12 % of G, every later estimate would be doubted",
    ]
    assert described_session(calibrated(2.0, 1.0))[-1] == (
        "the standard errors are above 14 % of K or 12 % of G: every later estimate will be doubted"
    )


def test_a_value_that_is_hardly_known_and_an_unexplained_verdict_are_said():
    assert session_warnings(calibrated(2.0, 0.5)) == []
    unknown, gain = session_warnings(calibrated(19.0, 2.1, "unexplained"))
    assert "'unexplained'" in unknown
    assert gain.startswith("G = 7 ± 2.1 N.m.s/rad is known to 30 % only, more than 25 %")
