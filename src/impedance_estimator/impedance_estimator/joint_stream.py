"""The joint estimator, one sample after the other.

1. smooth and differentiate; rectify                    `gaussian_derivatives`
2. decimate to about 256 Hz; reflex basis * v₊          `reflex_shapes`
3. whiten under every noise model                       `voluntary_torque_noise`
4. sums of products, block by block of 1/16 s, in a ring
5. has the ankle changed? forget what was before        `change_detection`
6. K, B, I, G and the reflex's shape                    `joint_regression`
7. every second: noise model, scatter of the scores

`advance` does all of it for a block of samples. The state is a tuple of arrays that it changes in place.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numba import njit

from impedance_estimator import reflex_shapes, validity
from impedance_estimator.change_detection import find_change
from impedance_estimator.digital_filters import filter_step, settle_filter
from impedance_estimator.joint_regression import (
    GAINS,
    INTRINSIC,
    LEAST_GAIN,
    UNKNOWNS,
    solve_with_prior,
    squared_residual,
    unpack_sums,
)
from impedance_estimator.separation import _fingerprint
from impedance_estimator.voluntary_torque_noise import FIRST_MODEL, most_likely

ESTIMATES = 12
SHAPES = reflex_shapes.SHAPES

JUMP = np.array([100.0, 0.5, 0.005, 20.0])
"""[N.m/rad, N.m.s/rad, kg.m², N.m.s/rad] How far K, B, I and G may be from their old values after a change, one standard
deviation: a full contraction. It matters only until the first perturbation after the change."""
UNKNOWN = np.array([1e3, 10.0, 0.1, 1e3])
"""The same units: before any data."""
LARGEST_STEP = np.array([0.2, 0.2, 0.004])
"""Of ln ω, ln z and delay [s] in one relinearisation: the shape is linear enough for steps of 20 % and 4 ms."""
SHAPE_DRIFT = np.array([0.05, 0.05, 0.001])
"""Of ln ω, ln z and delay [s] with a change of K or G, one standard deviation: muscles slow down with fatigue by a few per cent."""
SHAPE_FORGETTING = 1.0 / 60.0
"""Per second: what was known about the shape before the memory is forgotten over a hold period."""
LIKELIER = 5.0
"""ln L by which another noise model must be better: a factor of 150, so that the choice does not flicker."""
LIKELIHOOD_MEMORY = 15.0
"""Seconds in the running sum of ln L: a subject who starts to push is noticed within seconds."""
SCATTERING = 5.0
"""[s] of memory before the scores' scatter is watched: with less, the fit follows each second of its data."""
SCATTER_MEMORY = 60.0
"""Seconds (batches) in the running mean of the scores' scatter; its own error is then 20 %."""

COUNTERS = np.dtype(
    [(name, np.int64) for name in ("index", "phase", "filled", "blocks", "newest", "length", "model", "batches", "last_change")]
    + [(name, np.float64) for name in ("variance", "gain", "vaf_intrinsic", "vaf_total", "dispersion")]
)


class Plan(NamedTuple):
    """Constants at one sampling rate."""

    rate: float
    measured_velocity: bool
    kernels: np.ndarray
    """Smoothing, first and second derivative, shape (3, 2 n + 1)."""
    rest_velocity: float
    decimation: int
    functions: np.ndarray
    """Reflex basis times the decimated interval, shape (lags, m)."""
    basis: np.ndarray
    lags: np.ndarray
    whitening: np.ndarray
    block_samples: int
    memory_blocks: int
    windows: np.ndarray
    """Candidates for a change; none: no detection."""
    threshold: float
    second: int
    """Blocks in a second."""
    settling_samples: float
    pause_samples: int
    memory: float
    estimate_every: int


