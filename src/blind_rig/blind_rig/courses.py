"""Courses are what changes while a trial runs.

They are voluntary torque, tremor, fatigue, co-contraction, habituation and conduction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy.signal import butter, sosfilt, sosfiltfilt

from blind_rig.anatomy import Courses, Setup

# A startle stiffens after its own latency, for a quarter of a second (Brown et al. 1991: 80-250 ms
# in leg muscles).
STARTLE_BEGIN, STARTLE_LENGTH = 0.110, 0.250
# Bouts of a habituated reflex: mean duration [s], long against a response and short against a
# trial.
BOUT_DURATION = 3.0
# Conduction and excitability drift with posture and arousal, over seconds.
WANDER_HZ = 0.3
# Voluntary torque holds a level, or moves evenly between two, for this long on average [s].
LEVEL_TIME = 4.0
# A voluntary burst: mean pause between two, and duration of one [s].
BURST_PAUSE, BURST_LENGTH = 8.0, 0.4
# A jump of the level takes the time of a quick voluntary contraction [s].
JUMP_TIME = 0.15
# Lowest frequency of 1/f torque [Hz]: half a minute, below which a subject sees the drift.
PINK_LOWEST = 0.03
# Highest frequency of 1/f torque [Hz]: the low-pass of muscle.
PINK_HIGHEST = 5.0
# The delay stays physiological whatever wanders.
DELAY_RANGE = (0.025, 0.070)


class Course(NamedTuple):
    """Holds momentary values at every step, each of shape (n,).

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
    """Return Gaussian noise of unit rms between two frequencies [Hz]; `low` of 0 is a low-pass."""
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


def pink_noise(n: int, rate: float, generator: np.random.Generator) -> np.ndarray:
    """Return noise of unit rms whose power falls as 1/f between `PINK_LOWEST` and `PINK_HIGHEST`
    [Hz].
    """
    coarse = 8.0 * PINK_HIGHEST
    count = int(np.ceil(n / rate * coarse)) + 8
    frequency = np.fft.rfftfreq(count, 1.0 / coarse)
    within = (frequency >= PINK_LOWEST) & (frequency <= PINK_HIGHEST)
    shape = np.zeros(len(frequency))
    shape[within] = frequency[within] ** -0.5
    drawn = generator.standard_normal((2, len(frequency)))
    noise = np.fft.irfft(shape * (drawn[0] + 1j * drawn[1]), count)
    noise = (noise - noise.mean()) / noise.std()
    fine = np.interp(np.arange(n) / rate * coarse, np.arange(count), noise)
    return sosfilt(butter(2, 4.0 * PINK_HIGHEST, fs=rate, output="sos"), fine)


def wandering_levels(
    n: int, rate: float, transition: float | None, generator: np.random.Generator
) -> np.ndarray:
    """Return levels of unit rms, each reached within `transition` [s]; None: on the way all the
    time.
    """
    count = int(n / rate / LEVEL_TIME * 3.0) + 8
    times = np.concatenate([[0.0], np.cumsum(generator.uniform(0.3, 1.7, count) * LEVEL_TIME)])
    values = generator.standard_normal(len(times))
    t = np.arange(n) / rate
    if transition is None:
        return np.interp(t, times, values)
    knots = np.column_stack([times[1:], times[1:] + transition]).ravel()
    held = np.column_stack([values[:-1], values[1:]]).ravel()
    return np.interp(t, knots, held)


def bursts(n: int, rate: float, generator: np.random.Generator) -> np.ndarray:
    """Return raised-cosine contractions of peak +1 or -1 at random times."""
    out = np.zeros(n)
    length = round(BURST_LENGTH * rate)
    shape = 0.5 - 0.5 * np.cos(2.0 * np.pi * np.arange(length) / length)
    at = generator.exponential(BURST_PAUSE)
    while (first := round(at * rate)) + length < n:
        out[first : first + length] += shape * generator.choice([-1.0, 1.0])
        at += BURST_LENGTH + generator.exponential(BURST_PAUSE)
    return out


