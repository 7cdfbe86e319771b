"""Decisions on which samples are used, and the reasons why an estimate is not valid.

A sample is dropped when one of its numbers is not finite or beyond what an ankle or a rig can
produce, or when its time is not after the newest one. After dropped or missing samples the signal
path (low-pass, differences, rectified velocity's history) starts again from the first good sample,
in the steady state of its values, and the running averages hold still until the path has settled:
0.4 s of reflex history and five periods of the low-pass. Then they go on where they were. The same
holds for a rest, two seconds without motion, so that sensor noise never replaces the perturbation.
An interruption that is longer than the memory of the running averages, or time that goes back by as
much, starts everything anew, because the averages would describe another state of the ankle.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

(
    VALID,
    WAITING,
    SETTLING,
    GAP,
    BACKWARDS,
    NOT_FINITE,
    OUT_OF_RANGE,
    STILL,
    COLLINEAR,
    NO_TORQUE,
    NO_REFLEX,
    REFERENCE,
) = range(12)

REASONS = {
    VALID: "",
    WAITING: "no usable sample yet",
    SETTLING: "settling after the start",
    GAP: "samples are missing",
    BACKWARDS: "time runs backwards",
    NOT_FINITE: "samples are NaN or infinite",
    OUT_OF_RANGE: "samples are beyond any ankle (over pi rad, 100 rad/s or 1000 N.m)",
    STILL: "the position does not change: no perturbation to learn from",
    COLLINEAR: "position, velocity and acceleration follow from each other (one frequency): K, B "
    "and I cannot be told apart",
    NO_TORQUE: "the torque does not change: is its sensor connected?",
    REFERENCE: "the reference came or stayed away: settling with the other instrument",
    NO_REFLEX: "rectified velocity does not determine the reflex response",
}

LARGEST_POSITION = math.pi
"""[rad] An ankle turns by about 1.5 rad in all; larger values are damaged, or degrees."""
LARGEST_VELOCITY = 100.0
"""A larger velocity [rad/s] is damaged: 0.1 rad within 1 ms."""
LARGEST_TORQUE = 1000.0
"""[N.m] Several times the strongest plantarflexion (about 200 N.m)."""

LEAST_VELOCITY = 0.05
"""A larger velocity [rad/s] counts as motion.

Eight times the rms noise of the paper's velocity signal (0.006 rad/s at 37.7 dB); perturbations
reach 1 rad/s.
"""
REST_DURATION = 2.0
"""The perturbation counts as off after so many seconds without motion: three times the longest
pause within it (0.7 s).
"""

RATE_WINDOW = 256
"""Samples over which the sampling rate is watched."""
RATE_TOLERANCE = 1e-3
"""The rate may differ by this relative error. Clocks drift by parts per million; K, B and I change
by up to twice the rate's error.
"""
CLOCK_TOLERANCE = 0.1
"""Steps that differ by less [sample intervals] come from a clock at another rate, not from missing
samples.
"""

_COUNTERS = (
    *("started", "row_count", "pause", "pending", "interruption", "still", "quiet", "settled"),
    *("intrinsic_fit", "reflex_fit", "chunk", "chunks", "batch", "window", "rate_lost"),
)
_TIMES = ("newest", "row_time", "window_start", "shortest", "longest", "previous")
CLOCK = np.dtype([(name, np.int64) for name in _COUNTERS] + [(name, np.float64) for name in _TIMES])
"""Counters [samples] and times [s] of the separation; one record."""

DROP, CONTINUE, RESTART_PATH, RESTART_ALL = range(4)


@njit(inline="always")
def watch_rate(clock: np.ndarray, rate: float, t: float) -> None:
    """Set ``rate_lost`` when `RATE_WINDOW` regular steps have another length than 1 / rate."""
    c = clock[0]
    if not np.isfinite(t):
        c.window = 0
        return
    if c.window == 0:
        c.window_start, c.previous, c.shortest, c.longest, c.window = t, t, np.inf, -np.inf, 1
        return
    step = t - c.previous
    c.previous = t
    c.shortest, c.longest = min(c.shortest, step), max(c.longest, step)
    c.window += 1
    if c.window > RATE_WINDOW:
        mean = (t - c.window_start) / RATE_WINDOW
        if (
            mean > 0.0
            and c.longest - c.shortest < CLOCK_TOLERANCE * mean
            and abs(mean * rate - 1.0) > RATE_TOLERANCE
        ):
            c.rate_lost = 1
        c.window = 0


@njit(inline="always")
def judge_sample(
    clock: np.ndarray, rate: float, memory: float, t: float, x: float, v: float, torque: float
) -> int:
    """Return what to do with a sample.

    Parameters
    ----------
    clock
        Record of `CLOCK`, shape (1,).
    rate
        Sampling rate [Hz].
    memory
        Longest interruption that is bridged [s].
    t, x, v, torque
        The sample; v is 0 where none is measured.

    Returns
    -------
    int
        `DROP`, `CONTINUE`, `RESTART_PATH` (after an interruption) or `RESTART_ALL`.
    """
    c = clock[0]
    if not (np.isfinite(t) and np.isfinite(x) and np.isfinite(v) and np.isfinite(torque)):
        c.pending = NOT_FINITE
        return DROP
    if abs(x) > LARGEST_POSITION or abs(v) > LARGEST_VELOCITY or abs(torque) > LARGEST_TORQUE:
        c.pending = OUT_OF_RANGE
        return DROP
    if not c.started:
        c.started = 1
        c.newest = t
        return RESTART_ALL
    steps = (t - c.newest) * rate
    # Half a sample: less is rounding of t, more means that a sample is missing or repeated.
    if steps < 0.5:
        c.pending = BACKWARDS
        if steps < -memory * rate:
            c.newest = t
            return RESTART_ALL
        return DROP
    c.newest = t
    if steps > 1.5 and c.pending == VALID:
        c.pending = GAP
    if steps > memory * rate:
        return RESTART_ALL
    return CONTINUE if c.pending == VALID else RESTART_PATH


@njit(inline="always")
def judge_motion(clock: np.ndarray, rate: float, memory: float, velocity: float) -> bool:
    """Follow rest and motion; True once when a rest has outlasted the memory of the running
    averages.
    """
    c = clock[0]
    if abs(velocity) > LEAST_VELOCITY:
        c.quiet = 0
        c.still = 0
        return False
    c.quiet += 1
    if c.quiet > REST_DURATION * rate:
        c.still = 1
    return c.quiet == int((REST_DURATION + memory) * rate)


@njit
def reason_code(clock: np.ndarray, settling: float) -> int:
    """Return why the present estimate is not valid, `VALID` where it is.

    `settling`: samples needed after the start.
    """
    c = clock[0]
    if c.pending != VALID:
        return c.pending
    if not c.started:
        return WAITING
    if c.pause > 0:
        return c.interruption
    if c.still:
        return STILL
    if c.settled < settling:
        return SETTLING
    if c.intrinsic_fit != VALID:
        return c.intrinsic_fit
    return c.reflex_fit