class State(NamedTuple):
    """Everything that is remembered between samples."""

    clock: np.ndarray
    counters: np.ndarray
    raw: np.ndarray
    """Position, velocity, torque, shape (3, 2 (3 n + 1)): written twice, so that the newest ones are always in one piece."""
    rectified: np.ndarray
    """Shape (2 (2 n + 1),), likewise."""
    slow_rectified: np.ndarray
    signals: np.ndarray
    """x, v, a, φ, τ, shape (m + 4,)."""
    whitened: np.ndarray
    filters: np.ndarray
    """Shape (models, 2, 2, m + 4)."""
    sums: np.ndarray
    """Of the present block, shape (models, packed)."""
    ring: np.ndarray
    """Shape (models, capacity, packed)."""
    totals: np.ndarray
    """Over the memory, shape (models, packed)."""
    eta: np.ndarray
    """η₀; its prior's mean and standard deviation; shape (3, 3)."""
    tangent: np.ndarray
    """c(η₀) and G₀ times its derivatives, shape (m, 4)."""
    prior: np.ndarray
    """Mean and standard deviation of K, B, I, G before the memory, shape (2, 4)."""
    solution: np.ndarray
    covariance: np.ndarray
    response: np.ndarray
    """Reflex torque per basis function, shape (m,)."""
    likelihood: np.ndarray
    """Running ln L of the noise models, shape (models,)."""
    scatter: np.ndarray
    """Observed over expected variance of the scores, shape (7,)."""
    estimate: np.ndarray
    valid_response: np.ndarray
    matrices: np.ndarray
    vectors: np.ndarray
    projection: np.ndarray
    packed: np.ndarray
    shape_work: np.ndarray


@njit
def _forget(s: State) -> None:
    c = s.counters[0]
    s.sums[:] = 0.0
    s.totals[:] = 0.0
    c.filled = c.length = c.blocks = c.batches = 0
    c.model = FIRST_MODEL
    c.variance = np.nan
    c.dispersion = 1.0
    c.gain = 10.0 * LEAST_GAIN
    s.scatter[:] = 1.0
    s.likelihood[:] = 0.0
    s.prior[0] = 0.0
    s.prior[1] = UNKNOWN
    s.eta[0] = reflex_shapes.PRIOR_MEAN
    s.eta[1] = reflex_shapes.PRIOR_MEAN
    s.eta[2] = reflex_shapes.PRIOR_DEVIATION
    s.solution[:] = 0.0
    s.response[:] = 0.0
    s.tangent[:] = 0.0
    k = s.clock[0]
    k.settled = 0
    k.intrinsic_fit = k.reflex_fit = validity.STILL


@njit
def _restart_path(p: Plan, s: State, x: float, v: float, torque: float) -> None:
    """Fill all histories with the first good sample."""
    s.raw[0], s.raw[1], s.raw[2] = x, v if p.measured_velocity else 0.0, torque
    s.rectified[:] = 0.0
    s.slow_rectified[:] = 0.0
    s.signals[:] = 0.0
    s.signals[0], s.signals[-1] = x, torque
    for model in range(s.filters.shape[0]):
        s.whitened[:] = s.signals
        settle_filter(p.whitening[model], s.filters[model], s.whitened)
    c = s.counters[0]
    c.index = c.phase = 0
    k = s.clock[0]
    k.pause = p.pause_samples
    k.interruption = k.pending
    k.pending = validity.VALID


@njit
def _remember(history: np.ndarray, index: int, value: float) -> None:
    size = history.shape[0] // 2
    history[index % size] = value
    history[index % size + size] = value


@njit
def _weighted(history: np.ndarray, index: int, delay: int, weights: np.ndarray) -> float:
    """Σ weights times the stretch of history that ends `delay` samples before the newest one."""
    size = history.shape[0] // 2
    start = index % size + size - delay - weights.shape[0] + 1
    total = 0.0
    for k in range(weights.shape[0]):
        total += weights[k] * history[start + k]
    return total


