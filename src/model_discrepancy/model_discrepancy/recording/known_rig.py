"""A calibrated rig is taken as known: zeros and clocks are corrected, its terms are held."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ankle_physics.rig_file import RigFile
from ankle_physics.term import ModelValues
from model_discrepancy.recording.compliance import COMPLIANCE_POLES_S, Compliance
from model_discrepancy.recording.recording import Recording

# The calibration states this in place of the term.
SKEW = "channel_skew"


def calibrated(recording: Recording, rig: RigFile) -> Recording:
    """Return the recording with the rig's zeros taken off and its velocity on the position's clock.

    The delay of the torque is a term of the model (`held_terms`), so that a simulation makes it
    too.

    Parameters
    ----------
    recording
        As it was read.
    rig
        Calibrated.
    """
    velocity = recording.velocity
    if velocity is not None:
        velocity = on_time(velocity, recording.rate, rig.velocity_delay.value)
    reference = recording.reference
    return replace(
        recording,
        position=recording.position - rig.zero_position,
        torque=recording.torque - rig.zero_torque,
        velocity=velocity,
        reference=None if reference is None else reference - rig.zero_position,
    )


def on_time(signal: np.ndarray, rate: float, delay: float) -> np.ndarray:
    """Return a signal that was read late on the clock of the others, shape (n,).

    Parameters
    ----------
    signal
        As it was read, shape (n,).
    rate
        Of its samples [Hz].
    delay
        By which it is late [s].
    """
    if not delay:
        return signal
    time = np.arange(len(signal)) / rate
    return np.interp(time + delay, time, signal)


def held_terms(rig: RigFile) -> ModelValues:
    """Return the values of the rig's terms, by term and symbol, which a fit holds."""
    held = {
        entry.term.name: {symbol: float(value) for symbol, value in entry.values.items()}
        for entry in rig.model.entries
    }
    if rig.torque_delay.value:
        held[SKEW] = {"skew": rig.torque_delay.value}
    return held


def known_compliance(rig: RigFile, rate: float) -> Compliance | None:
    """Return how far the rig's servo gives way, at a rate [Hz]; None where it is not stated."""
    if not rig.model.has("servo_compliance"):
        return None
    entry = rig.model.entry("servo_compliance")
    stiffness = float(entry.values["k_a"])
    error = entry.standard_errors.get("k_a", 0.0) / stiffness**2
    weights = np.zeros(1 + len(COMPLIANCE_POLES_S))
    weights[0] = 1.0 / stiffness
    return Compliance(rate, weights, (1.0 / stiffness, error))
