"""Torque that a subject holds by will and does not hold still, and bouts of co-contraction."""

from __future__ import annotations

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter
from scipy.special import expit

from second_rig.drawing import evenly

# Will is slow: courses are made at this rate and interpolated [Hz].
RATE = 100.0
# Courses go on behind the last sample, which no spline then ends at [s].
MARGIN_S = 2.0
# Muscle does not follow a random walk faster than this [s].
MUSCLE_TIME_S = 0.15
# Correlation time of the small fluctuations that every subject has [s].
FLUCTUATION_TIME_S = 0.4
# Smooth edges of a bout of co-contraction: two low-passes in series [s].
BOUT_TIMES_S = (0.12, 0.2)

KINDS: dict[str, tuple[str, ...]] = {
    "leaky random walk": ("walk",),
    "postural steps": ("postures",),
    "fatigue ramp + respiration": ("ramp", "breath"),
    "leaky random walk + respiration": ("walk", "breath"),
    "postural steps + respiration": ("postures", "breath"),
    "leaky random walk + fatigue ramp": ("walk", "ramp"),
    "relaxed (small slow fluctuations only)": (),
}
"""What each kind of voluntary torque is made of."""


def _walk(count: int, time: float, size: float, generator: np.random.Generator) -> np.ndarray:
    """Return a leaky random walk behind the low-pass of a muscle, shape (`count`,)."""
    kept = np.exp(-1.0 / RATE / time)
    noise = generator.standard_normal(count)
    walk = size * lfilter([np.sqrt(1.0 - kept * kept)], [1.0, -kept], noise)
    return _low_passed(walk, MUSCLE_TIME_S)


def _low_passed(course: np.ndarray, time: float) -> np.ndarray:
    kept = np.exp(-1.0 / RATE / time)
    return lfilter([1.0 - kept], [1.0, -kept], course)


def _postures(coarse: np.ndarray, count: int, size: float, g: np.random.Generator) -> np.ndarray:
    """Return smooth steps between postures about their mean."""
    course = np.zeros(coarse.size)
    for moment in np.sort(g.uniform(0.0, coarse[-1], count)):
        step = g.normal() * size
        course += step * expit((coarse - moment) / g.uniform(0.08, 0.4))
    return course - course.mean()


def voluntary_torque(
    kind: str, time: np.ndarray, generator: np.random.Generator
) -> tuple[np.ndarray, dict[str, float]]:
    """Draw the torque that a subject holds beside the mean [N.m], shape (n,).

    Parameters
    ----------
    kind
        One of `KINDS`.
    time
        Since the start [s], shape (n,).
    generator
        Draws it.

    Returns
    -------
        The torque, and the numbers that were drawn for it.
    """
    parts = KINDS[kind]
    count = int((time[-1] + MARGIN_S) * RATE)
    coarse = np.arange(count) / RATE
    torque = np.zeros(count)
    about: dict[str, float] = {}
    if "walk" in parts:
        slowness, size = evenly(generator, 2.0, 15.0), evenly(generator, 0.15, 0.7)
        torque += _walk(count, slowness, size, generator)
        about |= {"walk_tau_s": slowness, "walk_sd": size}
    if "postures" in parts:
        number, size = int(generator.integers(3, 9)), evenly(generator, 0.3, 1.0)
        torque += _postures(coarse, number, size, generator)
        about |= {"postural_n": float(number), "postural_sd": size}
    if "ramp" in parts:
        size = evenly(generator, -1.5, 1.5)
        torque += size * (1.0 - np.exp(-coarse / evenly(generator, 30.0, 120.0)))
        about |= {"ramp": size}
    if "breath" in parts:
        size, frequency = evenly(generator, 0.08, 0.35), evenly(generator, 0.2, 0.3)
        wander = 0.06 * np.cumsum(generator.standard_normal(count))
        phase = 2.0 * np.pi * frequency * coarse + wander
        torque += size * (np.sin(phase) + 0.25 * np.sin(2.0 * phase + 1.0))
        about |= {"resp_amp": size, "resp_hz": frequency}
    torque += _walk(count, FLUCTUATION_TIME_S, evenly(generator, 0.02, 0.08), generator)
    return CubicSpline(coarse, torque)(time), about


def bouts(time: np.ndarray, generator: np.random.Generator) -> np.ndarray:
    """Draw bouts of co-contraction, between 0 and 1, shape (n,).

    Parameters
    ----------
    time
        Since the start [s], shape (n,).
    generator
        Draws them.
    """
    count = int((time[-1] + MARGIN_S) * RATE)
    course = np.zeros(count)
    now = evenly(generator, 2.0, 8.0)
    while now < time[-1]:
        length = evenly(generator, 3.0, 9.0)
        course[int(now * RATE) : int((now + length) * RATE)] = evenly(generator, 0.6, 1.0)
        now += length + evenly(generator, 5.0, 16.0)
    for slowness in BOUT_TIMES_S:
        course = _low_passed(course, slowness)
    return np.interp(time, np.arange(count) / RATE, course)
