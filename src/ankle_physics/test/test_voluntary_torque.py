"""The slow drift: size, spectrum, and independence of rate and blocks."""

import numpy as np
import pytest
from scipy.signal import welch

from ankle_physics.model import Model
from ankle_physics.signals import Signals


def drift(rate, duration, seed, rms=2.0, cutoff=1.0, level=-5.0):
    n = int(duration * rate)
    zero = np.zeros(n)
    model = Model.of({"voluntary_torque": {"rms": rms, "cutoff": cutoff, "level": level}})
    signals = Signals(rate, zero, zero, zero)
    return model.start(rate, seed).torque(signals), signals


def test_size_and_spectrum_are_those_of_a_fourth_order_butterworth():
    torque, _ = drift(50.0, 8_000.0, seed=3)
    assert torque.mean() == pytest.approx(-5.0, abs=0.05)
    assert torque.std() == pytest.approx(2.0, rel=0.03)
    frequency, power = welch(torque, 50.0, nperseg=1024)
    flat = power[(frequency > 0.1) & (frequency < 0.5)].mean()
    for at in (1.0, 2.0, 4.0):
        near = np.abs(frequency - at) < 0.05
        expected = (1 / (1 + frequency[near] ** 8)).mean()
        assert power[near].mean() / flat == pytest.approx(expected, rel=0.25)


def test_the_same_seed_gives_the_same_drift_at_every_rate():
    slow, _ = drift(1024.0, 20.0, seed=5)
    fast, _ = drift(8192.0, 20.0, seed=5)
    assert np.abs(fast[::8] - slow).max() < 1e-9
    assert np.abs(drift(1024.0, 20.0, seed=6)[0] - slow).max() > 0.1


def test_it_counts_as_activation():
    torque, signals = drift(1024.0, 5.0, seed=1)
    assert np.allclose(signals.activation, torque)