def course(
    setup: Setup,
    onsets: np.ndarray,
    n: int,
    rate: float,
    seed: int,
    task: np.ndarray | float = 0.0,
) -> Course:
    """Return momentary values of a trial.

    Parameters
    ----------
    setup
        Rig, subject and influences.
    onsets
        Times at which movements start [s].
    n, rate
        Steps and steps per second [Hz].
    seed
        Each influence has its own stream, so that switching one on leaves the others as they were.
    task
        Torque that the subject is asked to hold beside its level [N.m], shape (n,) or one number.
    """
    streams = _Streams(*(np.random.default_rng(s) for s in np.random.SeedSequence(seed).spawn(10)))
    c = setup.courses
    t = np.arange(n) / rate
    fluctuation = _fluctuation(c, n, rate, streams) + task
    steady = c.torque_level + fluctuation
    voluntary = steady
    if c.tremor_rms > 0:
        voluntary = voluntary + c.tremor_rms * slow_noise(
            n, rate, c.tremor_hz - 1.0, c.tremor_hz + 1.0, streams.tremor
        )
    relative = fluctuation / c.torque_level
    delay: np.ndarray = np.full(n, setup.reflex.delay)
    if c.delay_wander > 0:
        delay = np.clip(
            delay + c.delay_wander * slow_noise(n, rate, 0.0, WANDER_HZ, streams.wander),
            *DELAY_RANGE,
        )
    muscle = _muscle_scale(c, t, relative, onsets, rate, streams)
    return Course(voluntary, steady, muscle, _reflex_scale(c, t, relative, onsets, streams), delay)


class _Streams(NamedTuple):
    """Holds a generator of random numbers for each influence."""

    voluntary: np.random.Generator
    tremor: np.random.Generator
    startle: np.random.Generator
    bouts: np.random.Generator
    wander: np.random.Generator
    pink: np.random.Generator
    steps: np.random.Generator
    ramps: np.random.Generator
    bursts: np.random.Generator
    variation: np.random.Generator


def _fluctuation(c: Courses, n: int, rate: float, streams: _Streams) -> np.ndarray:
    """Return voluntary torque about its level [N.m], without tremor."""
    out = c.voluntary_rms * slow_noise(n, rate, 0.0, c.voluntary_hz, streams.voluntary)
    if c.pink_rms > 0:
        out = out + c.pink_rms * pink_noise(n, rate, streams.pink)
    if c.steps_rms > 0:
        out = out + c.steps_rms * wandering_levels(n, rate, JUMP_TIME, streams.steps)
    if c.ramps_rms > 0:
        out = out + c.ramps_rms * wandering_levels(n, rate, None, streams.ramps)
    if c.bursts_peak > 0:
        out = out + c.bursts_peak * bursts(n, rate, streams.bursts)
    return out


def _muscle_scale(
    c: Courses,
    t: np.ndarray,
    relative: np.ndarray,
    onsets: np.ndarray,
    rate: float,
    streams: _Streams,
) -> np.ndarray:
    """Return the factor on K and B; `relative` is the voluntary torque about its level, as a share
    of it.
    """
    muscle: np.ndarray = np.ones(len(t))
    if c.fatigue > 0:
        muscle = muscle * (1.0 - c.fatigue * t / t[-1])
    if c.jump_at > 0:
        muscle = np.where(t < c.jump_at, muscle, muscle * c.jump_muscle)
    if c.stiffness_follows > 0:
        muscle = muscle * np.maximum(1.0 + c.stiffness_follows * relative, 0.1)
    if c.startle_share > 0:
        startled = onsets[streams.startle.random(len(onsets)) < c.startle_chance] + STARTLE_BEGIN
        phase = np.full(len(t), np.inf)
        for start in startled:
            first, last = round(start * rate), round((start + STARTLE_LENGTH) * rate)
            phase[first:last] = (t[first:last] - start) / STARTLE_LENGTH
        muscle = muscle * np.where(
            phase < 1.0, 1.0 + c.startle_share * np.sin(np.pi * np.clip(phase, 0, 1)) ** 2, 1.0
        )
    return muscle


def _reflex_scale(
    c: Courses, t: np.ndarray, relative: np.ndarray, onsets: np.ndarray, streams: _Streams
) -> np.ndarray:
    """Return the factor on the reflex; `relative` as for the muscle."""
    reflex: np.ndarray = np.ones(len(t))
    if c.fatigue > 0:
        reflex = reflex * (1.0 - c.fatigue * t / t[-1])
    if c.stretch_variation > 0 and len(onsets):
        drawn = 1.0 + c.stretch_variation * streams.variation.standard_normal(len(onsets) + 1)
        reflex = reflex * np.maximum(drawn, 0.0)[np.searchsorted(onsets, t)]
    if c.jump_at > 0:
        reflex = np.where(t < c.jump_at, reflex, reflex * c.jump_reflex)
    if c.reflex_follows > 0:
        reflex = reflex * np.maximum(1.0 + c.reflex_follows * relative, 0.0)
    if c.burst_share > 0:
        bouts = np.cumsum(
            streams.bouts.exponential(BOUT_DURATION, int(3 * t[-1] / BOUT_DURATION) + 20)
        )
        reflex = reflex * (1.0 - c.burst_share * (np.searchsorted(bouts, t) % 2))
    return reflex