@njit
def _rectified_velocity(p: Plan, s: State, index: int) -> tuple[float, float]:
    """Smoothed velocity, and v₊, both n samples before the newest one.

    Whether the ankle is stretched is read from the smoothed velocity, how fast from the measured one: rectified noise
    would add a tenth of its size at rest and nothing in motion, a smoothed velocity would lose the area where a
    pulse turns. Both bias G by half a per cent.
    """
    n = p.kernels.shape[1] // 2
    if p.measured_velocity:
        smooth = _weighted(s.raw[1], index, 0, p.kernels[0])
    else:
        smooth = _weighted(s.raw[0], index, 0, p.kernels[1])
    if smooth <= p.rest_velocity:
        return smooth, 0.0
    size = s.raw.shape[1] // 2
    at = index % size + size - n
    if p.measured_velocity:
        return smooth, s.raw[1, at]
    x = s.raw[0]
    # Central difference of fourth order (Fornberg, Math. Comp. 51 (1988) 699-706, table 1).
    return smooth, (8.0 * (x[at + 1] - x[at - 1]) - x[at + 2] + x[at - 2]) * p.rate / 12.0


@njit
def _decimated_signals(p: Plan, s: State, index: int) -> None:
    """x, v, a, φ and τ, 2 n samples before the newest one."""
    n = p.kernels.shape[1] // 2
    u = s.signals
    u[0] = _weighted(s.raw[0], index, n, p.kernels[0])
    if p.measured_velocity:
        u[1] = _weighted(s.raw[1], index, n, p.kernels[0])
        u[2] = _weighted(s.raw[1], index, n, p.kernels[1])
    else:
        u[1] = _weighted(s.raw[0], index, n, p.kernels[1])
        u[2] = _weighted(s.raw[0], index, n, p.kernels[2])
    u[-1] = _weighted(s.raw[2], index, n, p.kernels[0])
    slow = index // p.decimation
    _remember(s.slow_rectified, slow, _weighted(s.rectified, index, 0, p.kernels[0]))
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


@njit
def _accumulate(sums: np.ndarray, u: np.ndarray) -> None:
    k = 0
    for i in range(u.shape[0]):
        a = u[i]
        for j in range(i, u.shape[0]):
            sums[k] += a * u[j]
            k += 1


@njit
def _sum_memory(s: State, model: int) -> None:
    """The total of one model anew from its blocks."""
    c = s.counters[0]
    total, ring = s.totals[model], s.ring[model]
    total[:] = 0.0
    for back in range(c.length):
        block = ring[(c.newest - back) % ring.shape[0]]
        for k in range(total.shape[0]):
            total[k] += block[k]


@njit
def _store_block(p: Plan, s: State) -> None:
    c = s.counters[0]
    capacity = s.ring.shape[1]
    c.newest = (c.newest + 1) % capacity
    full = c.length == p.memory_blocks
    for model in range(s.ring.shape[0]):
        if full:
            oldest = s.ring[model, (c.newest - p.memory_blocks) % capacity]
            for k in range(oldest.shape[0]):
                s.totals[model, k] -= oldest[k]
        for k in range(s.sums.shape[1]):
            s.totals[model, k] += s.sums[model, k]
            s.ring[model, c.newest, k] = s.sums[model, k]
    if not full:
        c.length += 1
    s.sums[:] = 0.0
    c.filled = 0
    c.blocks += 1
    # Adding and subtracting gathers rounding errors; one model after the other is summed anew.
    again = c.blocks % (8 * s.ring.shape[0])
    if again < s.ring.shape[0]:
        _sum_memory(s, again)


@njit
def _linearise(p: Plan, s: State) -> None:
    """Move η₀ and G₀ to the newest estimate."""
    c = s.counters[0]
    if np.isfinite(c.variance):
        gain = s.solution[3]
        for k in range(SHAPES):
            step = min(max(s.solution[GAINS + k], -LARGEST_STEP[k]), LARGEST_STEP[k])
            s.eta[0, k] = min(max(s.eta[0, k] + step, reflex_shapes.LOWEST[k]), reflex_shapes.HIGHEST[k])
        c.gain = gain if abs(gain) > LEAST_GAIN else LEAST_GAIN
    reflex_shapes.shape_coordinates(s.eta[0], p.basis, p.lags, s.shape_work, s.tangent)
    s.tangent[:, 1:] *= c.gain


