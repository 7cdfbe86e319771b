"""Where physics is known, the whole joint is stated: its estimates, errors and expectations."""

from datetime import datetime, timezone

import numpy as np
import pytest
from random_motion import CORE
from simulated_rig import LAYOUT, RATE, rig

from ankle_physics.model import Model, StatedValue
from ankle_physics.rig_file import RigFile
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.known_physics_stream import KnownPhysicsStream


def stated_at(known, position):
    """Estimates of zero as the joint's, after two seconds at a position [rad]."""
    stream = KnownPhysicsStream(known, LAYOUT)
    samples = np.zeros((4096, 4))
    samples[:, 0] = np.arange(4096) / RATE
    samples[:, 1] = position
    stream.correct(samples)
    stream.restate()
    return stream.complete(np.zeros((1, len(ESTIMATE_COLUMNS))))[0]


def test_estimates_are_those_of_the_whole_joint_without_the_plate():
    hardening = {"hardening_stiffness": {}}
    known = KnownPhysics(rig({"footplate_inertia": {"Ip": 0.004}}), Model.of({**CORE, **hardening}))
    out = stated_at(known, 0.1)
    assert out[3] == pytest.approx(-0.004)
    assert out[1] == pytest.approx(known.added_stiffness(0.1, 0.0, 2.0))
    assert out[4] == 0.0


def test_the_operating_point_is_that_of_the_corrected_channels():
    hardening = {"hardening_stiffness": {"k3": 4000.0, "xc": 0.0}}
    known = KnownPhysics(
        RigFile("test", datetime(2026, 1, 1, tzinfo=timezone.utc), zero_position=0.1),
        Model.of({**CORE, **hardening}),
    )
    # At the rig's zero the hardening spring has no stiffness yet.
    assert stated_at(known, 0.1)[1] == pytest.approx(0.0, abs=0.1)
    assert known.added_stiffness(0.1, 0.0, 2.0) > 50.0


def test_standard_errors_hold_those_of_the_calibration():
    model = Model.of(CORE)
    model.entry("stiffness").standard_errors = {"K": 3.0}
    model.entry("reflex").standard_errors = {"G": 1.0}
    stream = KnownPhysicsStream(KnownPhysics(subject=model), LAYOUT)
    rows = np.zeros((1, len(ESTIMATE_COLUMNS)))
    rows[0, 4] = 20.0
    error_K, error_G = (ESTIMATE_COLUMNS.index(f"se_{n}") for n in ("K[N.m/rad]", "G[N.m.s/rad]"))
    rows[0, error_K], rows[0, error_G] = 4.0, 0.0
    stated = stream.complete(rows)[0]
    assert stated[error_K] == pytest.approx(5.0)
    # A tenth of the gain, whatever the gain is now.
    assert stated[error_G] == pytest.approx(2.0)


def test_the_errors_that_a_calibration_states_of_the_whole_joint_come_before_those_of_its_core():
    model = Model.of(CORE)
    model.entry("stiffness").standard_errors = {"K": 1.0}
    model.stated = {"K": StatedValue(100.0, 20.0), "G": StatedValue(10.0, 0.1)}
    known = KnownPhysics(subject=model)
    assert known.calibration_errors() == (20.0, pytest.approx(0.01))
    # 20 % of K lies beyond the limit of 14 %, by less than half of it.
    assert 0.5 < known.calibration_doubt < 1.0
    stream = KnownPhysicsStream(known, LAYOUT)
    rows = np.zeros((2, len(ESTIMATE_COLUMNS)))
    doubt = ESTIMATE_COLUMNS.index("doubt[1]")
    rows[1, doubt] = np.nan
    stated = stream.complete(rows)
    assert stated[0, doubt] == known.calibration_doubt
    assert np.isnan(stated[1, doubt])
    assert KnownPhysics(subject=Model.of(CORE)).calibration_doubt == 0.0


def test_what_the_calibration_says_is_expected():
    core = {**CORE, "reflex": {"G": 10.0, "omega": 12.0, "z": 1.1, "delay": 0.052}}
    known = KnownPhysics(rig({"footplate_inertia": {"Ip": 0.004}}), Model.of(core))
    expected = known.expectation()
    assert expected.mean[2] == pytest.approx(0.0137 + 0.004)
    np.testing.assert_allclose(expected.mean[4:], [np.log(12.0), np.log(1.1), 0.052])
    # K, B and G are the subject's to change.
    assert np.isinf(expected.deviation[[0, 1, 3]]).all()
    assert np.isinf(KnownPhysics().expectation().deviation).all()
