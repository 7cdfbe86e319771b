"""Relaxation, a bent and a late reflex stay out of K and G where they are there, and change nothing
where they are not.
"""

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from impedance_estimator.simultaneous.nuisance import BEND, EXTRAS, RELAXATION
from impedance_estimator.simultaneous.regression import INTRINSIC
from impedance_estimator.simultaneous.simultaneous_estimator import Simultaneous
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.random_steps import RandomSteps
from perturbation_generator.settings import Settings

RATE, SECONDS, MEMORY = 2048.0, 30.0, 10.0
K, G = 100.0, 10.0
CORE = {
    "inertia": {"I": 0.0137},
    "viscosity": {"B": 0.63},
    "stiffness": {"K": K},
    "reflex": {"G": G},
    "voluntary_torque": {},
}


def random_levels(settings):
    return RandomSteps(settings, smallest_level=0.1)


def estimated(extra, signal=PulseStep):
    reference = signal(Settings(rate=RATE)).next(round(SECONDS * RATE))
    recording = simulate(reference, RATE, Model.of({**CORE, **extra}), seed=1)
    estimator = Simultaneous(RATE, True)
    samples = np.column_stack([recording.time, recording.measured, reference[:, 0]])
    rows = estimator.process(samples)
    return estimator, rows[-1], recording


def added(estimator):
    """What the terms add: relaxation, bend, and the late reflex over the basis."""
    coefficients = estimator._state.nuisance.coefficients
    first = len(coefficients) - EXTRAS
    return (
        coefficients[first + RELAXATION],
        coefficients[first + BEND],
        coefficients[INTRINSIC:first],
    )


def test_an_ankle_that_is_the_model_gets_no_further_terms():
    estimator, row, _ = estimated({})
    relaxation, bend, late = added(estimator)
    assert abs(relaxation) < 0.02 * K
    assert bend == 0.0
    assert np.linalg.norm(late) < 0.05 * np.linalg.norm(estimator._state.response)
    assert row[[1, 4]] == pytest.approx([K, G], rel=0.05)


def test_stress_that_relaxes_is_no_stiffness():
    estimator, row, _ = estimated({"maxwell_relaxation": {"k": 40.0}})
    assert added(estimator)[0] == pytest.approx(40.0, rel=0.3)
    # Without the term K is a fifth too large.
    assert row[1] == pytest.approx(K, rel=0.07)


def test_a_late_reflex_is_part_of_g():
    estimator, row, _ = estimated({"long_latency_reflex": {"Gl": 4.0}})
    # Without the term G is a tenth too small.
    assert row[4] == pytest.approx(G + 4.0, rel=0.04)
    lag, response, _ = estimator.reflex_response.T
    assert np.sum(response) * (lag[1] - lag[0]) == pytest.approx(row[4], rel=0.02)
    late = lag > 0.25
    early_alone = estimated({})[0].reflex_response[:, 1]
    assert np.sum(response[late]) > 2.0 * np.sum(early_alone[late])


def test_a_bent_reflex_has_the_gain_of_its_torque_over_the_stretches_that_were_made():
    estimator, row, recording = estimated({"reflex_threshold": {"vt": 0.5}}, random_levels)
    memory = slice(round(-MEMORY * RATE), None)
    stretched = np.sum(np.maximum(recording.clean[memory, 1], 0.0))
    true = np.sum(recording.parts["reflex"][memory]) / stretched
    assert true < 0.8 * G
    assert added(estimator)[1] > 1.0
    assert row[4] == pytest.approx(true, rel=0.1)
    # The response that is shown is that to stretches of the mean velocity.
    lag, response, _ = estimator.reflex_response.T
    assert np.sum(response) * (lag[1] - lag[0]) == pytest.approx(row[4], rel=0.02)


def test_stretches_of_one_velocity_show_no_bend():
    estimator, row, recording = estimated({"reflex_threshold": {"vt": 0.5}})
    assert added(estimator)[1] == 0.0
    memory = slice(round(-MEMORY * RATE), None)
    stretched = np.sum(np.maximum(recording.clean[memory, 1], 0.0))
    true = np.sum(recording.parts["reflex"][memory]) / stretched
    assert row[4] == pytest.approx(true, rel=0.05)
