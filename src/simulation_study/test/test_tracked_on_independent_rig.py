"""A tracked term is followed on a rig whose relaxation is no code of this project's terms."""

import copy

import numpy as np
import pytest

from ankle_physics.model import Model
from blind_rig.impedance import true_impedance
from blind_rig.trial import record, run
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.offline.recorded_estimates import estimate_signal
from simulation_study.robustness.conditions import Condition, blind_trial

pytestmark = pytest.mark.slow


def test_relaxation_that_was_calibrated_too_large_is_followed_and_k_is_right():
    condition = Condition(
        "maxwell", "maxwell", "strong", "stiff", "1/f", 0.2, (1.0, 1.0), 20434788, 60.0
    )
    trial = blind_trial(condition)
    done = run(trial)
    samples = record(trial, done)
    truth = true_impedance(trial, done, 20.0, 50.0)
    muscle = trial.setup.muscle
    model = Model.of(
        {
            "inertia": {"I": truth.I},
            "viscosity": {"B": truth.B},
            "stiffness": {"K": truth.K},
            "reflex": {"G": truth.G},
            # The session's calibration found twice of it.
            "maxwell_relaxation": {"k": 2.0 * muscle.maxwell_k, "T": muscle.maxwell_tau},
        }
    )
    # The reflex of that rig is another one: its shape is estimated.
    model.entry("reflex").standard_errors = {"G": truth.G}
    found = {}
    for tracked in (True, False):
        used = copy.deepcopy(model)
        used.entry("maxwell_relaxation").tracked = tracked
        found[tracked] = estimate_signal(
            samples.time,
            samples.position,
            samples.velocity,
            samples.torque,
            reference=samples.reference[:, 0],
            known=KnownPhysics(subject=used),
        )
    _, k, error = found[True].tracked[-1]
    assert k == pytest.approx(muscle.maxwell_k, rel=0.1)
    assert abs(k - muscle.maxwell_k) < 4.0 * error
    K = {tracked: np.median(one.valid[one.valid[:, 0] > 40.0, 1]) for tracked, one in found.items()}
    assert K[True] == pytest.approx(truth.K, rel=0.06)
    assert K[False] < 0.85 * truth.K
