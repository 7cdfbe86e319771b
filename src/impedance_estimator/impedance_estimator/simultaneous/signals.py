"""From samples to the signals of the regression: smoothed, differentiated, rectified, decimated,
passed through the reflex basis.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator import validity
from impedance_estimator.compilation import part
from impedance_estimator.digital_filters import settle_filter
from impedance_estimator.simultaneous.regression import INTRINSIC
from impedance_estimator.simultaneous.state import Plan, State


@part
def restart_path(p: Plan, s: State, x: float, v: float, torque: float) -> None:
    """Fill all histories with the first good sample."""
    s.raw[0], s.raw[1], s.raw[2] = x, v if p.measured_velocity else 0.0, torque
    s.rectified[:] = 0.0
    s.slow_rectified[:] = 0.0
    s.signals[:] = 0.0
    s.signals[0], s.signals[-1] = x, torque
    for model in range(s.filters.shape[0]):
        s.whitened[:] = s.signals
        settle_filter(p.whitening[model], s.filters[model], s.whitened)
    s.counters[0].index = 0
    k = s.clock[0]
    k.pause = p.pause_samples
    k.interruption = k.pending
    k.pending = validity.VALID


@part
def remember(history: np.ndarray, index: int, value: float) -> None:
    size = history.shape[0] // 2
    history[index % size] = value
    history[index % size + size] = value


@part
def weighted(history: np.ndarray, index: int, delay: int, weights: np.ndarray) -> float:
    """Σ weights times the stretch of history that ends `delay` samples before the newest one."""
    size = history.shape[0] // 2
    start = index % size + size - delay - weights.shape[0] + 1
    total = 0.0
    for k in range(weights.shape[0]):
        total += weights[k] * history[start + k]
    return total


@part
def rectified_velocity(p: Plan, s: State, index: int) -> tuple[float, float]:
    """Smoothed velocity, and v₊, both n samples before the newest one.

    Whether the ankle is stretched is read from the smoothed velocity, how fast from the measured
    one: rectified noise would add a tenth of its size at rest and nothing in motion, a smoothed
    velocity would lose the area where a pulse turns. Both bias G by half a per cent.
    """
    n = p.kernels.shape[1] // 2
    smooth = (
        weighted(s.raw[1], index, 0, p.kernels[0])
        if p.measured_velocity
        else weighted(s.raw[0], index, 0, p.kernels[1])
    )
    if smooth <= p.rest_velocity:
        return smooth, 0.0
    size = s.raw.shape[1] // 2
    at = index % size + size - n
    if p.measured_velocity:
        return smooth, s.raw[1, at]
    x = s.raw[0]
    # Central difference of fourth order (Fornberg, Math. Comp. 51 (1988) 699-706, table 1).
    return smooth, (8.0 * (x[at + 1] - x[at - 1]) - x[at + 2] + x[at - 2]) * p.rate / 12.0


@part
def decimated_signals(p: Plan, s: State, index: int) -> None:
    """x, v, a, φ and τ, 2 n samples before the newest one."""
    n = p.kernels.shape[1] // 2
    u = s.signals
    u[0] = weighted(s.raw[0], index, n, p.kernels[0])
    if p.measured_velocity:
        u[1] = weighted(s.raw[1], index, n, p.kernels[0])
        u[2] = weighted(s.raw[1], index, n, p.kernels[1])
    else:
        u[1] = weighted(s.raw[0], index, n, p.kernels[1])
        u[2] = weighted(s.raw[0], index, n, p.kernels[2])
    u[-1] = weighted(s.raw[2], index, n, p.kernels[0])
    slow = index // p.decimation
    remember(s.slow_rectified, slow, weighted(s.rectified, index, 0, p.kernels[0]))
    count = p.functions.shape[1]
    for j in range(count):
        u[INTRINSIC + j] = 0.0
    size = s.slow_rectified.shape[0] // 2
    newest = slow % size + size
    for lag in range(size):
        stretch = s.slow_rectified[newest - lag]
        # The ankle is stretched a tenth of the time.
        if stretch != 0.0:
            for j in range(count):
                u[INTRINSIC + j] += stretch * p.functions[lag, j]
