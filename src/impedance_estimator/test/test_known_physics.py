"""What is known of rig and subject is undone: a simulated rig with delay, plate and straps, and a
joint with further terms, look like the joint's core alone.
"""

import copy

import numpy as np
import pytest
from random_motion import CORE
from scipy import signal
from simulated_rig import LAYOUT, RATE, motion, rig, samples_of

from ankle_physics.model import Model, StatedAt, StatedValue
from ankle_physics.signals import Signals
from impedance_estimator.estimator import SampleLayout
from impedance_estimator.joint_path import SMOOTHING
from impedance_estimator.known_physics import KnownPhysics, load_known_physics
from impedance_estimator.known_physics_run import KnownPhysicsRun
from impedance_estimator.simultaneous.gaussian_derivatives import (
    gaussian_derivatives,
    weighted_stretches,
)


def smoothed(values):
    """A signal through the kernel that goes before further terms, late by half its length."""
    kernel = gaussian_derivatives(SMOOTHING, RATE)[0]
    held = np.concatenate([np.full(len(kernel) - 1, values[0]), values])
    return weighted_stretches(held, kernel)


def left_over(known, samples, expected):
    """Relative size of what is not undone, after the start, as the regression sees it: smoothed."""
    out = KnownPhysicsRun(known, LAYOUT).correct(samples)
    skip = round(1.0 * RATE)
    return np.std(smoothed(out[:, 3] - expected(out))[skip:]) / np.std(out[skip:, 3])


def test_terms_beside_the_core_are_subtracted():
    x, v, a = motion()
    extra = {"maxwell_relaxation": {"k": 60.0, "T": 0.08}, "coulomb_friction": {}}
    model = Model.of({**CORE, **extra})
    plain = samples_of(Model.of(CORE), x, v, a)[:, 3]
    known = KnownPhysics(subject=model)
    samples = samples_of(model, x, v, a)
    # Friction turns within the kernel.
    assert left_over(known, samples, lambda _: smoothed(plain)) < 0.015
    # Without the model the same samples are far from the core's.
    assert np.std(samples[:, 3] - plain) / np.std(plain) > 0.1


def test_a_shaped_reflex_leaves_the_plain_one():
    x, v, a = motion()
    model = Model.of({**CORE, "reflex_threshold": {}, "long_latency_reflex": {}})
    plain = samples_of(Model.of(CORE), x, v, a)[:, 3]
    known = KnownPhysics(subject=model)
    assert left_over(known, samples_of(model, x, v, a), lambda _: smoothed(plain)) < 0.01
    assert known.added_gain(0.0, 0.0, 10.0) != 0.0


def test_the_gain_of_the_calibrated_session_is_that_of_its_own_movement():
    """Its slow stretches hardly reach the threshold, while the usual steps lie far above it."""
    extra = {"reflex_threshold": {"vt": 1.0}, "position_reflex_gain": {"Gx": 40.0}}
    model = Model.of({**CORE, **extra})
    usual = KnownPhysics(subject=model)
    model.stated = {"G": StatedValue(2.5, 0.1)}
    model.stated_at = StatedAt(0.0, 4.0, 30.0)
    known = KnownPhysics(subject=model)
    assert known.calibrated_gain + known.added_gain(0.0, 4.0, 30.0) == pytest.approx(2.5)
    more = [k.added_gain(0.05, 4.0, 30.0) - k.added_gain(0.0, 4.0, 30.0) for k in (known, usual)]
    assert more[0] == pytest.approx(more[1])
    assert more[0] > 0.1


def test_the_stiffness_of_the_calibrated_session_is_the_one_that_it_states():
    """A missing block took a part of it, which belongs to the joint."""
    model = Model.of({**CORE, "hardening_stiffness": {"k3": 4000.0, "xc": 0.0}})
    plain = KnownPhysics(subject=copy.deepcopy(model))
    model.stated = {"K": StatedValue(150.0, 4.0)}
    model.stated_at = StatedAt(0.02, 4.0, 30.0)
    known = KnownPhysics(subject=model)
    core = model.entry("stiffness").values["K"]
    assert core + known.added_stiffness(0.02, 4.0, 30.0) == pytest.approx(150.0)
    assert core + plain.added_stiffness(0.02, 4.0, 30.0) < 140.0
    more = [
        k.added_stiffness(0.05, 4.0, 30.0) - k.added_stiffness(0.02, 4.0, 30.0)
        for k in (known, plain)
    ]
    assert more[0] == pytest.approx(more[1])
    assert more[0] > 10.0


