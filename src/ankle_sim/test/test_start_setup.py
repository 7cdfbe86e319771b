"""What the node's start values make of rig, joint and subject."""

from datetime import datetime, timezone

import numpy as np
import pytest

from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from ankle_sim.live_rig import LiveRig
from ankle_sim.parameters import VOLUNTARY_TORQUE
from ankle_sim.start_setup import (
    declared_parameters,
    holds_from,
    make_model,
    parameters_of,
    setup_from,
    state_from,
)


def values_of(**changed):
    defaults = {one.name: one.default for one in declared_parameters(changed)}
    return {**defaults, **changed}


def test_values_of_parameters_reach_model_servo_and_noise():
    values = values_of(K=140.0, actuator_bandwidth=12.0, snr_torque=20.0, seed=7)
    setup = setup_from(make_model(values), values)
    assert setup.model.entry("stiffness").values["K"] == 140.0
    assert setup.servo.bandwidth == 12.0
    assert setup.signal_to_noise.torque == 20.0
    assert setup.seed == 7
    assert setup.scenario.title == ""
    assert setup.rig is None


def test_a_subject_brings_its_own_joint_and_its_holds():
    values = values_of(subject=3, holds=6, hold_duration=2.0, cocontraction=0.8)
    model = make_model(values)
    assert model.entry("inertia").values != make_model({}).entry("inertia").values
    assert {one.name for one in parameters_of(model)} >= {"K", "G", "cocontraction"}
    holds = holds_from(values)
    assert len(holds) == 6
    assert holds[0].end - holds[0].start == pytest.approx(2.0)
    assert state_from(values).cocontraction == 0.8


def test_a_plate_without_a_foot_has_what_the_rig_file_says_and_no_joint(tmp_path):
    rig = tmp_path / "rig.yaml"
    terms = Model.of({"footplate_inertia": {"Ip": 0.0042}})
    RigFile("a", datetime(2026, 1, 1, tzinfo=timezone.utc), model=terms).save(rig)
    model = make_model({"foot": False, "rig": str(rig)})
    assert model.entry("footplate_inertia").values["Ip"] == 0.0042
    assert not any(model.has(name) for name in ("inertia", "stiffness", "reflex"))
    with pytest.raises(ModelError, match="needs the parameter rig"):
        make_model({"foot": False})
    with pytest.raises(ModelError, match="give neither"):
        make_model({"foot": False, "rig": str(rig), "subject": 2})


def test_a_model_file_that_is_not_there_is_named(tmp_path):
    with pytest.raises((ModelError, OSError), match=r"missing\.yaml"):
        make_model({"model": str(tmp_path / "missing.yaml")})


def test_the_row_of_truth_has_nan_for_what_the_model_lacks():
    values = values_of(noise=False)
    setup = setup_from(make_model(values), values)
    setup.model.entries = [one for one in setup.model.entries if one.term.name != "reflex"]
    time = np.arange(32) / 2048.0
    (stretch,) = LiveRig(setup, print, noisy=False).take(time, np.zeros((32, 3)))
    assert stretch.truth_row[0] == time[-1]
    assert stretch.truth_row[1] == values["K"]
    assert np.isnan(stretch.truth_row[2])
    assert stretch.truth_row[3] == stretch.parts[VOLUNTARY_TORQUE]
