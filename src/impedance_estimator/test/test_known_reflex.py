"""The reflex of a known rig and subject: behind the torque's sensor, with all that shapes it."""

import numpy as np
import pytest
from random_motion import CORE
from scipy import signal
from simulated_rig import LAYOUT, RATE, motion, rig, samples_of

from ankle_physics.errors import ModelError
from ankle_physics.linear_dynamics import SecondOrder
from ankle_physics.model import Model
from impedance_estimator.estimator import ESTIMATE_COLUMNS, ReflexColumns
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.known_physics_stream import KnownPhysicsStream
from impedance_estimator.stream import EstimateStream
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings


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


@pytest.mark.parametrize(
    "found",
    [
        {"reflex_drift": {"Gt": -0.4}},
        {"stiffness_drift": {"kt": -2.0}},
        {"settling_stiffness": {"kt": -2.0, "T": 30.0}},
        {"cyclic_stiffness": {"kc": 40.0, "frequency": 0.2}},
        {"activation_reflex_gain": {"Gn": 3.0}},
        {"activation_stiffness": {"ka": 20.0}},
    ],
    ids=lambda found: next(iter(found)),
)
def test_what_followed_time_or_torque_in_the_calibration_is_not_continued(found):
    """A reflex that went on weakening at this rate would be gone after 55 s, and the movement makes
    more of the torque here than muscles would.
    """
    x, v, a = pulses(60.0)
    samples = samples_of(Model.of(CORE), x, v, a)
    samples[:, 3] += np.random.default_rng(1).normal(0.0, 0.05, len(samples))
    subject = Model.of({**CORE, **found})
    subject.entry("reflex").standard_errors = {"G": 0.3}
    rows = EstimateStream(known=KnownPhysics(subject=subject)).feed_samples(samples, True).rows
    later = rows[rows[:, 0] > 20.0]
    assert np.abs(later[:, 1] - 100.0).max() < 2.0
    assert np.abs(later[:, 4] - 10.0).max() < 0.3


@pytest.mark.parametrize(
    ("name", "gain"), [("stiffness_drift", "kt"), ("activation_stiffness", "ka")]
)
def test_what_follows_time_or_torque_cannot_be_tracked(name, gain):
    subject = Model.of({**CORE, name: {gain: 2.0}})
    subject.entry(name).tracked = True
    with pytest.raises(ModelError, match="follows neither time nor the torque of the muscles"):
        KnownPhysics(subject=subject)
