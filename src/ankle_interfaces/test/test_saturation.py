"""A channel at the end of its range is named with its share; clean and held channels are not."""

import numpy as np
import pytest

from ankle_interfaces.saturation import saturation_sentences, saturations

RATE = 1000
N = 30 * RATE
STEP = 2.0 / 2**12  # [rad] a converter of 12 bits over 2 rad


def movement(levels=0.02, noise=0.0, hold=200):
    """Smooth steps between random levels [rad], each held for some samples."""
    random = np.random.default_rng(3)
    steps = np.repeat(random.uniform(-levels, levels, N // hold), hold)
    smooth = np.convolve(steps, np.hanning(40) / np.hanning(40).sum(), "same")
    return smooth + noise * random.standard_normal(N)


def two_levels(hold=500):
    steps = np.repeat(np.tile([0.0, 0.05], N // hold // 2), hold)
    return np.convolve(steps, np.hanning(40) / np.hanning(40).sum(), "same")


def noise():
    return np.random.default_rng(1).standard_normal(N)


def slow_noise():
    return np.convolve(noise(), np.ones(20) / 20, "same")


def sine(amplitude):
    return amplitude * np.sin(2 * np.pi * 0.7 * np.arange(N) / RATE)


def quantised(values, step=STEP):
    return step * np.round(values / step)


@pytest.mark.parametrize("share", [0.01, 0.05, 0.55])
@pytest.mark.parametrize("step", [1e-9, 2e-3], ids=["fine", "12 bits"])
def test_samples_at_an_end_are_counted(share, step):
    clean = quantised(slow_noise(), step)
    end = np.quantile(clean, 1 - share)
    (found,) = saturations(np.minimum(clean, end))
    assert found.side == "upper"
    assert found.extreme == pytest.approx(end)
    assert found.share == pytest.approx(share, rel=0.25)
    (lower,) = saturations(-np.minimum(clean, end))
    assert (lower.side, lower.share) == ("lower", found.share)


@pytest.mark.parametrize(
    "clean",
    {
        "noise": noise(),
        "noise in 12 bits": quantised(noise(), 13 / 2**12),
        "noise in steps of its size": quantised(noise(), 1.0),
        "slow noise in 12 bits": quantised(slow_noise(), 2e-3),
        "sine in 12 bits": quantised(sine(1.0)),
        "noisy sine in 12 bits": quantised(sine(1.0) + 0.3 * STEP * noise()),
        "small sine in 12 bits": quantised(sine(0.02)),
        "random levels": movement(),
        "random levels in 12 bits": quantised(movement()),
        "random levels with noise in 12 bits": quantised(movement(noise=STEP)),
        "long holds": movement(hold=3000),
        "long holds with noise in 12 bits": quantised(movement(noise=0.5 * STEP, hold=3000)),
        "two levels": two_levels(),
        "two levels in 12 bits": quantised(two_levels()),
        "two levels with noise in 12 bits": quantised(two_levels() + 0.7 * STEP * noise()),
        "constant": np.full(N, 0.1),
        "no sample": np.zeros(0),
    }.values(),
)
def test_a_clean_channel_gives_no_alarm(clean):
    assert saturations(clean) == []
    assert saturations(-clean) == []


def test_a_hold_that_is_commanded_is_no_end():
    t = np.arange(N) % 3000
    ramps = np.interp(t, [0, 900, 1500, 2400, 3000], [0.0, 0.1, 0.1, 0.0, 0.0])
    assert saturations(ramps)
    assert saturations(ramps, command=ramps) == []
    assert saturations(np.minimum(sine(0.1), 0.08), command=sine(0.1))


def test_the_sentence_names_channel_share_end_and_what_to_do():
    slow = slow_noise()
    (said,) = saturation_sentences({"torque[N.m]": np.minimum(slow, np.quantile(slow, 0.95))})
    assert said.startswith("torque is saturated: ")
    assert "% of the samples stand at its upper end" in said
    assert "N.m" in said
    assert "record again" in said
