"""Samples are turned into the signals of the regression.

They are smoothed, differentiated, rectified, decimated and passed through the reflex basis.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator import validity
from impedance_estimator.compilation import part, sample_part
from impedance_estimator.digital_filters import settle_filter
from impedance_estimator.simultaneous.nuisance import (
    BEND,
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


@sample_part
def remember(histories: np.ndarray, row: int, at: int, value: float) -> None:
    """Write the newest value of a history twice, half the history apart: a stretch up to it is then
    always in one piece.

    Parameters
    ----------
    histories
        Shape (k, 2 length).
    row
        Which of them.
    at
        Number of the sample modulo the length.
    value
        The sample.
    """
    histories[row, at] = value
    histories[row, at + histories.shape[1] // 2] = value


@sample_part
def weighted(
    histories: np.ndarray, row: int, at: int, delay: int, kernels: np.ndarray, kernel: int
) -> float:
    """Return Σ weights of one of the kernels times the stretch of a history that ends `delay`
    samples before the newest one, which is `at`; four sums beside each other, since one would wait
    for each of its additions.
    """
    length = kernels.shape[1]
    start = at + histories.shape[1] // 2 - delay - length + 1
    fours = length - length % 4
    a = b = c = d = 0.0
    for k in range(0, fours, 4):
        a += kernels[kernel, k] * histories[row, start + k]
        b += kernels[kernel, k + 1] * histories[row, start + k + 1]
        c += kernels[kernel, k + 2] * histories[row, start + k + 2]
        d += kernels[kernel, k + 3] * histories[row, start + k + 3]
    for k in range(fours, length):
        a += kernels[kernel, k] * histories[row, start + k]
    return (a + b) + (c + d)


@sample_part
def rectified_velocity(p: Plan, s: State, at: int) -> tuple[float, float]:
    """Return the smoothed velocity, and v₊, both n samples before the newest one.

    Whether the ankle is stretched is read from the smoothed velocity, how fast from the measured
    one: rectified noise would add a tenth of its size at rest and nothing in motion, a smoothed
    velocity would lose the area where a pulse turns. Both bias G by half a per cent.
    """
    if not p.measured_velocity:
        return _rectified_slope(p, s.raw, 0, at)
    smooth = weighted(s.raw, 1, at, 0, p.kernels, 0)
    if smooth <= p.rest_velocity:
        return smooth, 0.0
    return smooth, s.raw[1, at + s.raw.shape[1] // 2 - p.kernels.shape[1] // 2]


@sample_part
def rectified_reference(p: Plan, s: State, at: int) -> float:
    """Return the rectified velocity of the reference behind the nominal actuator."""
    return _rectified_slope(p, s.raw, 3, at)[1]


@sample_part
def _rectified_slope(p: Plan, raw: np.ndarray, row: int, at: int) -> tuple[float, float]:
    """Return the smoothed derivatives of a position."""
    smooth = weighted(raw, row, at, 0, p.kernels, 1)
    if smooth <= p.rest_velocity:
        return smooth, 0.0
    middle = at + raw.shape[1] // 2 - p.kernels.shape[1] // 2
    # Central difference of fourth order (Fornberg, Math. Comp. 51 (1988) 699-706, table 1).
    slope = 8.0 * (raw[row, middle + 1] - raw[row, middle - 1])
    slope = slope - raw[row, middle + 2] + raw[row, middle - 2]
    return smooth, slope * p.rate / 12.0


@sample_part
def drive_actuator(p: Plan, s: State, reference: float) -> float:
    """Return the position [rad] to which a nominal actuator turns the reference."""
    state = s.actuator
    omega = 2.0 * np.pi * REFERENCE_FILTER_HZ
    acceleration = omega * omega * (reference - state[0])
    acceleration -= 2.0 * REFERENCE_FILTER_DAMPING * omega * state[1]
    state[1] += acceleration / p.rate
    state[0] += state[1] / p.rate
    return state[0]


@sample_part
def decimated_signals(p: Plan, s: State, at: int, rectified_at: int) -> None:
    """Return the motion, torque and instruments, 2 n raw and `TAP_REACH` decimated samples before
    the newest one.

    Parameters
    ----------
    p, s
        Plan and state of the estimator.
    at, rectified_at
        Places of the newest sample in the raw and in the rectified histories.
    """
    c = s.counters[0]
    n = p.kernels.shape[1] // 2
    slow = c.index // p.decimation
    length = s.past.shape[0]
    now = s.past[slow % length]
    newest = slow % (s.slow_rectified.shape[1] // 2)
    for motion in range(2 if c.referenced else 1):
        u, x = now[motion], 3 * motion
        u[0] = weighted(s.raw, x, at, n, p.kernels, 0)
        if motion == 0 and p.measured_velocity:
            u[1] = weighted(s.raw, 1, at, n, p.kernels, 0)
            u[2] = weighted(s.raw, 1, at, n, p.kernels, 1)
        else:
            u[1] = weighted(s.raw, x, at, n, p.kernels, 1)
            u[2] = weighted(s.raw, x, at, n, p.kernels, 2)
        if p.modelled_reflex:
            u[INTRINSIC] = weighted(s.raw, 4 + motion, at, n, p.kernels, 0)
        else:
            if p.given_stretch:
                stretch = weighted(s.raw, 4 + motion, at, n, p.kernels, 0)
            else:
                stretch = weighted(s.rectified, motion, rectified_at, 0, p.kernels, 0)
            remember(s.slow_rectified, motion, newest, stretch)
            _reflex_signals(p, s, motion, newest, u)
        _slow_signals(p, s.slow_states[motion], c.centred, u)
    now[0, -1] = weighted(s.raw, 2, at, n, p.kernels, 0)
    c.centred += 1
    size = s.signals.shape[0] // 2
    middle = (slow - TAP_REACH) % length
    _shift(s.past, middle, 0, s.signals[:size])
    s.signals[size] = s.past[middle, 0, -1]
    if c.referenced:
        _shift(s.past, middle, 1, s.signals[size + 1 :])


@sample_part
def _reflex_signals(p: Plan, s: State, motion: int, newest: int, u: np.ndarray) -> None:
    """Return the reflex basis' answers to v₊, and the present muscle's to the square of v₊."""
    count = p.functions.shape[1]
    for j in range(count):
        u[INTRINSIC + j] = 0.0
    bend = 0.0
    stretches = s.slow_rectified
    size = stretches.shape[1] // 2
    recent = stretches[motion, newest + 1 : newest + 1 + size]
    fours = size - size % 4
    for k in range(0, fours, 4):
        a, b, c, d = recent[k], recent[k + 1], recent[k + 2], recent[k + 3]
        # The ankle is stretched a tenth of the time.
        if a != 0.0 or b != 0.0 or c != 0.0 or d != 0.0:
            lag = size - 1 - k
            for j in range(count):
                u[INTRINSIC + j] = (
                    u[INTRINSIC + j]
                    + a * p.functions[lag, j]
                    + b * p.functions[lag - 1, j]
                    + c * p.functions[lag - 2, j]
                    + d * p.functions[lag - 3, j]
                )
            bend += (
                a * a * s.muscle[lag]
                + b * b * s.muscle[lag - 1]
                + c * c * s.muscle[lag - 2]
                + d * d * s.muscle[lag - 3]
            )
    for k in range(fours, size):
        for j in range(count):
            u[INTRINSIC + j] += recent[k] * p.functions[size - 1 - k, j]
        bend += recent[k] * recent[k] * s.muscle[size - 1 - k]
    u[INTRINSIC + count + BEND - TAPS] = bend


@sample_part
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


@sample_part
def _shift(past: np.ndarray, middle: int, motion: int, out: np.ndarray) -> None:
    """Return the signals of one motion from its past: those at the middle, and accelerations around
    it.
    """
    length = past.shape[0]
    base = out.shape[0] - EXTRAS
    for j in range(base):
        out[j] = past[middle, motion, j]
    for tap in range(TAPS):
        at = middle - int(tap_shift(tap))
        at += length if at < 0 else (-length if at >= length else 0)
        out[base + tap] = past[at, motion, 2] - past[middle, motion, 2]
    for j in range(EXTRAS - TAPS):
        out[base + TAPS + j] = past[middle, motion, base + j]
