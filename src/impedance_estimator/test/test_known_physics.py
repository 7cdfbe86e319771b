"""What is known of rig and subject is undone: a simulated rig with delay, plate and straps, and a
joint with further terms, look like the joint's core alone.
"""

from datetime import datetime, timezone

import numpy as np
import pytest
from random_motion import CORE, random_motion
from scipy import signal

from ankle_physics.linear_dynamics import SecondOrder
from ankle_physics.model import Model, StatedValue
from ankle_physics.rig_file import Measured, RigFile
from ankle_physics.signals import Signals
from impedance_estimator.estimator import ESTIMATE_COLUMNS, ReflexColumns, SampleLayout
from impedance_estimator.joint_path import SMOOTHING
from impedance_estimator.known_physics import KnownPhysics, load_known_physics
from impedance_estimator.known_physics_run import KnownPhysicsRun
from impedance_estimator.known_physics_stream import KnownPhysicsStream
from impedance_estimator.simultaneous.gaussian_derivatives import (
    gaussian_derivatives,
    weighted_stretches,
)
from impedance_estimator.stream import EstimateStream
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 2048.0
LAYOUT = SampleLayout(RATE, True)


def motion(seconds=8.0):
    return random_motion(RATE, seconds)


def samples_of(model, x, v, a):
    signals = Signals(RATE, x, v, a)
    torque = model.start(RATE).torque(signals)
    return np.column_stack([np.arange(len(x)) / RATE, signals.measured_position, v, torque])


def smoothed(values):
    """A signal through the kernel that goes before further terms, late by half its length."""
    kernel = gaussian_derivatives(SMOOTHING, RATE)[0]
    held = np.concatenate([np.full(len(kernel) - 1, values[0]), values])
    return weighted_stretches(held, kernel)


def rig(terms, delay=0.0):
    return RigFile(
        "test",
        datetime(2026, 1, 1, tzinfo=timezone.utc),
        torque_delay=Measured(delay),
        model=Model.of(terms),
    )


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


def test_estimates_are_those_of_the_whole_joint_without_the_plate():
    hardening = {"hardening_stiffness": {}}
    known = KnownPhysics(rig({"footplate_inertia": {"Ip": 0.004}}), Model.of({**CORE, **hardening}))
    stream = KnownPhysicsStream(known, LAYOUT)
    samples = np.zeros((4096, 4))
    samples[:, 0] = np.arange(4096) / RATE
    samples[:, 1] = 0.1
    stream.correct(samples)
    stream.restate()
    rows = np.zeros((1, len(ESTIMATE_COLUMNS)))
    out = stream.complete(rows)[0]
    assert out[3] == pytest.approx(-0.004)
    assert out[1] == pytest.approx(known.added_stiffness(0.1, 0.0, 2.0))
    assert out[4] == 0.0


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


def test_the_operating_point_is_that_of_the_corrected_channels():
    hardening = {"hardening_stiffness": {"k3": 4000.0, "xc": 0.0}}
    known = KnownPhysics(
        RigFile("test", datetime(2026, 1, 1, tzinfo=timezone.utc), zero_position=0.1),
        Model.of({**CORE, **hardening}),
    )
    stream = KnownPhysicsStream(known, LAYOUT)
    samples = np.zeros((4096, 4))
    samples[:, 0] = np.arange(4096) / RATE
    samples[:, 1] = 0.1
    stream.correct(samples)
    stream.restate()
    # At the rig's zero the hardening spring has no stiffness yet.
    added = stream.complete(np.zeros((1, len(ESTIMATE_COLUMNS))))[0, 1]
    assert added == pytest.approx(0.0, abs=0.1)
    assert known.added_stiffness(0.1, 0.0, 2.0) > 50.0


@pytest.mark.parametrize("factor", [0.5, 1.0, 2.0])
def test_a_shaped_reflex_that_changes_is_followed_in_proportion(factor):
    """The regression sees the core alone; what is stated is the change of the whole reflex."""
    x, v, a = motion(12.0)
    shape = {"reflex_exponent": {"p": 1.6}}
    calibrated = Model.of({**CORE, **shape})
    now = Model.of({**CORE, "reflex": {"G": 10.0 * factor}, **shape})
    known = KnownPhysics(subject=calibrated)
    stream = KnownPhysicsStream(known, LAYOUT)
    out = stream.correct(samples_of(now, x, v, a))
    stream.restate()
    plain = samples_of(Model.of({"reflex": {"G": 10.0}}), x, v, a)[:, 3]
    rest = {name: CORE[name] for name in ("inertia", "viscosity", "stiffness")}
    left = out[:, 3] - samples_of(Model.of(rest), x, v, a)[:, 3]
    later = slice(round(2.0 * RATE), None)
    seen = np.polyfit(plain[later], left[later], 1)[0]
    rows = np.zeros((1, len(ESTIMATE_COLUMNS)))
    rows[0, 4], rows[0, ESTIMATE_COLUMNS.index("valid[1]")] = 10.0 * seen, 1.0
    stated = stream.complete(rows)[0, 4]
    total = 10.0 + known.added_gain(x.mean(), 0.0, 12.0)
    assert stated == pytest.approx(factor * total, rel=0.1)


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


def test_what_the_calibration_says_is_expected():
    core = {**CORE, "reflex": {"G": 10.0, "omega": 12.0, "z": 1.1, "delay": 0.052}}
    known = KnownPhysics(rig({"footplate_inertia": {"Ip": 0.004}}), Model.of(core))
    expected = known.expectation()
    assert expected.mean[2] == pytest.approx(0.0137 + 0.004)
    np.testing.assert_allclose(expected.mean[4:], [np.log(12.0), np.log(1.1), 0.052])
    # K, B and G are the subject's to change.
    assert np.isinf(expected.deviation[[0, 1, 3]]).all()
    assert np.isinf(KnownPhysics().expectation().deviation).all()