@njit
def _prior(p: Plan, s: State, precision: np.ndarray, mean: np.ndarray) -> None:
    """Prior of the seven unknowns; the precision still without the noise variance."""
    for i in range(GAINS):
        precision[i] = 1.0 / s.prior[1, i] ** 2
        mean[i] = s.prior[0, i]
    for k in range(SHAPES):
        precision[GAINS + k] = 1.0 / s.eta[2, k] ** 2
        mean[GAINS + k] = s.eta[1, k] - s.eta[0, k]


@njit
def _fit(p: Plan, s: State, model: int, solution: np.ndarray, covariance: np.ndarray) -> float:
    """Solve the seven unknowns under a noise model over the memory; the noise variance, NaN where the data do not determine them."""
    c = s.counters[0]
    normal, work = s.matrices[0], s.matrices[1:3]
    precision, mean = s.vectors[0], s.vectors[1]
    unpack_sums(s.totals[model], s.tangent, normal, s.projection)
    count = c.length * p.block_samples
    variance = c.variance if np.isfinite(c.variance) else normal[UNKNOWNS, UNKNOWNS] / count
    _prior(p, s, precision, mean)
    precision[:UNKNOWNS] *= variance
    if not solve_with_prior(normal, UNKNOWNS, precision, mean, solution, covariance, work):
        return np.nan
    return squared_residual(normal, UNKNOWNS, solution) / max(count - UNKNOWNS, 1)


@njit
def _detect_change(p: Plan, s: State) -> None:
    c = s.counters[0]
    unpack_sums(s.totals[c.model], s.tangent, s.matrices[6], s.projection)
    window, d = find_change(
        s.ring[c.model],
        c.newest,
        c.length,
        p.windows,
        s.matrices[6],
        s.tangent,
        1.0 / JUMP**2,
        p.block_samples,
        s.matrices,
        s.packed,
        s.projection,
        s.vectors,
    )
    if d < p.threshold * c.dispersion:
        return
    for i in range(GAINS):
        s.prior[0, i] = s.solution[i]
        s.prior[1, i] = JUMP[i]
    for k in range(SHAPES):
        s.eta[1, k] = s.eta[0, k] + s.solution[GAINS + k]
        known = 2.0 * c.variance * s.covariance[GAINS + k, GAINS + k] + SHAPE_DRIFT[k] ** 2
        s.eta[2, k] = min(np.sqrt(known), reflex_shapes.PRIOR_DEVIATION[k])
    c.length = window
    c.last_change = c.blocks
    for model in range(s.ring.shape[0]):
        _sum_memory(s, model)


@njit
def _sum_second(p: Plan, s: State, model: int, normal: np.ndarray) -> None:
    """Sums of products of the last second under a noise model."""
    c = s.counters[0]
    ring = s.ring[model]
    s.packed[:] = 0.0
    for back in range(p.second):
        block = ring[(c.newest - back) % ring.shape[0]]
        for k in range(block.shape[0]):
            s.packed[k] += block[k]
    unpack_sums(s.packed, s.tangent, normal, s.projection)


@njit
def _choose_noise_model(p: Plan, s: State) -> None:
    """Second by second and in logarithms, so that a change of the ankle, which spoils the errors of all models alike, decides nothing."""
    c = s.counters[0]
    count = p.second * p.block_samples
    for model in range(s.ring.shape[0]):
        _sum_second(p, s, model, s.matrices[0])
        squares = squared_residual(s.matrices[0], UNKNOWNS, s.solution)
        s.likelihood[model] *= 1.0 - 1.0 / LIKELIHOOD_MEMORY
        if squares > 0.0:
            s.likelihood[model] -= 0.5 * count * np.log(squares / count)
    c.model = most_likely(s.likelihood, c.model, LIKELIER * c.dispersion)


