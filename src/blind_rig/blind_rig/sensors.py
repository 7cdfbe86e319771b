"""Encoder, tachometer, torque sensor: what the rig's motion becomes before it is sampled."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np
from numba import njit
from scipy.signal import bilinear, butter, lfilter, sosfilt

from blind_rig.anatomy import Sensors, Setup
from blind_rig.mechanics import Motion

MAINS_HZ = 50.0
# Muscle activity shows in the torque's own unrest over this time [s].
ACTIVITY_TIME = 0.2
# Newton's method; for errors that turn no motion around the last step is below 1e-9 rad.
GEAR_STEPS = 8
# Paper, section II: anti-alias filter at 90 % of Nyquist; its order is that of a usual
# data-acquisition board.
ALIAS_SHARE, ALIAS_ORDER = 0.9, 4


class Reading(NamedTuple):
    """Holds signals of the sensors, each of shape (n,): [rad], [rad/s], [N.m]."""

    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray


@njit(cache=True)
def _backlash(signal: np.ndarray, gap: float) -> np.ndarray:
    """Return the output of a backlash of width `gap` that a signal drives."""
    out = np.empty_like(signal)
    at = signal[0]
    for i in range(len(signal)):
        at = min(max(at, signal[i] - gap / 2), signal[i] + gap / 2)
        out[i] = at
    return out


@njit(cache=True)
def _coarse(signal: np.ndarray, step: float) -> np.ndarray:
    """Return a quantised signal, whose value changes only when the signal is a whole step away."""
    out = np.empty_like(signal)
    at = round(signal[0] / step) * step
    for i in range(len(signal)):
        if abs(signal[i] - at) > step:
            at = round(signal[i] / step) * step
        out[i] = at
    return out


def _resonance(signal: np.ndarray, hertz: float, zeta: float, rate: float) -> np.ndarray:
    """Filter through a second-order mode with unit gain at rest."""
    omega = 2 * math.pi * hertz
    b, a = bilinear([omega**2], [1.0, 2 * zeta * omega, omega**2], fs=rate)
    return lfilter(b, a, signal - signal[0]) + signal[0]


def _late(signal: np.ndarray, delay: float, rate: float) -> np.ndarray:
    """Return the signal `delay` seconds later, its first value held; linear between samples."""
    index = np.arange(len(signal))
    return np.interp(index - delay * rate, index, signal)


def before_gear(
    position: np.ndarray, velocity: np.ndarray, sensors: Sensors
) -> tuple[np.ndarray, np.ndarray]:
    """Return angle [rad] and velocity [rad/s] of the shaft before a gear, each of shape (n,).

    The output is ahead of the shaft, at the shaft's angle x, by
    ``gear_error (sin(w x) + gear_skewness sin(2 w x))``, with ``w = 2 pi / gear_pitch``.

    Parameters
    ----------
    position, velocity
        Of the gear's output [rad], [rad/s], each of shape (n,).
    sensors
        With the gear's numbers.
    """
    w, skewness = 2 * math.pi / sensors.gear_pitch, sensors.gear_skewness
    shaft = position
    for _ in range(GEAR_STEPS):
        ahead = np.sin(w * shaft) + skewness * np.sin(2 * w * shaft)
        slope = w * (np.cos(w * shaft) + 2 * skewness * np.cos(2 * w * shaft))
        turning = 1.0 + sensors.gear_error * slope
        shaft = shaft - (shaft + sensors.gear_error * ahead - position) / turning
    return shaft, velocity / turning


def read(motion: Motion, setup: Setup, rate: float, seed: int) -> Reading:
    """Return the sensor signals without noise, at the simulation's rate [Hz].

    `seed` sets the phase of the mains.
    """
    s: Sensors = setup.sensors
    on_motor = setup.rig.encoder_on_motor > 0.5
    position = motion.motor if on_motor else motion.plate
    velocity = motion.motor_velocity if on_motor else motion.plate_velocity
    if s.encoder_backlash > 0:
        position = _backlash(position, s.encoder_backlash)
    if s.gear_error > 0:
        position, velocity = before_gear(position, velocity, s)
    position = position * (1.0 + s.position_gain)
    torque = motion.torque
    if s.mode_hz > 0:
        torque = _resonance(torque, s.mode_hz, s.mode_zeta, rate)
    if s.torque_lag > 0:
        decay = math.exp(-1.0 / (s.torque_lag * rate))
        torque = lfilter([1.0 - decay], [1.0, -decay], torque - torque[0]) + torque[0]
    if s.torque_delay > 0:
        torque = _late(torque, s.torque_delay, rate)
    elif s.torque_delay < 0:
        # A torque channel that is ahead is a motion channel that is behind.
        position, velocity = (
            _late(position, -s.torque_delay, rate),
            _late(velocity, -s.torque_delay, rate),
        )
    if s.cable > 0:
        torque = torque + s.cable * _resonance(velocity**2, s.cable_hz, s.cable_zeta, rate)
    if s.mains > 0:
        slow = sosfilt(
            butter(1, 1.0 / (2 * math.pi * ACTIVITY_TIME), fs=rate, output="sos"),
            np.abs(motion.torque - np.mean(motion.torque)),
        )
        phase = np.random.default_rng(seed).uniform(0, 2 * math.pi)
        torque = torque + s.mains * slow * np.sin(
            2 * math.pi * MAINS_HZ * np.arange(len(torque)) / rate + phase
        )
    if s.torque_step > 0:
        torque = _coarse(torque, s.torque_step)
    return Reading(position, velocity, torque)


def sample(reading: Reading, sensors: Sensors, rate: float, every: int, seed: int) -> Reading:
    """Filter against aliases, keep every k-th value and add sensor noise.

    Noise is white, its power by the SNR [dB] of each channel's fluctuating part.
    """
    generator = np.random.default_rng(seed)
    alias = butter(ALIAS_ORDER, ALIAS_SHARE * 0.5 * rate / every, fs=rate, output="sos")
    noisy = []
    for signal, snr in zip(
        reading, (sensors.position_snr, sensors.velocity_snr, sensors.torque_snr), strict=True
    ):
        sampled = (sosfilt(alias, signal - signal[0]) + signal[0])[::every]
        noisy.append(
            sampled
            + sampled.std() * 10.0 ** (-snr / 20.0) * generator.standard_normal(len(sampled))
        )
    return Reading(*noisy)
