"""A drive answers a load as a mass on the stiffness of its controller, with dry friction."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from model_discrepancy.recording import servo as servo_module
from model_discrepancy.recording.drive_mode import DriveMode
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.servo import identify_servo

RATE = 500.0
MASS, DAMPING, STIFFNESS = 0.03, 10.0, 2000.0
MODE = DriveMode(np.sqrt(STIFFNESS / MASS) / (2 * np.pi), DAMPING / (2 * np.sqrt(STIFFNESS * MASS)))
NOISE = 5e-6  # rad
FREQUENCY = np.array([2.0, 10.0, 20.0, 30.0])


def driven(friction: float) -> Recording:
    """Return a recording of a drive that is always moving, under a load that nothing causes."""
    generator, fine = np.random.default_rng(4), 8
    count = int(40.0 * RATE)
    time = np.arange(count * fine) / (RATE * fine)
    phases = 2.0 * np.pi * generator.random(30)
    lines = 0.1 + 0.25 * np.arange(30)
    command = 0.02 * np.sin(2.0 * np.pi * np.outer(time, lines) + phases).sum(axis=1) / 5.0
    noise = generator.standard_normal(len(time))
    within = butter(2, [0.3, 30.0], "bandpass", fs=RATE * fine, output="sos")
    load = sosfiltfilt(within, noise)
    load /= load.std()
    x, v, dt, position = command[0], 0.0, 1.0 / (RATE * fine), np.empty(len(time))
    speed = np.gradient(command, dt)
    for k in range(len(time)):
        pull = STIFFNESS * (command[k] - x) + DAMPING * (speed[k] - v) - load[k]
        v += dt * (pull - friction * np.tanh(v / 0.01)) / MASS
        x += dt * v
        position[k] = x
    recorded = position[::fine] + NOISE * generator.standard_normal(count)
    return Recording(RATE, recorded, load[::fine], reference=command[::fine])


def error_of(recording: Recording) -> float:
    """Return the largest relative error of the compliance up to 30 Hz."""
    found = identify_servo(recording, 1).compliance.response(FREQUENCY)
    return float(np.abs(found * STIFFNESS / MODE.response(FREQUENCY) - 1.0).max())


@pytest.mark.parametrize("friction", [0.0, 0.4])
def test_the_compliance_of_a_drive_is_that_of_its_mass_beside_friction(friction):
    assert error_of(driven(friction)) < 0.1


def test_the_friction_of_a_drive_explains_its_position(monkeypatch):
    recording = driven(0.4)
    left = np.std(identify_servo(recording, 1).unexplained)
    monkeypatch.setattr(
        servo_module, "friction_column", lambda velocity, *_: np.zeros(len(velocity))
    )
    # Each recording's servo is identified once.
    louder = replace(recording, torque=1.0001 * recording.torque)
    without = identify_servo(louder, 1)
    assert np.std(without.unexplained) > 2.0 * left