def test_a_late_torque_is_even_with_the_motion_again():
    x, v, a = motion()
    known = KnownPhysics(rig=rig({}, delay=0.0031))
    late = samples_of(Model.of({**CORE, "channel_skew": {"skew": 0.0031}}), x, v, a)
    plain = samples_of(Model.of(CORE), x, v, a)
    shift = np.interp(plain[:, 0] - 0.0031, plain[:, 0], plain[:, 3])
    assert left_over(known, late, lambda _: shift) < 1e-3
    out = KnownPhysicsRun(known, LAYOUT).correct(late)
    skip = round(RATE)
    np.testing.assert_allclose(
        out[skip:, 1], np.interp(out[skip:, 0] - 0.0031, plain[:, 0], x), atol=1e-5
    )


@pytest.mark.parametrize("gain", [0.0, 10.0])
def test_straps_and_a_plate_are_undone(gain):
    """What is left is K, B and I along the foot's motion, and the reflex as it reaches the plate.

    With straps as soft as these the reflex pushes the foot aside, which is not in its motion here.
    """
    x, v, a = motion()
    terms = {
        **CORE,
        "reflex": {"G": gain},
        "fixation_compliance": {"k_s": 400.0, "b_s": 1.0},
        "footplate_inertia": {"Ip": 0.006},
    }
    signals = Signals(RATE, x, v, a)
    torque = Model.of(terms).start(RATE).torque(signals)
    samples = np.column_stack([np.arange(len(x)) / RATE, x, v, torque])
    out = KnownPhysicsRun(KnownPhysics(subject=Model.of(terms)), LAYOUT).correct(samples)
    foot, rate, left = out[:, 1], out[:, 2], out[:, 3]
    reflex = Model.of({"reflex": {"G": gain}}).torque(Signals(RATE, foot, rate, 0.0 * foot))
    regressors = np.column_stack([foot, rate, np.gradient(rate, 1.0 / RATE), reflex])[2048:-8]
    K, B, I, share = np.linalg.lstsq(regressors, left[2048:-8], rcond=None)[0]
    assert pytest.approx(100.0, rel=0.04 if gain else 0.005) == K
    assert pytest.approx(0.0137, rel=0.05) == I
    if gain:
        assert share == pytest.approx(400.0 / 500.0, rel=0.05)
    else:
        assert pytest.approx(0.63, rel=0.02) == B
        assert np.std((foot - smoothed(signals.foot_position))[2048:]) < 0.002 * np.std(x)


def test_what_acts_on_a_foot_behind_straps_moves_it():
    x, v, a = motion()
    model = Model.of(
        {
            **CORE,
            "reflex": {"G": 10.0},
            "fixation_compliance": {"k_s": 1000.0, "b_s": 1.0},
            "footplate_inertia": {"Ip": 0.006},
            "saturating_damping": {"D": 0.8, "vs": 0.4},
            "short_range_stiffness": {"k": 100.0, "yield": 0.003, "recovery": 0.1},
        }
    )
    model.entry("reflex").standard_errors["G"] = 0.1
    torque = model.start(RATE).torque(Signals(RATE, x, v, a))
    samples = np.column_stack([np.arange(len(x)) / RATE, x, v, torque, x])
    known = KnownPhysics(subject=model)
    out = KnownPhysicsRun(known, SampleLayout(RATE, True, known.reflex_columns)).correct(samples)
    foot, rate, left, reflex = out[:, 1], out[:, 2], out[:, 3], out[:, -2]
    columns = np.column_stack([foot, rate, np.gradient(rate, 1.0 / RATE), reflex, 1.0 + 0.0 * x])
    regressors, made = columns[2048:-8], left[2048:-8]
    K, _, _, size, _ = found = np.linalg.lstsq(regressors, made, rcond=None)[0]
    assert pytest.approx(100.0, rel=0.005) == K
    # Along the motion that the plate alone makes of the foot it is 0.984, and 0.036 is left.
    assert size == pytest.approx(1.0, rel=0.008)
    assert np.std(made - regressors @ found) < 0.015 * np.std(torque)


def test_the_result_does_not_depend_on_the_blocks_and_a_gap_begins_anew():
    x, v, a = motion(3.0)
    model = Model.of(
        {**CORE, "maxwell_relaxation": {}, "fixation_compliance": {}, "channel_skew": {}}
    )
    samples = samples_of(model, x, v, a)
    samples = np.delete(samples, slice(2000, 2300), axis=0)
    samples[4000, 3] = np.nan
    known = KnownPhysics(subject=model)
    whole = KnownPhysicsRun(known, LAYOUT).correct(samples)
    run = KnownPhysicsRun(known, LAYOUT)
    split = np.concatenate([run.correct(part) for part in np.array_split(samples, 97)])
    np.testing.assert_array_equal(whole, split)
    assert np.isnan(whole[4000, 3])
    # After the gap the path is at rest with the first sample.
    assert whole[2000, 1] == pytest.approx(samples[2000, 1], abs=0.02)


