"""The rig of a trial with its plate empty."""

import numpy as np
import pytest

from blind_rig.anatomy import Setup
from blind_rig.empty_plate import empty_plate, record_empty_plate
from blind_rig.mechanics import cell_stiffness
from blind_rig.protocols import Protocol, command
from blind_rig.trial import STEPS_PER_SAMPLE, Trial

RATE = 1000.0


def test_the_cell_stays_as_it_is():
    for changes in ({}, {"rig.strap_k": 400.0, "rig.strap_b": 1.0}, {"rig.cell_hz": 60.0}):
        setup = Setup().replaced(changes)
        assert cell_stiffness(empty_plate(setup)) == pytest.approx(cell_stiffness(setup), rel=1e-3)


def test_the_torque_of_an_empty_plate_is_that_of_its_inertia():
    trial = Trial(
        Setup().replaced({"sensors.torque_snr": 60.0, "sensors.position_snr": 80.0}),
        Protocol("random_levels", 0.04, 0.024, 8.0),
        RATE,
        0.1,
        3,
    )
    rate = RATE * STEPS_PER_SAMPLE[RATE]
    angle, _ = command(trial.protocol, np.random.default_rng(1), rate)
    made = record_empty_plate(trial, angle)
    acceleration = np.gradient(np.gradient(made.position - 0.1, 1.0 / RATE), 1.0 / RATE)
    regressors = np.column_stack([made.position - 0.1, acceleration])
    K, inertia = np.linalg.lstsq(regressors, made.torque, rcond=None)[0]
    assert inertia == pytest.approx(trial.setup.rig.plate_inertia, rel=0.05)
    assert abs(K) < 1.0