def error_of_gain(samples, known):
    """Relative error of G, whose true value is 10 N.m.s/rad."""
    rows = EstimateStream(known=known).feed_samples(samples, True, samples[:, 1]).rows
    return float(np.median(rows[-1000:, 4])) / 10.0 - 1.0


@pytest.mark.parametrize(
    ("sensor", "least_error_before"),
    [
        ({"torque_sensor_lag": {"T": 0.003}}, 0.03),
        ({"torque_sensor_lag": {"T": 0.0075}}, 0.15),
        ({"torque_sensor_lag": {"T": 0.012}}, 0.3),
        ({"torque_sensor_mode": {"frequency": 20.0, "damping": 0.1}}, 0.6),
    ],
    ids=["lag 3 ms", "lag 7.5 ms", "lag 12 ms", "mode 20 Hz"],
)
def test_the_reflex_answers_the_motion_before_the_known_sensor(
    sensor, least_error_before, monkeypatch
):
    """With the rig's file alone; a rectified lagged motion is no lagged rectified motion."""
    x, v, a = pulses(40.0)
    samples = samples_of(Model.of({**CORE, **sensor}), x, v, a)
    samples[:, 3] += np.random.default_rng(1).normal(0.0, 0.05, len(samples))
    known = KnownPhysics(rig(sensor))
    assert known.reflex_columns is ReflexColumns.STRETCH
    assert abs(error_of_gain(samples, known)) < 0.005
    monkeypatch.setattr(KnownPhysics, "reflex_columns", ReflexColumns.NONE)
    assert abs(error_of_gain(samples, known)) > least_error_before


def pulses(seconds):
    """The perturbation behind a servo of 30 Hz: position, velocity, acceleration."""
    reference = PulseStep(Settings(rate=RATE)).next(round(seconds * RATE))[:, 0]
    x = SecondOrder(RATE).run_with_rates(reference, 2.0 * np.pi * 30.0, 0.7)
    return x[0], x[1], x[2]


SHAPED = {
    **CORE,
    "reflex_exponent": {"p": 1.5},
    "reflex_stiffening": {"kr": 60.0},
    "plate_appendage": {"Ia": 0.004, "frequency": 25.0, "damping": 0.2},
    "short_range_stiffness": {"k": 60.0},
    "channel_skew": {"skew": 0.002},
}


def known_gains(**errors):
    """A calibrated subject whose reflex gain has a standard error."""
    model = Model.of(SHAPED)
    model.entry("reflex").standard_errors = errors
    model.entry("reflex_stiffening").standard_errors = {"kr": 6.0 * errors["G"]}
    return KnownPhysics(subject=model)


@pytest.mark.parametrize(("stiffness", "gain"), [(1.0, 1.0), (1.5, 1.0), (1.0, 0.4)])
def test_a_calibrated_reflex_is_followed_in_size_with_all_that_shapes_it(stiffness, gain):
    """Torque of another stiffness and reflex than the calibrated ones, and white noise."""
    x, v, a = motion(30.0)
    changed = {
        "stiffness": {"K": 100.0 * stiffness},
        "reflex": {"G": 10.0 * gain},
        "reflex_stiffening": {"kr": 60.0 * gain},
    }
    samples = samples_of(Model.of({**SHAPED, **changed}), x, v, a)
    samples[:, 3] += np.random.default_rng(1).normal(0.0, 0.05, len(samples))
    known = known_gains(G=0.5)
    assert known.models_reflex
    row = EstimateStream(known=known).feed_samples(samples, True).rows[-1]
    whole = 10.0 + known.added_gain(0.0, samples[:, 3].mean(), 15.0)
    assert row[1] == pytest.approx(100.0 * stiffness, rel=0.02)
    assert row[4] == pytest.approx(whole * gain, rel=0.04)
    assert row[3] == pytest.approx(0.0137, rel=0.05)


def test_a_reflex_that_the_calibration_hardly_saw_is_estimated_with_its_shape():
    assert not known_gains(G=5.0).models_reflex
    assert not KnownPhysics().models_reflex
    without = {name: CORE[name] for name in ("inertia", "viscosity", "stiffness")}
    assert not KnownPhysics(subject=Model.of(without)).models_reflex


def test_the_reference_is_an_instrument_for_a_modelled_reflex_too():
    """Torque that no movement causes pushes a plate whose servo gives way."""
    commanded, _, _ = motion(60.0)
    model = Model.of(SHAPED)
    pushed = 4.0 * motion_of_torque(60.0)
    x = commanded + pushed / 1000.0
    v = np.gradient(x, 1.0 / RATE)
    samples = samples_of(model, x, v, np.gradient(v, 1.0 / RATE))
    samples[:, 3] -= pushed
    known = known_gains(G=0.5)
    whole = 10.0 + known.added_gain(0.0, samples[:, 3].mean(), 15.0)
    errors = {}
    for name, reference in (("reference", commanded), ("none", None)):
        rows = EstimateStream(known=known).feed_samples(samples, True, reference).rows[-1000:]
        errors[name] = np.abs(np.median(rows[:, [1, 4]], axis=0) / [100.0, whole] - 1.0)
    assert np.all(errors["reference"] < 0.15)
    assert errors["none"].max() > 2.0 * errors["reference"].max()


def motion_of_torque(seconds):
    """Torque with the power of a muscle's, of unit size, that no movement causes."""
    random = np.random.default_rng(9)
    sections = signal.butter(2, [0.5, 5.0], "bandpass", fs=RATE, output="sos")
    torque = signal.sosfilt(sections, random.normal(size=round(seconds * RATE)))
    return torque / torque.std()
