"""Reference streams with gaps, damaged samples, other rates; noise from a nominal run; parameters
of the node.
"""

import numpy as np
import pytest

from ankle_physics.actuator import Servo
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import SignalToNoise
from ankle_physics.virtual_rig import simulate
from ankle_sim.live_rig import LiveRig, Setup
from ankle_sim.parameters import model_parameters, with_voluntary_torque
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

RATE = 2048.0
START = 1_700_000_000.25  # s; as large as ROS time


def setup(scenario=None, **values):
    return Setup(
        with_voluntary_torque(Model.of(values or None)),
        Servo(),
        SignalToNoise(),
        scenario or Scenario([]),
        0.04,
        seed=1,
    )


def reference(duration, rate=RATE):
    samples = PulseStep(Settings(rate=rate)).next(int(duration * rate))
    return START + np.arange(len(samples)) / rate, samples


def feed(rig, time, samples, size=32):
    return [
        stretch
        for k in range(0, len(time), size)
        for stretch in rig.take(time[k : k + size], samples[k : k + size])
    ]


def test_a_stream_of_blocks_gives_what_simulate_gives():
    time, samples = reference(2.0)
    reports = []
    rig = LiveRig(setup(), reports.append, noisy=False)
    stretches = feed(rig, time, samples)
    whole = simulate(samples, RATE, seed=1)
    assert (
        np.abs(np.concatenate([stretch.samples for stretch in stretches]) - whole.clean).max()
        < 1e-9
    )
    assert np.array_equal(np.concatenate([stretch.time for stretch in stretches]), time)
    assert reports == []


def test_noise_is_that_of_the_nominal_run_even_while_the_plate_rests():
    rig = LiveRig(setup(), print)
    time = START + np.arange(8192) / RATE
    stretches = feed(rig, time, np.zeros((8192, 3)))
    measured = np.concatenate([stretch.samples for stretch in stretches])
    nominal = simulate(PulseStep(Settings(seed=1)).next(int(30 * RATE)), RATE, seed=1).clean.std(
        axis=0
    )
    ratio = 20 * np.log10(nominal / measured.std(axis=0))
    assert ratio == pytest.approx([52.7, 37.7, 24.1], abs=0.2)


def test_a_gap_is_missing_in_the_samples_reported_and_the_joint_lives_on():
    time, samples = reference(3.0)
    reports = []
    rig = LiveRig(setup(), reports.append, noisy=False)
    keep = np.ones(len(time), bool)
    keep[2000:2100] = False
    stretches = feed(rig, time[keep], samples[keep])
    published = np.concatenate([stretch.time for stretch in stretches])
    assert np.array_equal(published, time[keep])
    assert rig.held == 100
    assert len(reports) == 1
    assert "100 samples" in reports[0]
    # What the plate did meanwhile: it held the last command. Its consequences are in the samples
    # behind the gap.
    held = samples.copy()
    held[2000:2100] = samples[1999, 0], 0.0, 0.0
    expected = simulate(held, RATE, seed=1).clean
    assert (
        np.abs(np.concatenate([stretch.samples for stretch in stretches]) - expected[keep]).max()
        < 1e-9
    )


def test_samples_that_are_not_finite_count_as_missing():
    time, samples = reference(1.0)
    samples[500] = np.nan
    rig = LiveRig(setup(), lambda sentence: None)
    stretches = feed(rig, time, samples)
    published = np.concatenate([stretch.time for stretch in stretches])
    assert np.array_equal(published, np.delete(time, 500))
    assert all(np.isfinite(stretch.samples).all() for stretch in stretches)
    assert rig.held == 1


def test_another_rate_a_long_pause_and_time_running_back_start_again():
    reports = []
    scenario = Scenario.from_content({"changes": [{"at[s]": 0.5, "stiffness.K[N.m/rad]": 150}]})
    rig = LiveRig(setup(scenario), reports.append, noisy=False)
    time, samples = reference(1.0)
    assert feed(rig, time, samples)[-1].truth["stiffness.K[N.m/rad]"] == 150.0
    slow_time, slow = reference(0.25, rate=1000.0)
    stretches = feed(rig, slow_time + 1.0, slow)
    assert "1000 Hz instead of 2048 Hz" in reports[0]
    assert stretches[-1].truth["stiffness.K[N.m/rad]"] == 100.0
    assert (
        np.abs(
            np.concatenate([s.samples for s in stretches]) - simulate(slow, 1000.0, seed=1).clean
        ).max()
        < 1e-9
    )
    feed(rig, slow_time + 500.0, slow)
    assert "no reference for 498" in reports[1]
    feed(rig, slow_time + 100.0, slow)
    assert "back in time" in reports[2]
    assert rig.held == 0


def test_a_block_that_does_not_tell_its_rate_and_a_rate_out_of_range_are_reported():
    reports = []
    rig = LiveRig(setup(), reports.append)
    assert rig.take(np.array([START]), np.zeros((1, 3))) == []
    assert "do not tell a sampling rate" in reports[0]
    with pytest.raises(ModelError, match="50 Hz is outside 500 to 10000 Hz"):
        rig.take(START + np.arange(10) / 50.0, np.zeros((10, 3)))


def test_a_value_set_while_running_survives_a_new_start():
    rig = LiveRig(setup(), lambda sentence: None, noisy=False)
    time, samples = reference(0.25)
    feed(rig, time, samples)
    rig.set("stiffness", "K", 40.0)
    rig.set("voluntary_torque", "level", -5.0)
    (stretch,) = rig.take(time[:32] + 0.25, samples[:32])
    assert stretch.truth["stiffness.K[N.m/rad]"] == 40.0
    assert stretch.parts["voluntary_torque"] == -5.0
    (again,) = rig.take(time[:32], samples[:32])
    assert again.truth["stiffness.K[N.m/rad]"] == 40.0
    with pytest.raises(ModelError, match="K' = 2000"):
        rig.set("stiffness", "K", 2000.0)


def test_every_parameter_of_every_term_is_declared_with_the_models_value():
    model = with_voluntary_torque(
        Model.of({"stiffness": {"K": 44.0}, "maxwell_relaxation": {"k": 12.0}})
    )
    declared = model_parameters(model)
    assert declared["K"][0].default == 44.0
    assert not declared["K"][0].start_only
    assert declared["maxwell_relaxation.k"][0].default == 12.0
    assert declared["maxwell_relaxation.T"][0].start_only
    assert declared["voluntary_torque.rms"][0].default == 0.0
    assert all(
        parameter.lower <= parameter.default <= parameter.upper
        for parameter, _, _ in declared.values()
    )
