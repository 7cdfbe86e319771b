"""Simulation against independent integration of the same equations; blocks against one go; noise
and sampling.
"""

from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.signal import butter, sosfilt

from ankle_physics.actuator import Actuator, Servo, oversampling
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import NO_NOISE, Noise, Sampler, SignalToNoise
from ankle_physics.virtual_rig import VirtualRig, simulate

RATE = 2048.0
EDGES = ((0.05, 0.04), (0.10, -0.04), (0.31, 0.04), (0.77, -0.04))  # [s], [rad]; a pulse and a step
EDGE_LENGTH = 0.024  # s


def pulse_step(t):
    """Position, velocity, acceleration of minimum-jerk edges."""
    x = v = a = 0.0
    for start, height in EDGES:
        s = min(max((t - start) / EDGE_LENGTH, 0.0), 1.0)
        x += height * s**3 * (10 - 15 * s + 6 * s**2)
        v += height / EDGE_LENGTH * 30 * s**2 * (1 - s) ** 2
        a += height / EDGE_LENGTH**2 * 60 * s * (1 - s) * (1 - 2 * s)
    return x, v, a


def sampled(duration=1.0, rate=RATE):
    return np.array([pulse_step(k / rate) for k in range(int(duration * rate))])


def integrated_torque(
    time, bandwidth, damping=0.7, K=100.0, B=0.63, I=0.0137, G=10.0, delay=0.04, omega=21.0, z=0.8
):
    """The paper's model behind the servo, by an adaptive solver of order 8."""
    tight = {
        "method": "DOP853",
        "rtol": 1e-9,
        "atol": 1e-12,
        "max_step": 2e-3,
        "dense_output": True,
    }
    w = 2 * np.pi * bandwidth
    if bandwidth:

        def servo(t, y):
            return [y[1], w**2 * (pulse_step(t)[0] - y[0]) - 2 * damping * w * y[1]]

        plate = solve_ivp(servo, [0, time[-1]], [0, 0], **tight).sol

        def motion(t):
            y, v = plate(t)
            return y, v, w**2 * (pulse_step(t)[0] - y) - 2 * damping * w * v
    else:
        motion = pulse_step

    def muscle(t, y):
        stretch = max(motion(t - delay)[1], 0.0) if t > delay else 0.0
        return [y[1], omega**2 * (stretch - y[0]) - 2 * z * omega * y[1]]

    reflex = solve_ivp(muscle, [0, time[-1]], [0, 0], **tight).sol
    x, v, a = np.array([motion(t) for t in time]).T
    return K * x + B * v + I * a + G * reflex(time)[0]


@pytest.mark.parametrize("bandwidth", [0.0, 30.0])
def test_torque_against_an_adaptive_solver(bandwidth):
    reference = sampled()
    recording = simulate(reference, RATE, servo=Servo(bandwidth), signal_to_noise=NO_NOISE)
    torque = sum(recording.parts.values())
    expected = integrated_torque(recording.time, bandwidth)
    assert np.abs(torque - expected).max() < 1e-4 * np.abs(expected).max()


@pytest.mark.parametrize("rate", [500.0, 10_000.0])
def test_other_rates_give_the_same_torque(rate):
    recording = simulate(sampled(rate=rate), rate, signal_to_noise=NO_NOISE)
    expected = integrated_torque(recording.time, 30.0)
    # At 500 Hz an edge of 24 ms has 12 samples; the quintic between them still meets the
    # polynomial.
    assert np.abs(sum(recording.parts.values()) - expected).max() < 2e-4 * np.abs(expected).max()


def everything():
    model = Model.of(
        {
            "inertia": {},
            "viscosity": {},
            "stiffness": {},
            "reflex": {},
            "voluntary_torque": {},
            "fixation_compliance": {},
        }
    )
    scenario = Scenario.from_content(
        {
            "changes": [
                {"at[s]": 0.2, "stiffness.K[N.m/rad]": 50},
                {
                    "at[s]": 0.4,
                    "over[s]": 0.3,
                    "stiffness.K[N.m/rad]": 120,
                    "reflex.G[N.m.s/rad]": 3,
                },
            ]
        }
    )
    return {"model": model, "rate": RATE, "servo": Servo(), "scenario": scenario, "seed": 4}


def test_blocks_of_any_size_give_what_one_go_gives():
    reference = sampled()
    whole = simulate(reference, signal_to_noise=SignalToNoise(), **everything())
    rig, noise = VirtualRig(**everything()), Noise(whole.noise, 4)
    samples, truth = [], []
    cuts = [0, 1, 32, 96, 99, 599, 631, 1655, len(reference)]
    for start, stop in pairwise(cuts):
        part = rig.run(reference[start:stop])
        samples.append(noise.add(part.clean))
        truth.append(part.truth["stiffness.K[N.m/rad]"])
    assert np.abs(np.concatenate(samples) - whole.measured).max() < 1e-8
    assert np.array_equal(np.concatenate(truth), whole.truth["stiffness.K[N.m/rad]"])


