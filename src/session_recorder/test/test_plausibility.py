"""Sign and units of torque follow from an ankle whose reflexes are stronger than its stiffness."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from session_recorder.importing.plausibility import check_intrinsic, intrinsic

RATE = 1000.0  # Hz
RELAXED = {
    "inertia": {"I": 0.014},
    "viscosity": {},
    "stiffness": {"K": 20.0},
    "reflex": {"G": 14.0},
}


@pytest.fixture(scope="module")
def relaxed():
    """Position and torque under steps that a binary sequence draws, every 0.2 s."""
    levels = np.random.default_rng(5).choice([-0.03, 0.03], 300)
    steps = np.repeat(levels, int(0.2 * RATE))
    position = sosfiltfilt(butter(2, 20.0, fs=RATE, output="sos"), steps)
    velocity = np.gradient(position, 1 / RATE)
    reference = np.column_stack([position, velocity, np.gradient(velocity, 1 / RATE)])
    made = simulate(reference, RATE, Model.of({**RELAXED, "voluntary_torque": {}}), seed=3)
    return made.position, made.torque


def test_inertia_and_stiffness_are_those_of_the_ankle_and_not_of_its_reflexes(relaxed):
    found = intrinsic(RATE, *relaxed)
    assert found.inertia == pytest.approx(0.014, rel=0.1)
    assert found.stiffness == pytest.approx(20.0, rel=0.25)
    assert check_intrinsic(found, "rig") == []


def test_torque_of_the_other_sign_is_found_beside_strong_reflexes(relaxed):
    position, torque = relaxed
    found = intrinsic(RATE, position, -torque)
    assert "the torque's sign is not 'rig'" in check_intrinsic(found, "rig")[0]


def test_an_ankle_that_moves_the_other_way_is_the_same_ankle(relaxed):
    """Which direction stretches the calf is not known before the import."""
    position, torque = relaxed
    found = intrinsic(RATE, -position, -torque)
    assert found.stiffness == pytest.approx(20.0, rel=0.25)


@pytest.mark.parametrize(("sign", "expected"), [(1.0, 1), (-1.0, -1)])
def test_a_resonance_in_the_band_does_not_turn_the_sign(sign, expected):
    """Above the resonance of a soft plate its load moves against it."""
    soft = {"fixation_compliance": {"k_s": 200.0, "b_s": 0.2}, "inertia": {"I": 0.03}}
    joint = Model.of({"viscosity": {"B": 0.7}, "stiffness": {"K": 70.0}, **soft})
    levels = np.random.default_rng(6).choice([-0.03, 0.03], 200)
    position = sosfiltfilt(
        butter(2, 30.0, fs=RATE, output="sos"), np.repeat(levels, int(0.3 * RATE))
    )
    velocity = np.gradient(position, 1 / RATE)
    reference = np.column_stack([position, velocity, np.gradient(velocity, 1 / RATE)])
    made = simulate(reference, RATE, joint, seed=4)
    found = intrinsic(RATE, made.position, sign * made.torque)
    assert found.inertia * sign < -0.005
    assert found.sign == expected
    assert bool(check_intrinsic(found, "rig")) is (sign < 0.0)


def test_units_are_told_where_viscosity_alone_is_negative(relaxed):
    """Late torque, or a reflex, turns the sign of viscosity round, and not that of inertia."""
    found = replace(intrinsic(RATE, *relaxed), viscosity=-0.5, viscosity_error=0.01, upright=0.8)
    assert found.contradicts_itself
    assert check_intrinsic(found, "rig") == []
    in_degrees = replace(found, inertia=found.inertia / 57.3, inertia_error=1e-6)
    assert "the units" in check_intrinsic(in_degrees, "rig")[0]


def test_noise_is_not_explained_by_movement(relaxed):
    position, _ = relaxed
    noise = np.random.default_rng(7).standard_normal(len(position))
    assert intrinsic(RATE, position, noise) is None


def test_a_resonance_that_multiplies_the_inertia_is_no_wrong_unit(relaxed):
    """A leg that gives way swings at 8 Hz, and is seen with the foot."""
    found = replace(intrinsic(RATE, *relaxed), inertia=0.3, inertia_error=0.004, upright=0.8)
    assert "the units" in check_intrinsic(found, "rig")[0]
    swinging = replace(found, viscosity=-7.5, viscosity_error=0.4)
    assert check_intrinsic(swinging, "rig") == []
    assert "the units" in check_intrinsic(replace(swinging, inertia=1.1), "rig")[0]