@njit
def _watch_scatter(p: Plan, s: State) -> None:
    """Scores of the last second against what white noise would give (`standard errors` of the estimate)."""
    c = s.counters[0]
    normal, product, score = s.matrices[0], s.matrices[1], s.vectors[0]
    _sum_second(p, s, c.model, normal)
    for i in range(UNKNOWNS):
        total = normal[i, UNKNOWNS]
        for j in range(UNKNOWNS):
            total -= normal[i, j] * s.solution[j]
        score[i] = total
    # The influence of this second on the estimate is C score, of covariance C N C less what the fit has already taken, C N C N C.
    for i in range(UNKNOWNS):
        for j in range(UNKNOWNS):
            total = 0.0
            for k in range(UNKNOWNS):
                total += s.covariance[i, k] * normal[k, j]
            product[i, j] = total
    weight = 1.0 / min(c.batches + 1.0, SCATTER_MEMORY)
    mean = 0.0
    for i in range(UNKNOWNS):
        influence = expected = 0.0
        for j in range(UNKNOWNS):
            influence += s.covariance[i, j] * score[j]
            expected += product[i, j] * s.covariance[i, j]
            for k in range(UNKNOWNS):
                expected -= product[i, j] * product[j, k] * s.covariance[k, i]
        ratio = influence * influence / (c.variance * expected) if expected > 0.0 else 1.0
        s.scatter[i] += weight * (ratio - s.scatter[i])
        if i < GAINS:
            mean += s.scatter[i] / GAINS
    c.batches += 1
    c.dispersion = max(mean, 1.0)


@njit
def _explained(p: Plan, s: State) -> None:
    """Variance of the torque (above the lowest corner) that both pathways and the intrinsic one account for."""
    c = s.counters[0]
    normal, part = s.matrices[0], s.vectors[0]
    unpack_sums(s.totals[0], s.tangent, normal, s.projection)
    total = normal[UNKNOWNS, UNKNOWNS]
    if not total > 0.0:
        c.vaf_total = c.vaf_intrinsic = np.nan
        return
    c.vaf_total = 100.0 * (1.0 - squared_residual(normal, UNKNOWNS, s.solution) / total)
    c.vaf_intrinsic = 100.0 * (1.0 - squared_residual(normal, INTRINSIC, s.solution) / total)


