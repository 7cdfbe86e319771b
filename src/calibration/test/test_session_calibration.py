"""The subject's part of a diagnosed model, and a recording without its rig."""

from datetime import datetime, timezone

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.rig_file import Measured, RigFile
from calibration.session_calibration import subject_model, without_rig
from impedance_estimator.known_physics import KnownPhysics
from model_discrepancy.recording.recording import Recording

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
        "channel_skew": False,
    }
    assert model.entry("stiffness").standard_errors == {"K": 1.5}
    assert not found.entry("stiffness").tracked
    # Diagnosed with the plate in the torque.
    assert model.entry("inertia").values["I"] == pytest.approx(0.014)


def test_without_a_rig_file_what_was_found_of_the_rig_stays_and_the_estimator_takes_it():
    model = subject_model(diagnosed(), "subject 3")
    assert model.has("torque_sensor_lag")
    assert model.has("channel_skew")
    assert not model.has("voluntary_torque")
    assert model.entry("inertia").values["I"] == pytest.approx(0.018)
    assert KnownPhysics(RIG, model).plate_inertia == pytest.approx(0.004)


def test_a_rig_is_undone_before_its_recording_is_diagnosed():
    time = np.arange(4000) / 1000.0
    x = 0.02 * np.sin(2.0 * np.pi * 3.0 * time)
    late = 0.02 * np.sin(2.0 * np.pi * 3.0 * (time - 0.003))
    measured = Recording(1000.0, x + 0.1, 50.0 * late - 0.5, name="measured")
    undone = without_rig(measured, RIG)
    # The torque of a spring is in phase with the motion behind the sensor's lag, not before it.
    lag = np.arctan(2.0 * np.pi * 3.0 * 0.002)
    expected = 0.02 * np.cos(lag) * np.sin(2.0 * np.pi * 3.0 * (time - 0.003) - lag)
    np.testing.assert_allclose(undone.position[500:], expected[500:], atol=3e-5)
    np.testing.assert_allclose(undone.torque[500:], 50.0 * late[500:], atol=1e-3)
    assert without_rig(measured, None) is measured