def test_a_seed_repeats_and_another_differs():
    runs = [simulate(sampled(), seed=seed).measured for seed in (1, 1, 2)]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_noise_has_the_asked_signal_to_noise_ratio():
    recording = simulate(
        np.tile(sampled(), (20, 1)), RATE, signal_to_noise=SignalToNoise(52.7, 37.7, 24.1)
    )
    ratio = 20 * np.log10(
        recording.clean.std(axis=0) / (recording.measured - recording.clean).std(axis=0)
    )
    assert np.abs(ratio - [52.7, 37.7, 24.1]).max() < 0.1
    noise = recording.measured - recording.clean
    assert np.abs(np.corrcoef(noise.T) - np.eye(3)).max() < 0.02
    assert abs(np.corrcoef(noise[:-1, 2], noise[1:, 2])[0, 1]) < 0.02


def test_anti_alias_filter_is_a_fourth_order_butterworth_settled_at_the_start():
    factor = oversampling(RATE)
    t = np.arange(4096 * factor) / (RATE * factor)
    corner, above = 0.9 * RATE / 2, 3500.0
    signals = np.stack(
        [np.sin(2 * np.pi * corner * t), np.sin(2 * np.pi * above * t), np.full(len(t), 2.5)]
    )
    samples = Sampler(RATE, factor).run(*signals)
    sections = butter(4, corner, fs=RATE * factor, output="sos")
    expected = sosfilt(sections, signals[:2], axis=1)[:, factor - 1 :: factor].T
    assert np.abs(samples[200:, :2] - expected[200:]).max() < 1e-9
    assert samples[200:, 0].std() == pytest.approx(0.5, rel=0.02)  # -3 dB of a sine's 0.707
    # Would fold to 596 Hz.
    assert samples[200:, 1].std() < 1e-3
    assert np.abs(samples[:, 2] - 2.5).max() < 1e-12


def test_servo_reaches_a_step_with_the_overshoot_of_its_damping():
    motion = Actuator(Servo(30.0, 0.7), RATE).run(
        np.vstack([np.zeros((10, 3)), np.tile([0.1, 0.0, 0.0], (1000, 1))])
    )
    overshoot = np.exp(-np.pi * 0.7 / np.sqrt(1 - 0.49))
    assert motion[0].max() / 0.1 - 1 == pytest.approx(overshoot, abs=2e-3)
    assert motion[0, -1] == pytest.approx(0.1, abs=1e-6)
    assert (
        np.abs(np.gradient(motion[0], 1 / (4 * RATE)) - motion[1])[2:-2].max()
        < 2e-2 * motion[1].max()
    )


def test_ideal_actuator_meets_every_reference_sample():
    reference = sampled()
    motion = Actuator(Servo(0.0), RATE).run(reference)
    assert np.array_equal(motion[:, 3::4].T, reference)
    finer = sampled(1.0, 4 * RATE)[1 : 4 * len(reference) - 3]
    # Where an edge begins or ends between two samples its jerk jumps, which no polynomial can
    # follow.
    assert np.abs(motion[0, 4:] - finer[:, 0]).max() < 1e-6 * 0.04


def test_position_alone_is_enough_for_a_servo_and_refused_by_an_ideal_actuator():
    reference = sampled()
    with_rates = simulate(reference, signal_to_noise=NO_NOISE)
    alone = simulate(reference[:, :1], signal_to_noise=NO_NOISE)
    assert np.abs(alone.torque - with_rates.torque).max() < 0.01 * np.abs(with_rates.torque).max()
    with pytest.raises(ModelError, match="velocity and acceleration"):
        simulate(reference[:, :1], servo=Servo(0.0))


@pytest.mark.parametrize(
    ("act", "words"),
    [
        (lambda: Servo(bandwidth=900.0), "bandwidth = 900 Hz is outside 1 to 500 Hz"),
        (lambda: Servo(damping=0.0), "damping = 0 is outside 0.1 to 5"),
        (lambda: SignalToNoise(torque=-3.0), "torque = -3 dB"),
        (lambda: simulate(sampled(), rate=100.0), "100 Hz is outside 500 to 10000 Hz"),
        (lambda: simulate(np.full((10, 3), np.nan)), "10 samples that are not finite"),
        (lambda: simulate(np.zeros((10, 2))), r"shape \(10, 2\)"),
    ],
)
def test_bad_settings_are_named(act, words):
    with pytest.raises(ModelError, match=words):
        act()


def test_a_parameter_set_between_blocks_holds_from_the_next_on_and_leaves_the_callers_model_alone():
    model = Model.of({"stiffness": {"K": 100.0}})
    rig = VirtualRig(model, RATE, Servo(0.0))
    held = np.tile([0.02, 0.0, 0.0], (64, 1))
    assert rig.run(held).parts["stiffness"][-1] == pytest.approx(2.0)
    rig.set("stiffness", "K", 50.0)
    assert rig.run(held).parts["stiffness"][0] == pytest.approx(1.0)
    with pytest.raises(ModelError, match=r"K' = -1\.0 N\.m/rad"):
        rig.set("stiffness", "K", -1.0)
    assert model.entry("stiffness").values["K"] == 100.0