@njit
def _finish_block(p: Plan, s: State) -> None:
    """Steps 5 to 7."""
    c, k = s.counters[0], s.clock[0]
    _store_block(p, s)
    if c.blocks % (p.second // 2) == 1:
        _linearise(p, s)
    if p.windows.shape[0] > 0 and np.isfinite(c.variance):
        _detect_change(p, s)
    if c.blocks % p.second == 0:
        for i in range(SHAPES):
            default = reflex_shapes.PRIOR_DEVIATION[i]
            s.eta[2, i] = min(np.sqrt(s.eta[2, i] ** 2 + SHAPE_FORGETTING * default**2), default)
    variance = _fit(p, s, c.model, s.vectors[3], s.covariance)
    if not np.isfinite(variance):
        k.intrinsic_fit = validity.COLLINEAR
        return
    k.intrinsic_fit = validity.VALID
    s.solution[:UNKNOWNS] = s.vectors[3, :UNKNOWNS]
    c.variance = variance
    for j in range(s.response.shape[0]):
        s.response[j] = 0.0
        for i in range(1 + SHAPES):
            s.response[j] += s.solution[INTRINSIC + i] * s.tangent[j, i]
    if c.blocks % p.second == 0:
        _choose_noise_model(p, s)
        if c.length >= SCATTERING * p.second:
            _watch_scatter(p, s)
    _explained(p, s)
    k.reflex_fit = validity.VALID if np.isfinite(c.vaf_total) else validity.NO_TORQUE


@njit
def _decimated_sample(p: Plan, s: State, learning: bool, torques: np.ndarray, t: float) -> None:
    """Steps 3 and 4."""
    c = s.counters[0]
    u, w = s.signals, s.whitened
    for model in range(s.filters.shape[0]):
        w[:] = u
        filter_step(p.whitening[model], s.filters[model], w, w.shape[0])
        if model == 0:
            torques[0], torques[1] = t, w[-1]
            torques[2] = s.solution[0] * w[0] + s.solution[1] * w[1] + s.solution[2] * w[2]
            torques[3] = 0.0
            for j in range(s.response.shape[0]):
                torques[3] += s.response[j] * w[INTRINSIC + j]
        if learning:
            _accumulate(s.sums[model], w)
    if learning:
        c.filled += 1
        if c.filled == p.block_samples:
            _finish_block(p, s)


@njit
def _write_row(p: Plan, s: State, row: np.ndarray) -> None:
    k, c, e = s.clock[0], s.counters[0], s.estimate
    valid = validity.reason_code(s.clock, p.settling_samples) == validity.VALID
    if valid:
        for i in range(GAINS):
            e[1 + i] = s.solution[i]
            e[8 + i] = np.sqrt(c.variance * max(s.scatter[i], 1.0) * s.covariance[i, i])
        e[5], e[6] = c.vaf_intrinsic, c.vaf_total
        s.valid_response[:] = s.response
    e[0] = k.row_time
    e[7] = 1.0 if valid else 0.0
    row[:] = e


def _compile(source: int) -> Any:
    # numba's cache on disk looks at one file only; `source` in the closure makes a change in any of them a new entry.
    @njit(cache=True)
    def advance(p: Plan, s: State, samples: np.ndarray, n: int, rows: np.ndarray, torques: np.ndarray) -> tuple[int, int, int]:
        _ = source
        k, c = s.clock[0], s.counters[0]
        last = 3 if p.measured_velocity else 2
        lag = 2 * (p.kernels.shape[1] // 2) / p.rate
        count = decimated = 0
        for i in range(n):
            t, x, torque = samples[i, 0], samples[i, 1], samples[i, last]
            v = samples[i, 2] if p.measured_velocity else 0.0
            validity.watch_rate(s.clock, p.rate, t)
            k.row_time = t if np.isfinite(t) else k.row_time + 1.0 / p.rate
            what = validity.judge_sample(s.clock, p.rate, p.memory, t, x, v, torque)
            if what == validity.RESTART_ALL:
                if k.pending == validity.VALID:
                    k.pending = validity.SETTLING
                _forget(s)
                k.quiet = k.still = 0
            if what == validity.RESTART_ALL or what == validity.RESTART_PATH:
                _restart_path(p, s, x, v, torque)
            if what != validity.DROP:
                c.index += 1
                _remember(s.raw[0], c.index, x)
                _remember(s.raw[1], c.index, v)
                _remember(s.raw[2], c.index, torque)
                smooth, rectified = _rectified_velocity(p, s, c.index)
                _remember(s.rectified, c.index, rectified)
                if k.pause > 0:
                    k.pause -= 1
                elif validity.judge_motion(s.clock, p.rate, p.memory, smooth):
                    _forget(s)
                learning = k.pause == 0 and k.still == 0
                if learning:
                    k.settled += 1
                if c.index % p.decimation == 0:
                    _decimated_signals(p, s, c.index)
                    _decimated_sample(p, s, learning, torques[decimated], t - lag)
                    decimated += 1
            k.row_count += 1
            if k.row_count == p.estimate_every:
                k.row_count = 0
                _write_row(p, s, rows[count])
                count += 1
            if k.rate_lost:
                return i + 1, count, decimated
        return n, count, decimated

    return advance


advance = _compile(_fingerprint())
"""advance(plan, state, samples, n, rows, torques) -> samples used, rows written, torque rows written."""
