"""K, B, I, G and the effective stiffness against differences of simulated torque."""

import numpy as np
import pytest

from ankle_physics.impedance import (
    Movement,
    OperatingPoint,
    effective_stiffness,
    impedance,
    reflex_gain,
)
from ankle_physics.model import Model
from ankle_physics.signals import Signals
from ankle_physics.term import Owner, term_library

RATE = 2048.0
JOINT = {
    "inertia": {"I": 0.012},
    "viscosity": {"B": 0.8},
    "stiffness": {"K": 90.0, "x0": 0.02},
    "reflex": {"G": 9.0},
}


def held_torque(values, angle, activation=0.0, seconds=20.0):
    """Torque after the plate was held at an angle for long, everything relaxed."""
    n = int(seconds * RATE)
    still = np.zeros(n)
    signals = Signals(RATE, np.full(n, angle), still, still, np.full(n, activation))
    return Model.of(values).torque(signals)[-1]


def static_slope(values, angle, activation=0.0):
    d = 1e-4
    upper = held_torque(values, angle + d, activation)
    return (upper - held_torque(values, angle - d, activation)) / (2 * d)


@pytest.mark.parametrize(
    "extra",
    [
        {},
        {"hardening_stiffness": {"k3": 3e4, "xc": 0.01}},
        {"position_dependent_stiffness": {"k1": 400.0}},
        {"activation_stiffness": {"ka": 5.0, "xc": 0.03}},
        {"gravity": {"m": 4.0, "level": 0.2}},
        {"maxwell_relaxation": {"k": 40.0, "T": 0.2}},
        {"fixation_compliance": {"k_s": 900.0}, "hardening_stiffness": {"k3": 3e4}},
    ],
)
def test_k_is_the_slope_of_the_held_torque_of_the_foot(extra):
    values = JOINT | extra
    foot = 0.06
    torque = held_torque({k: v for k, v in values.items() if k != "fixation_compliance"}, foot, 4.0)
    plate = foot + (torque / 900.0 if "fixation_compliance" in extra else 0.0)
    at = OperatingPoint(position=plate, torque=torque, activation=4.0)
    joint_alone = {k: v for k, v in values.items() if k != "fixation_compliance"}
    stiffness = impedance(Model.of(values), at).K
    assert stiffness == pytest.approx(static_slope(joint_alone, foot, 4.0), rel=2e-3)


def test_a_drift_is_stated_in_the_middle_of_the_recording():
    values = JOINT | {"stiffness_drift": {"kt": -0.5}, "reflex_drift": {"Gt": 0.05}}
    found = impedance(Model.of(values), OperatingPoint(time=60.0))
    stiffness, gain = found.K, found.G
    assert (stiffness, gain) == pytest.approx((75.0, 10.5), rel=0.02)


def test_b_and_i_are_slopes_against_velocity_and_acceleration():
    values = JOINT | {
        "asymmetric_damping": {"b": 0.4},
        "coulomb_friction": {"F": 1.0},
        "footplate_inertia": {"Ip": 0.004},
        "torque_sensor_mode": {"frequency": 30.0},
    }
    found = impedance(Model.of(values))
    viscosity, inertia = found.B, found.I
    assert (viscosity, inertia) == pytest.approx((0.8 + 0.2, 0.012))


def stretch_area(values, size=0.04, rise=0.024, position=0.0, activation=0.0):
    """Integral of the reflex torque after one stretch over the angle stretched."""
    time = np.arange(int(4.0 * RATE)) / RATE
    s = np.clip((time - 1.0) / rise, 0.0, 1.0)
    x = position + size * s**3 * (10.0 - 15.0 * s + 6.0 * s**2)
    v = np.gradient(x, time)
    signals = Signals(RATE, x, v, np.gradient(v, time), np.full(len(x), activation))
    run = Model.of(values).start(RATE)
    run.torque(signals)
    reflexes = [n for n in run.parts if term_library()[n].place.value == "reflex dynamics"]
    return sum(run.parts[n].sum() for n in reflexes) / RATE / size


@pytest.mark.parametrize(
    ("extra", "tolerance"),
    [
        ({}, 1e-3),
        ({"reflex_threshold": {"vt": 0.5}}, 0.02),
        ({"reflex_saturation": {"vs": 0.8}}, 0.02),
        ({"reflex_exponent": {"p": 0.6}}, 0.05),
        ({"tendon": {"T": 0.03}}, 0.01),
        ({"long_latency_reflex": {"Gl": 4.0}}, 1e-3),
        ({"activation_reflex_gain": {"Gn": 1.2}}, 1e-3),
    ],
)
def test_g_is_the_area_of_the_response_to_a_stretch(extra, tolerance):
    at = OperatingPoint(activation=3.0)
    assert reflex_gain(Model.of(JOINT | extra), at) == pytest.approx(
        stretch_area(JOINT | extra, activation=3.0), rel=tolerance
    )


