"""Whether a calibrated rig still describes the signals that come from it."""

from __future__ import annotations

from datetime import datetime

import numpy as np
from scipy import signal

from ankle_physics.rig_file import Measured, RigFile

LARGEST_AGE = 90.0
"""[days] By reasoning: in a quarter of a year straps, cables and sensors of a rig are touched."""
DELAY_TOLERANCE = 0.1e-3
"""[s] A delay off by this costs 1 to 2 % of G; calibrations reach half of it."""
SIGNIFICANCE = 3.0
"""Differences count from so many standard errors on."""
NOISE_RATIO = 2.0
"""Noise that is larger or smaller than the calibrated one by this factor: a changed gain, a loose
plug or another filter."""
REST_BLOCK = 0.05
"""[s] Blocks in which noise is read: shorter than the rest between two perturbations."""
REST_SHARE = 0.2
"""The quietest fifth of the blocks counts as rest."""
BAND = (3.0, 40.0)
"""[Hz] Where a perturbation moves the plate."""
SEGMENT = 2.0
"""[s] Segments over which a delay is averaged; their scatter gives its standard error."""
MIN_DURATION = 10.0
"""[s] Shorter stretches are not judged."""


def rig_warnings(
    rig: RigFile,
    rate: float,
    position: np.ndarray,
    velocity: np.ndarray | None,
    torque: np.ndarray,
    now: datetime | None = None,
) -> list[str]:
    """Return one sentence for each way in which a rig file is old or contradicts the signals.

    Parameters
    ----------
    rig
        The calibrated rig.
    rate
        Sampling rate [Hz].
    position, torque
        [rad], [N.m], shape (n,), as they are measured while the plate is perturbed.
    velocity
        [rad/s], shape (n,), where it is measured.
    now
        Time of the recording; None: the present.
    """
    found = []
    age = rig.age(now)
    if age > LARGEST_AGE:
        found.append(
            f"the rig '{rig.title}' was calibrated {age:.0f} days ago, more than {LARGEST_AGE:g}"
        )
    if len(position) < MIN_DURATION * rate:
        return found
    for name, values in (
        ("position[rad]", position),
        ("velocity[rad/s]", velocity),
        ("torque[N.m]", torque),
    ):
        if values is not None and rig.noise.get(name, 0.0) > 0.0:
            found += _noise(name, values, rig.noise[name], rate)
    if velocity is not None:
        found += _delay(rig.velocity_delay, velocity_delay(rate, position, velocity))
    return found


def _noise(name: str, values: np.ndarray, calibrated: float, rate: float) -> list[str]:
    quantity, unit = name.rstrip("]").split("[")
    length = max(8, round(REST_BLOCK * rate))
    blocks = values[: len(values) // length * length].reshape(-1, length)
    # Differences of neighbours, as in the calibration, do not see the movement.
    present = np.quantile(np.std(np.diff(blocks, axis=1), axis=1), REST_SHARE) / np.sqrt(2.0)
    if calibrated / NOISE_RATIO <= present <= calibrated * NOISE_RATIO:
        return []
    return [f"noise of {quantity} is {present:.2g} {unit}, calibrated were {calibrated:.2g} {unit}"]


def velocity_delay(rate: float, position: np.ndarray, velocity: np.ndarray) -> Measured:
    """Return how much later than the position the velocity is read [s], with its standard error.

    Parameters
    ----------
    rate
        Sampling rate [Hz].
    position, velocity
        [rad], [rad/s], shape (n,), of a perturbed plate.
    """
    length = round(SEGMENT * rate)
    count = len(position) // length
    window = signal.windows.hann(length)
    frequency = np.fft.rfftfreq(length, 1.0 / rate)
    used = (frequency >= BAND[0]) & (frequency <= BAND[1])
    omega = 2.0 * np.pi * frequency[used]
    delays, weights = [], []
    for k in range(count):
        part = slice(k * length, (k + 1) * length)
        x, v = (
            np.fft.rfft(window * (values[part] - values[part].mean()))[used]
            for values in (position, velocity)
        )
        cross = v * np.conj(1j * omega * x)
        power = np.abs(cross)
        delays.append(-np.sum(power * omega * np.angle(cross)) / np.sum(power * omega**2))
        weights.append(np.sum(power))
    total = np.average(delays, weights=weights)
    scatter = np.average((np.array(delays) - total) ** 2, weights=weights)
    return Measured(float(total), float(np.sqrt(scatter / max(count - 1, 1))))


def _delay(calibrated: Measured, present: Measured) -> list[str]:
    error = np.hypot(calibrated.standard_error or 0.0, present.standard_error or 0.0)
    if abs(present.value - calibrated.value) <= DELAY_TOLERANCE + SIGNIFICANCE * error:
        return []
    return [
        f"velocity comes {1e3 * present.value:.2f} ms after position, calibrated were "
        f"{1e3 * calibrated.value:.2f} ms"
    ]
