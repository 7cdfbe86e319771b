"""The subject's part of a diagnosed model."""

from dataclasses import replace
from datetime import datetime, timezone

import pytest

from ankle_physics.model import Model
from ankle_physics.rig_file import Measured, RigFile
from ankle_physics.term import term_library
from calibration.session_calibration import session_library, stated_values, subject_model
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