def slow_swings(size):
    """A minute of slow sines: velocities up to 0.8 rad/s at 0.04 rad."""
    time = np.arange(60 * int(RATE)) / RATE
    x, v, a = (np.zeros_like(time) for _ in range(3))
    for frequency, phase in ((0.7, 0.0), (1.9, 1.0), (3.1, 2.0)):
        rate = 2.0 * np.pi * frequency
        x += size / 3 * np.sin(rate * time + phase)
        v += size / 3 * rate * np.cos(rate * time + phase)
        a -= size / 3 * rate**2 * np.sin(rate * time + phase)
    return Movement(RATE, x, v, a)


@pytest.mark.parametrize(
    "extra",
    [
        {},
        {"reflex_threshold": {"vt": 0.3}},
        {"reflex_exponent": {"p": 2.5}},
        {"reflex_saturation": {"vs": 0.2}},
        {"reflex_drift": {"Gt": 0.05}},
    ],
)
def test_g_of_a_recorded_movement_is_its_torque_for_each_radian_of_stretch(extra):
    model, moved = Model.of(JOINT | extra), slow_swings(0.04)
    found = reflex_gain(model, OperatingPoint(movement=moved))
    still = np.zeros(len(moved.position))
    run = model.start(RATE)
    run.torque(Signals(RATE, moved.position, moved.velocity, moved.acceleration, still))
    later = slice(round(4.0 * RATE), None)
    area = run.parts["reflex"][later].sum()
    area += run.parts["reflex_drift"][later].sum() if "reflex_drift" in extra else 0.0
    met = area / np.maximum(moved.velocity[later], 0.0).sum()
    assert found == pytest.approx(met, rel=0.02)


def test_g_of_a_reflex_with_a_threshold_follows_the_velocities_of_the_recording():
    model = Model.of(JOINT | {"reflex_threshold": {"vt": 0.3}})
    gains = [
        reflex_gain(model, OperatingPoint(movement=slow_swings(size)))
        for size in (0.01, 0.04, 0.16)
    ]
    assert gains[0] < 0.1 < gains[1] < 0.5 * gains[2]
    assert 3.0 < gains[2] < 9.0


def test_a_depressed_reflex_has_a_lower_gain_the_faster_stretches_follow():
    model = Model.of(JOINT | {"reflex_depression": {"size": 0.05, "recovery": 1.0}})
    gains = [reflex_gain(model, OperatingPoint(pause=pause)) for pause in (0.2, 0.5, 2.0)]
    assert gains[0] < gains[1] < gains[2] < 9.0


def test_responses_to_the_other_direction_and_to_position_are_no_reflex_gain():
    extra = {"antagonist_reflex": {"Ga": 5.0}, "position_reflex": {"Gp": 60.0}}
    assert reflex_gain(Model.of(JOINT | extra), OperatingPoint()) == pytest.approx(9.0, rel=1e-3)
    assert reflex_gain(Model.of({"stiffness": {}}), OperatingPoint()) == 0.0


def test_effective_stiffness_is_k_for_a_spring_and_holds_what_k_leaves_out():
    at = OperatingPoint()
    assert effective_stiffness(Model.of(JOINT), at) == pytest.approx(90.0, rel=1e-3)
    slow = JOINT | {"maxwell_relaxation": {"k": 40.0, "T": 5.0 / 3.0}}
    assert effective_stiffness(Model.of(slow), at) == pytest.approx(130.0, rel=0.02)
    fast = JOINT | {"maxwell_relaxation": {"k": 40.0, "T": 0.004}}
    assert effective_stiffness(Model.of(fast), at) == pytest.approx(90.0, rel=0.02)
    straps = JOINT | {"fixation_compliance": {"k_s": 500.0}}
    series = 90.0 * 500.0 / 590.0
    assert effective_stiffness(Model.of(straps), at) == pytest.approx(series, rel=0.05)
    stiffness = impedance(Model.of(straps)).K
    assert stiffness == pytest.approx(90.0)


def test_every_term_says_to_whom_it_belongs():
    rig = {name for name, term in term_library().items() if term.belongs_to is Owner.RIG}
    assert rig == {
        "channel_skew",
        "coulomb_friction",
        "cyclic_angle_error",
        "footplate_friction",
        "footplate_gravity",
        "footplate_inertia",
        "friction_turning",
        "lost_motion",
        "partial_sensor_mode",
        "plate_appendage",
        "recovering_lost_motion",
        "servo_compliance",
        "torque_sensor_lag",
        "torque_sensor_mode",
        "uneven_angle",
    }


def test_a_tracked_term_stays_so_in_its_file(tmp_path):
    model = Model.of(JOINT)
    model.entry("stiffness").tracked = True
    model.save(tmp_path / "subject.yaml")
    read = Model.load(tmp_path / "subject.yaml")
    assert [entry.term.name for entry in read.entries if entry.tracked] == ["stiffness"]
