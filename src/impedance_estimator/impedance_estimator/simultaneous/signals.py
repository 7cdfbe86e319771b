"""Samples are turned into the signals of the regression.

They are smoothed, differentiated, rectified, decimated and passed through the reflex basis.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator import validity
from impedance_estimator.compilation import part
from impedance_estimator.digital_filters import settle_filter
from impedance_estimator.simultaneous.nuisance import (
    CENTRE_TIME,
    EXTRAS,
    REFERENCE_FILTER_DAMPING,
    REFERENCE_FILTER_HZ,
    RELAXATION_TIME,
    TAP_REACH,
    TAPS,
    YIELD_TRAVEL,
    tap_shift,
)
from impedance_estimator.simultaneous.regression import INTRINSIC
from impedance_estimator.simultaneous.state import Plan, State


@part
def restart_path(
    p: Plan,
    s: State,
    x: float,
    v: float,
    torque: float,
    reference: float,
    reflex: float,
    commanded_reflex: float,
) -> None:
    """Fill all histories with the first good sample."""
    c = s.counters[0]
    c.referenced = np.isfinite(reference)
    c.filters_settled = 0
    s.raw[0], s.raw[1], s.raw[2] = x, v if p.measured_velocity else 0.0, torque
    s.raw[3] = reference if c.referenced else 0.0
    s.raw[4] = reflex
    s.raw[5] = commanded_reflex if c.referenced else 0.0
    s.actuator[0], s.actuator[1] = s.raw[3, 0], 0.0
    s.rectified[:] = 0.0
    s.slow_rectified[:] = 0.0
    for motion in range(2):
        s.slow_states[motion, 0] = s.raw[3 * motion, 0]
        s.slow_states[motion, 1] = 0.0
        s.slow_states[motion, 2] = s.raw[3 * motion, 0]
    c.centred = 0
    s.signals[:] = 0.0
    size = s.signals.shape[0] // 2
    s.signals[0], s.signals[size], s.signals[size + 1] = x, torque, s.raw[3, 0]
    s.past[:] = 0.0
    for k in range(s.past.shape[0]):
        s.past[k, 0, 0], s.past[k, 1, 0] = x, s.raw[3, 0]
        s.past[k, 0, -1] = torque
        if p.modelled_reflex:
            s.past[k, 0, INTRINSIC], s.past[k, 1, INTRINSIC] = s.raw[4, 0], s.raw[5, 0]
    if p.modelled_reflex:
        s.signals[INTRINSIC], s.signals[size + 1 + INTRINSIC] = s.raw[4, 0], s.raw[5, 0]
    for model in range(s.filters.shape[0]):
        s.whitened[:] = s.signals
        settle_filter(p.whitening[model], s.filters[model], s.whitened)
    c.index = 0
    k = s.clock[0]
    k.pause = p.pause_samples
    k.interruption = k.pending
    k.pending = validity.VALID


@part
def remember(history: np.ndarray, index: int, value: float) -> None:
    """Write a value twice, half a history apart: a stretch up to it is then always in one piece."""
    size = history.shape[0] // 2
    history[index % size] = value
    history[index % size + size] = value


@part
def weighted(history: np.ndarray, index: int, delay: int, weights: np.ndarray) -> float:
    """Return Σ weights times the stretch of history that ends `delay` samples before the newest
    one.
    """
    size = history.shape[0] // 2
    start = index % size + size - delay - weights.shape[0] + 1
    total = 0.0
    for k in range(weights.shape[0]):
        total += weights[k] * history[start + k]
    return total


@part
def rectified_velocity(p: Plan, s: State, index: int) -> tuple[float, float]:
    """Return the smoothed velocity, and v₊, both n samples before the newest one.

    Whether the ankle is stretched is read from the smoothed velocity, how fast from the measured
    one: rectified noise would add a tenth of its size at rest and nothing in motion, a smoothed
    velocity would lose the area where a pulse turns. Both bias G by half a per cent.
    """
    if not p.measured_velocity:
        return _rectified_slope(p, s.raw[0], index)
    smooth = weighted(s.raw[1], index, 0, p.kernels[0])
    if smooth <= p.rest_velocity:
        return smooth, 0.0
    size = s.raw.shape[1] // 2
    return smooth, s.raw[1, index % size + size - p.kernels.shape[1] // 2]


@part
def rectified_reference(p: Plan, s: State, index: int) -> tuple[float, float]:
    """Return the rectified signals of the reference behind the nominal actuator."""
    return _rectified_slope(p, s.raw[3], index)


@part
def _rectified_slope(p: Plan, x: np.ndarray, index: int) -> tuple[float, float]:
    """Return the smoothed derivatives of a position."""
    smooth = weighted(x, index, 0, p.kernels[1])
    if smooth <= p.rest_velocity:
        return smooth, 0.0
    size = x.shape[0] // 2
    at = index % size + size - p.kernels.shape[1] // 2
    # Central difference of fourth order (Fornberg, Math. Comp. 51 (1988) 699-706, table 1).
    return smooth, (8.0 * (x[at + 1] - x[at - 1]) - x[at + 2] + x[at - 2]) * p.rate / 12.0


@part
def drive_actuator(p: Plan, s: State, reference: float) -> float:
    """Return the position [rad] to which a nominal actuator turns the reference."""
    state = s.actuator
    omega = 2.0 * np.pi * REFERENCE_FILTER_HZ
    acceleration = omega * omega * (reference - state[0])
    acceleration -= 2.0 * REFERENCE_FILTER_DAMPING * omega * state[1]
    state[1] += acceleration / p.rate
    state[0] += state[1] / p.rate
    return state[0]


@part
def decimated_signals(p: Plan, s: State, index: int) -> None:
    """Return the motion, torque and instruments, 2 n raw and `TAP_REACH` decimated samples before
    the newest one.
    """
    c = s.counters[0]
    n = p.kernels.shape[1] // 2
    slow = index // p.decimation
    length = s.past.shape[0]
    now = s.past[slow % length]
    for motion in range(2 if c.referenced else 1):
        u, x = now[motion], s.raw[3 * motion]
        u[0] = weighted(x, index, n, p.kernels[0])
        if motion == 0 and p.measured_velocity:
            u[1] = weighted(s.raw[1], index, n, p.kernels[0])
            u[2] = weighted(s.raw[1], index, n, p.kernels[1])
        else:
            u[1] = weighted(x, index, n, p.kernels[1])
            u[2] = weighted(x, index, n, p.kernels[2])
        if p.modelled_reflex:
            u[INTRINSIC] = weighted(s.raw[4 + motion], index, n, p.kernels[0])
        else:
            if p.given_stretch:
                stretch = weighted(s.raw[4 + motion], index, n, p.kernels[0])
            else:
                stretch = weighted(s.rectified[motion], index, 0, p.kernels[0])
            stretches = s.slow_rectified[motion]
            remember(stretches, slow, stretch)
            _reflex_signals(p, stretches, slow, u)
        _slow_signals(p, s.slow_states[motion], c.centred, u)
    now[0, -1] = weighted(s.raw[2], index, n, p.kernels[0])
    c.centred += 1
    _shift(s, slow, 0, s.signals[: s.signals.shape[0] // 2])
    middle = s.past[(slow - TAP_REACH) % length]
    size = s.signals.shape[0] // 2
    s.signals[size] = middle[0, -1]
    if c.referenced:
        _shift(s, slow, 1, s.signals[size + 1 :])


@part
def _reflex_signals(p: Plan, stretches: np.ndarray, slow: int, u: np.ndarray) -> None:
    """Return the reflex basis' answers to v₊."""
    count = p.functions.shape[1]
    for j in range(count):
        u[INTRINSIC + j] = 0.0
    size = stretches.shape[0] // 2
    newest = slow % size + size
    for lag in range(size):
        stretch = stretches[newest - lag]
        # The ankle is stretched a tenth of the time.
        if stretch != 0.0:
            for j in range(count):
                u[INTRINSIC + j] += stretch * p.functions[lag, j]