def test_the_rectified_velocity_behind_a_sensor_does_not_depend_on_the_blocks():
    x, v, a = motion(3.0)
    sensor = {"torque_sensor_mode": {"frequency": 30.0, "damping": 0.1}}
    samples = np.column_stack([samples_of(Model.of({**CORE, **sensor}), x, v, a), x])
    known = KnownPhysics(rig(sensor, delay=0.001))
    layout = SampleLayout(RATE, True, known.reflex_columns)
    whole = KnownPhysicsRun(known, layout).correct(samples)
    run = KnownPhysicsRun(known, layout)
    split = np.concatenate([run.correct(part) for part in np.array_split(samples, 97)])
    np.testing.assert_array_equal(whole, split)
    # Its mean is that of the rectified velocity, which the sensor passes on.
    assert np.mean(whole[:, 5]) == pytest.approx(np.mean(np.maximum(v, 0.0)), rel=0.02)


def test_no_files_are_no_known_physics(tmp_path):
    assert load_known_physics() is None
    Model.of(CORE).save(tmp_path / "subject.yaml")
    known = load_known_physics(str(tmp_path / "subject.yaml"))
    assert known is not None
    assert known.rig is None
    assert len(known.subject.entries) == 4


def test_a_gap_between_plate_and_foot_gives_the_motion_of_the_foot():
    x, v, a = motion(4.0)
    model = Model.of({**CORE, "backlash": {"gap": 0.004}})
    signals = Signals(RATE, x, v, a)
    torque = model.start(RATE).torque(signals)
    out = KnownPhysicsRun(KnownPhysics(subject=model), LAYOUT).correct(
        np.column_stack([np.arange(len(x)) / RATE, x, v, torque])
    )
    skip = round(RATE)
    assert np.std((out[:, 1] - signals.foot_position)[skip:]) < 1e-9
    assert np.std((x - signals.foot_position)[skip:]) > 0.001


LOOSE_SHAFT = {"lost_motion": {"gap": 0.004}}
UNEVEN_GEAR = {"cyclic_angle_error": {"s": 6e-4, "c": 8e-4, "p": 0.04, "xc": 0.01}}
YIELDING = {"recovering_lost_motion": {"gap": 0.004, "recovery": 0.3}}
UNEVEN_ANGLE = {"uneven_angle": {"e5": 1.5e-3, "e7": -1e-3, "e9": 2e-3, "span": 0.12, "xc": 0.0}}


@pytest.mark.parametrize(
    "drive",
    [
        LOOSE_SHAFT,
        UNEVEN_GEAR,
        {**UNEVEN_GEAR, **LOOSE_SHAFT},
        YIELDING,
        UNEVEN_ANGLE,
        {**YIELDING, **UNEVEN_ANGLE},
        {**UNEVEN_ANGLE, **YIELDING},
    ],
)
def test_a_loose_shaft_or_an_uneven_gear_gives_the_motion_of_the_plate(drive):
    x, v, a = motion(4.0)
    model = Model.of({**CORE, **drive, "footplate_inertia": {"Ip": 0.005}})
    signals = Signals(RATE, x, v, a)
    torque = model.start(RATE).torque(signals)
    known = KnownPhysics(subject=model)
    out = KnownPhysicsRun(known, LAYOUT).correct(
        np.column_stack([np.arange(len(x)) / RATE, x, v, torque])
    )
    skip = round(RATE)
    # The samples pass the kernel that the acceleration needs.
    apart = out[:, 1] - smoothed(signals.position)
    moved = np.std((x - signals.position)[skip:])
    assert moved > 4e-4
    assert np.std(apart[skip:]) < 0.1 * moved


def test_friction_keeps_its_torque_at_rest_however_noisy_the_encoder():
    """Steps and rests; between the steps only the encoder's noise moves."""
    level = np.repeat(np.random.default_rng(3).choice([-0.02, 0.02], 30), round(0.4 * RATE))
    smooth = signal.firwin(161, 15.0, fs=RATE)
    x = signal.lfilter(smooth, 1.0, level)
    v = np.gradient(x, 1.0 / RATE)
    model = Model.of({**CORE, "dahl_hysteresis": {"F": 2.0, "slide": 0.004}})
    samples = samples_of(model, x, v, np.gradient(v, 1.0 / RATE))
    plain = samples_of(Model.of(CORE), x, v, np.gradient(v, 1.0 / RATE))[:, 3]
    random = np.random.default_rng(4)
    samples[:, 1] += random.normal(0.0, 7e-5, len(x))
    samples[:, 2] += random.normal(0.0, 2e-3, len(x))
    # By the encoder alone a third of the torque would be left.
    assert left_over(KnownPhysics(subject=model), samples, lambda _: smoothed(plain)) < 0.12
