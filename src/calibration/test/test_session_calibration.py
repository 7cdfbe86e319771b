"""The subject's part of a diagnosed model."""

from ankle_physics.model import Model
from calibration.session_calibration import subject_model


def test_rig_terms_stay_with_the_rig_and_what_the_subject_modulates_is_tracked():
    diagnosed = Model.of(
        {
            "inertia": {},
            "viscosity": {},
            "stiffness": {"K": 80.0},
            "reflex": {"G": 7.0},
            "fixation_compliance": {},
            "short_range_stiffness": {},
            "antagonist_reflex": {},
            "footplate_inertia": {},
            "torque_sensor_lag": {},
            "voluntary_torque": {},
        }
    )
    diagnosed.entry("stiffness").standard_errors = {"K": 1.5}
    model = subject_model(diagnosed, "subject 3")
    assert {entry.term.name: entry.tracked for entry in model.entries} == {
        "fixation_compliance": False,
        "inertia": True,
        "short_range_stiffness": False,
        "stiffness": True,
        "viscosity": True,
        "antagonist_reflex": True,
        "reflex": True,
    }
    assert model.entry("stiffness").standard_errors == {"K": 1.5}
    assert not diagnosed.entry("stiffness").tracked