@part
def _slow_signals(p: Plan, state: np.ndarray, samples: int, u: np.ndarray) -> None:
    """Return the relaxing position, yielding friction, and powers of position about the operating
    point.
    """
    step = p.decimation / p.rate
    first = INTRINSIC + p.functions.shape[1]
    state[0] += (u[0] - state[0]) * (1.0 - np.exp(-step / RELAXATION_TIME))
    u[first] = u[0] - state[0]
    side = 1.0 if u[1] > 0.0 else -1.0
    state[1] = side + (state[1] - side) * np.exp(-abs(u[1]) * step / YIELD_TRAVEL)
    u[first + 1] = state[1]
    state[2] += (u[0] - state[2]) / min(samples + 1.0, CENTRE_TIME / step)
    away = u[0] - state[2]
    u[first + 2], u[first + 3] = away**2, away**3


@part
def _shift(s: State, slow: int, motion: int, out: np.ndarray) -> None:
    """Return the signals of one motion from its past: those at the middle, and accelerations around
    it.
    """
    length = s.past.shape[0]
    middle = s.past[(slow - TAP_REACH) % length, motion]
    base = out.shape[0] - EXTRAS
    for j in range(base):
        out[j] = middle[j]
    for tap in range(TAPS):
        shift = int(tap_shift(tap))
        out[base + tap] = s.past[(slow - TAP_REACH - shift) % length, motion, 2] - middle[2]
    for j in range(EXTRAS - TAPS):
        out[base + TAPS + j] = middle[base + j]
