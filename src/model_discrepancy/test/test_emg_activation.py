"""Activation from EMG: faster than slow torque tells, and only where EMG follows the torque."""

import numpy as np
from scipy.signal import butter, sosfiltfilt

from model_discrepancy.recording.emg_activation import emg_activation
from model_discrepancy.recording.recording import Recording

RATE, MODEL_RATE, SECONDS = 1000.0, 500.0, 60
CUTOFF = 0.3


def subject(seed: int, follows: bool) -> tuple[Recording, np.ndarray, np.ndarray, np.ndarray]:
    """A recording, the plate's velocity, the slow torque and the true activation."""
    random = np.random.default_rng(seed)
    time = np.arange(int(SECONDS * RATE)) / RATE
    held = 4.0 + 2.0 * np.sin(2 * np.pi * 0.08 * time) + 1.5 * np.sin(2 * np.pi * 0.6 * time)
    amplitude = 1e-5 + (2e-5 * np.maximum(held, 0.0) if follows else 8e-5)
    pulses = np.zeros(len(time))
    for onset in range(500, len(time) - 500, 700):
        pulses[onset : onset + 40] = 1.0
        # The reflex answers a movement, ten times as strong as the background.
        amplitude = amplitude + 8e-4 * ((np.arange(len(time)) - onset - 90) ** 2 < 400)
    emg = {m: amplitude * random.standard_normal(len(time)) for m in ("SOL", "GM")}
    emg["TA"] = 1e-5 * random.standard_normal(len(time))
    slow = sosfiltfilt(butter(2, CUTOFF, fs=MODEL_RATE, output="sos"), held[::2])
    recording = Recording(RATE, pulses, held, emg=emg)
    return recording, np.gradient(pulses)[::2] * RATE, slow, held[::2]


def test_emg_shows_what_slow_torque_does_not():
    recording, velocity, slow, held = subject(1, follows=True)
    found = emg_activation(recording, velocity, slow, MODEL_RATE, CUTOFF)
    assert found is not None
    inner = slice(1000, -1000)
    assert np.std((found - held)[inner]) < 0.5
    assert np.std((found - held)[inner]) < 0.6 * np.std((slow - held)[inner])


def test_emg_that_does_not_follow_the_torque_is_not_believed():
    recording, velocity, slow, _ = subject(2, follows=False)
    assert emg_activation(recording, velocity, slow, MODEL_RATE, CUTOFF) is None


def test_a_recording_without_emg_keeps_the_slow_torque():
    slow = np.linspace(0.0, 5.0, 1000)
    recording = Recording(RATE, np.zeros(2000), np.zeros(2000))
    assert emg_activation(recording, np.zeros(1000), slow, MODEL_RATE, CUTOFF) is None
