"""A velocity channel of another unit, sign or movement is seen, and a good or late one is not."""

import numpy as np
import pytest

from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from impedance_estimator.estimator import ESTIMATE_COLUMNS
from impedance_estimator.offline.recorded_estimates import estimate_signal
from impedance_estimator.velocity_watch import VelocityWatch
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 1024.0
DOUBT, K = (ESTIMATE_COLUMNS.index(name) for name in ("doubt[1]", "K[N.m/rad]"))


@pytest.fixture(scope="module")
def recorded():
    """Time, position, velocity and torque of a joint of 80 N.m/rad, 30 s."""
    reference = PulseStep(Settings(rate=RATE)).next(round(30.0 * RATE))
    model = Model.of({"inertia": {}, "viscosity": {}, "stiffness": {"K": 80.0}, "reflex": {}})
    made = simulate(reference, RATE, model, seed=1)
    return np.arange(len(reference)) / RATE, made.position, made.velocity, made.torque


CHANGES = {
    "good": (lambda v: v, ""),
    "5 ms late": (lambda v: np.roll(v, 5), ""),
    "a tenth too large": (lambda v: 1.1 * v, ""),
    "degrees": (np.degrees, "velocity is 57.3 times the change of position"),
    "another sign": (lambda v: -v, "not that of the position"),
    "another movement": (lambda v: np.roll(v, 3000), "not that of the position"),
    "holes": (lambda v: np.where(np.arange(len(v)) % 500 < 20, np.nan, v), ""),
}


@pytest.mark.parametrize("change", CHANGES)
@pytest.mark.parametrize("size", [7, 32, 100_000])
def test_what_it_says_of_a_velocity_does_not_depend_on_the_blocks(recorded, change, size):
    time, position, velocity, torque = recorded
    changed, said = CHANGES[change]
    samples = np.column_stack([time, position, changed(velocity), torque])
    watch = VelocityWatch(RATE)
    for k in range(0, len(samples), size):
        watch.add(samples[k : k + size])
    assert said in watch.complaint if said else watch.complaint == ""


def test_a_plate_at_rest_tells_nothing():
    samples = 1e-4 * np.random.default_rng(1).standard_normal((20_000, 4))
    watch = VelocityWatch(RATE)
    watch.add(samples)
    assert watch.complaint == ""


def test_every_estimate_from_a_velocity_of_another_unit_is_doubted_and_says_why(recorded):
    time, position, velocity, torque = recorded
    for factor, doubted in ((1.0, False), (10.0, True)):
        found = estimate_signal(time, position, factor * velocity, torque)
        late = found.valid[found.valid[:, 0] > 15.0]
        assert (late[:, DOUBT] == 1.0).all() == doubted
        assert any("another unit?" in one.doubts for one in found.judgements) == doubted


def test_a_torque_of_another_sign_is_doubted(recorded):
    time, position, velocity, torque = recorded
    found = estimate_signal(time, position, velocity, -torque)
    late = found.valid[found.valid[:, 0] > 15.0]
    assert late[-1, K] == pytest.approx(-80.0, rel=0.05)
    assert (late[:, DOUBT] == 1.0).all()
    assert any("K or I is negative" in one.doubts for one in found.judgements)
