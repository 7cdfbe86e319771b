"""What changes while a trial runs: voluntary torque, tremor, fatigue, co-contraction, habituation,
conduction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import butter, sosfilt, sosfiltfilt

from blind_rig.anatomy import Setup

# A startle stiffens after its own latency, for a quarter of a second (Brown et al. 1991: 80-250 ms
# in leg muscles).
STARTLE_BEGIN, STARTLE_LENGTH = 0.110, 0.250
# Bouts of a habituated reflex: mean duration [s], long against a response and short against a
# trial.
BOUT = 3.0
# Conduction and excitability drift with posture and arousal, over seconds.
WANDER_HZ = 0.3
# The delay stays physiological whatever wanders.
DELAY_RANGE = (0.025, 0.070)


class Course(NamedTuple):
    """Momentary values at every step, each of shape (n,).

    Attributes
    ----------
    voluntary
        Voluntary torque [N.m].
    steady
        The same without tremor [N.m].
    muscle_scale, reflex_scale
        Factors on K and B, and on the reflex [1].
    delay
        Of the reflex [s].
    """

    voluntary: np.ndarray
    steady: np.ndarray
    muscle_scale: np.ndarray
    reflex_scale: np.ndarray
    delay: np.ndarray


def slow_noise(
    n: int, rate: float, low: float, high: float, generator: np.random.Generator
) -> np.ndarray:
    """Gaussian noise of unit rms between two frequencies [Hz]; `low` of 0 is a low-pass."""
    # Drawn at a rate fit for its band, so that the same seed gives the same course at any rate.
    coarse = max(40.0 * high, 20.0)
    count = int(np.ceil(n / rate * coarse)) + int(coarse * 20.0 / max(high, 0.1)) + 8
    band = (
        butter(2, high, fs=coarse, output="sos")
        if low <= 0
        else butter(2, (low, high), "bandpass", fs=coarse, output="sos")
    )
    noise = sosfiltfilt(band, generator.standard_normal(count))
    noise = (noise - noise.mean()) / noise.std()
    start = (count - n / rate * coarse) / 2
    fine = np.interp(start + np.arange(n) / rate * coarse, np.arange(count), noise)
    # Linear interpolation leaves corners, which a low-pass far above the band takes away.
    return sosfilt(butter(2, min(8.0 * high, 0.45 * rate), fs=rate, output="sos"), fine)


def course(setup: Setup, onsets: np.ndarray, n: int, rate: float, seed: int) -> Course:
    """Momentary values of a trial.

    Parameters
    ----------
    onsets
        Times at which movements start [s].
    n, rate
        Steps and steps per second [Hz].
    seed
        Each influence has its own stream, so that switching one on leaves the others as they were.
    """
    voluntary_stream, tremor_stream, startle_stream, bout_stream, wander_stream = (
        np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(5)
    )
    c = setup.courses
    t = np.arange(n) / rate
    fluctuation = c.voluntary_rms * slow_noise(n, rate, 0.0, c.voluntary_hz, voluntary_stream)
    voluntary = steady = c.torque_level + fluctuation
    if c.tremor_rms > 0:
        voluntary = voluntary + c.tremor_rms * slow_noise(
            n, rate, c.tremor_hz - 1.0, c.tremor_hz + 1.0, tremor_stream
        )
    muscle: np.ndarray = np.ones(n)
    reflex: np.ndarray = np.ones(n)
    if c.fatigue > 0:
        muscle = muscle * (1.0 - c.fatigue * t / t[-1])
        reflex = reflex * (1.0 - c.fatigue * t / t[-1])
    relative = fluctuation / c.torque_level
    if c.stiffness_follows > 0:
        muscle = muscle * np.maximum(1.0 + c.stiffness_follows * relative, 0.1)
    if c.reflex_follows > 0:
        reflex = reflex * np.maximum(1.0 + c.reflex_follows * relative, 0.0)
    if c.startle_share > 0:
        startled = onsets[startle_stream.random(len(onsets)) < c.startle_chance] + STARTLE_BEGIN
        phase = np.full(n, np.inf)
        for start in startled:
            first, last = round(start * rate), round((start + STARTLE_LENGTH) * rate)
            phase[first:last] = (t[first:last] - start) / STARTLE_LENGTH
        muscle = muscle * np.where(
            phase < 1.0, 1.0 + c.startle_share * np.sin(np.pi * np.clip(phase, 0, 1)) ** 2, 1.0
        )
    if c.burst_share > 0:
        bouts = np.cumsum(bout_stream.exponential(BOUT, int(3 * t[-1] / BOUT) + 20))
        reflex = reflex * (1.0 - c.burst_share * (np.searchsorted(bouts, t) % 2))
    delay: np.ndarray = np.full(n, setup.reflex.delay)
    if c.delay_wander > 0:
        delay = np.clip(
            delay + c.delay_wander * slow_noise(n, rate, 0.0, WANDER_HZ, wander_stream),
            *DELAY_RANGE,
        )
    return Course(voluntary, steady, muscle, reflex, delay)
