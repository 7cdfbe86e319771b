"""Simulated trials of the three rigs, and the measures taken from estimates."""

import numpy as np
import pytest

from simulation_study.estimates import arrival, carry_out, rise_time
from simulation_study.intrinsic_prediction import (
    WINDOW,
    accuracy,
    after_stretch,
    motion,
    true_torque,
)
from simulation_study.rigs import RIGS, intrinsic_torque, record
from simulation_study.trial import INERTIA, VISCOSITY, Ankle, Course, Trial


def trial(rig="CE", seconds=20.0, **content):
    return Trial("a", rig, ("CE",), 3, seconds=seconds, **content)


def test_the_original_model_is_made_of_backward_differences():
    recording = record(trial("O", ankle=Ankle(G=0.0)))
    x = recording.clean[:, 0]
    v = np.diff(x, prepend=x[0]) * 1000.0
    a = np.diff(v, prepend=0.0) * 1000.0
    found, *_ = np.linalg.lstsq(np.column_stack([x, v, a]), recording.clean[:, 2], rcond=None)
    np.testing.assert_allclose(found, [100.0, VISCOSITY, INERTIA], rtol=1e-9)


@pytest.mark.parametrize("rig", ["O", "C", "CE"])
def test_noise_is_as_loud_as_the_paper_says(rig):
    recording = record(trial(rig))
    noise = recording.measured - recording.clean
    stated = RIGS[rig].signal_to_noise
    for column, decibel in ((0, stated.position), (2, stated.torque)):
        assert 20.0 * np.log10(
            recording.clean[:, column].std() / noise[:, column].std()
        ) == pytest.approx(decibel, abs=0.2)


@pytest.mark.parametrize("rig", ["O", "CE"])
def test_a_jump_is_in_truth_and_torque(rig):
    recording = record(trial(rig, course=Course("jump", at=10.0)))
    K = recording.truth["stiffness.K[N.m/rad]"]
    assert (K[0], K[-1]) == (50.0, 150.0)
    assert np.flatnonzero(K > 100.0)[0] / recording.rate == pytest.approx(10.0, abs=1e-3)
    torque, position = recording.parts["stiffness"], recording.clean[:, 0]
    late = recording.time > 15.0
    assert np.polyfit(position[late], torque[late], 1)[0] == pytest.approx(150.0, rel=0.01)


def test_a_sinusoid_keeps_its_range():
    recording = record(
        trial(course=Course("sinusoid", K=(70.0, 130.0), G=(7.0, 13.0), frequency=0.2))
    )
    G = recording.truth["reflex.G[N.m.s/rad]"]
    assert (G.min(), G.max()) == pytest.approx((7.0, 13.0), rel=1e-3)


def test_arrival_counts_delay_and_overshoot():
    time = np.arange(0.0, 30.0, 0.01)
    late = np.where(time < 12.0, 50.0, 145.0)
    assert arrival(time, late, (50.0, 150.0), at=10.0) == pytest.approx(2.0, abs=0.02)
    overshoot = np.where((time > 13.0) & (time < 14.0), 200.0, late)
    assert arrival(time, overshoot, (50.0, 150.0), at=10.0) == pytest.approx(4.0, abs=0.02)
    assert np.isnan(arrival(time, np.minimum(late, 130.0), (50.0, 150.0), at=10.0))


def test_rise_time_is_from_10_to_90_percent_of_the_jump():
    time = np.arange(0.0, 20.0, 0.01)
    values = np.interp(time, [5.0, 15.0], [50.0, 150.0])
    assert rise_time(time, values, (50.0, 150.0), at=5.0) == pytest.approx(8.0, abs=0.02)
    # A downward jump, and one that is never completed.
    assert rise_time(time, 200.0 - values, (150.0, 50.0), at=5.0) == pytest.approx(8.0, abs=0.02)
    assert np.isnan(rise_time(time, np.minimum(values, 130.0), (50.0, 150.0), at=5.0))


def test_an_overshoot_before_the_jump_does_not_count():
    time = np.arange(0.0, 20.0, 0.01)
    values = np.where(time < 2.0, 150.0, np.interp(time, [5.0, 15.0], [50.0, 150.0]))
    assert rise_time(time, values, (50.0, 150.0), at=5.0) == pytest.approx(8.0, abs=0.02)


def test_true_parameters_account_for_the_intrinsic_torque():
    recording = record(trial())
    parameters = np.array([100.0, VISCOSITY, INERTIA])
    predicted = motion(recording, measured_velocity=True, filtered=True) @ parameters
    settled = recording.time > 1.0
    assert accuracy(predicted[settled], true_torque(recording, filtered=True)[settled]) > 99.5
    half = motion(recording, measured_velocity=True, filtered=True) @ (0.5 * parameters)
    assert accuracy(half[settled], true_torque(recording, filtered=True)[settled]) == pytest.approx(
        75.0, abs=2.0
    )
    assert np.std(intrinsic_torque(recording)) > np.std(recording.parts["reflex"])


def test_windows_begin_with_the_stretches():
    recording = record(trial())
    velocity = recording.clean[:, 1]
    inside = after_stretch(velocity, recording.rate)
    starts = np.flatnonzero(inside[1:] & ~inside[:-1]) + 1
    assert 20.0 / 0.7 - 2 <= len(starts) <= 20.0 / 0.5
    assert np.all(velocity[starts] > 0.0)
    assert np.sum(inside) / recording.rate == pytest.approx(len(starts) * WINDOW, rel=0.05)


def test_a_trial_gives_the_same_numbers_again():
    content = Trial("a", "C", ("O", "C"), 5, seconds=40.0)
    first, second = carry_out(content), carry_out(content)
    assert first == second
    assert set(first["estimates"]) == {"O", "C"}
    assert first["estimates"]["C"]["mean"] == pytest.approx([100.0, 0.63, 0.0137, 10.0], rel=0.15)
