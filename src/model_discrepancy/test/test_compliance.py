"""How far the servo gives way is told from what its own vibration makes of the torque."""

import numpy as np
import pytest
from scipy.signal import butter, sosfiltfilt

from model_discrepancy.recording.compliance import held_compliance
from model_discrepancy.recording.spectrum import Spectrum

RATE, SECONDS = 500.0, 60.0
INERTIA, VISCOSITY, STIFFNESS = 0.0145, 0.5, 60.0
FLOPPY = 4e-4


def held_plate(compliance: float, vibration: float, pushed: float = 0.3) -> tuple[np.ndarray, ...]:
    """Return position, velocity, torque and the torque that no movement causes, of steps each half
    second with a plate that vibrates [rad] at 16 to 20 Hz between them and a subject who pushes
    [N.m].
    """
    generator = np.random.default_rng(8)
    count = int(SECONDS * RATE)
    levels = generator.uniform(-0.03, 0.03, int(2 * SECONDS))
    steps = np.repeat(levels, count // len(levels))
    steps = sosfiltfilt(butter(2, 20.0, fs=RATE, output="sos"), steps)

    def within(low: float, high: float, size: float) -> np.ndarray:
        within_band = butter(2, [low, high], "bandpass", fs=RATE, output="sos")
        noise = sosfiltfilt(within_band, generator.standard_normal(count))
        return size * noise / noise.std()

    moved = steps + within(16.0, 20.0, vibration)
    uncaused = within(1.0, 12.0, pushed)
    spectrum = Spectrum(moved - compliance * uncaused, RATE, 1)
    s = 2j * np.pi * spectrum.frequency
    impedance = INERTIA * s**2 + VISCOSITY * s + STIFFNESS
    loop = 1.0 / (1.0 + compliance * impedance)
    position, velocity = spectrum.read(loop), spectrum.read(loop * s)
    return position, velocity, spectrum.read(loop * impedance) + uncaused, uncaused


def test_vibration_of_a_rigid_drive_is_no_compliance():
    position, velocity, torque, uncaused = held_plate(0.0, vibration=3e-4, pushed=0.05)
    found = held_compliance(position, velocity, torque, uncaused, RATE)
    assert not found.significant
    by_torque = held_compliance(position, velocity, torque, torque, RATE)
    assert by_torque.magnitude[0] > 0.2 * FLOPPY
    assert by_torque.significant


@pytest.mark.parametrize("vibration", [1e-5, 1e-4])
def test_the_compliance_is_found_beside_vibration(vibration: float):
    position, velocity, torque, uncaused = held_plate(FLOPPY, vibration)
    found = held_compliance(position, velocity, torque, uncaused, RATE)
    assert found.magnitude[0] == pytest.approx(FLOPPY, rel=0.1)


def test_where_the_holds_tell_little_it_is_that_of_slow_torque():
    generator = np.random.default_rng(2)
    position, velocity, torque, uncaused = held_plate(FLOPPY, 1e-4)
    position = position + 1e-4 * generator.standard_normal(len(position))
    found = held_compliance(position, velocity, torque, uncaused, RATE)
    assert found.significant
    assert not found.precise
    slow, fast = np.abs(found.response(np.array([2.0, 40.0])))
    assert slow == pytest.approx(FLOPPY, rel=0.3)
    assert fast < 0.1 * slow


def test_a_plate_that_is_hardly_ever_held_tells_nothing():
    time = np.arange(int(SECONDS * RATE)) / RATE
    position = 0.03 * np.sin(2 * np.pi * 2.0 * time)
    velocity = 0.03 * 4 * np.pi * np.cos(2 * np.pi * 2.0 * time)
    assert held_compliance(position, velocity, 60.0 * position, position, RATE) is None
