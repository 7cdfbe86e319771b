"""The simultaneous estimator, one sample after the other.

1. smooth and differentiate; rectify                    `gaussian_derivatives`, `signals`
2. decimate to about 256 Hz; reflex basis * v₊          `reflex_shapes`, `signals`
3. whiten under every noise model                       `voluntary_torque_noise`
4. sums of products, block by block, in a ring          `memory`
5. has the ankle changed? forget what was before        `change_detection`
6. K, B, I, G and the reflex's shape                    `regression`, `block_update`
7. every second: noise model, scatter of the scores     `block_update`
8. twice a second: how long a memory?                   `memory_length`
9. twice a second: what the reference explains, which
   further terms the memory shows, doubt                `memory_review`

The state is a tuple of arrays that `advance` changes in place.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from impedance_estimator import validity
from impedance_estimator.compilation import part, sample_part, source_fingerprint
from impedance_estimator.digital_filters import filter_step, settle_filter
from impedance_estimator.simultaneous.block_update import (
    MIN_SCATTER_LENGTH,
    detect_change,
    explained,
    forget,
    forget_shape,
    linearise,
    outputs,
    response,
    solve_memory,
)
from impedance_estimator.simultaneous.change_detection import SHORT_WINDOW_PERIOD
from impedance_estimator.simultaneous.memory import normal_matrix, store_block
from impedance_estimator.simultaneous.memory_length import ask_memory, choose_memory
from impedance_estimator.simultaneous.memory_review import clean_motion
from impedance_estimator.simultaneous.noise_model_choice import (
    choose_noise_model,
    compare_noise_models,
)
from impedance_estimator.simultaneous.nuisance import BEND, TAP_REACH
from impedance_estimator.simultaneous.optional_terms import mean_response
from impedance_estimator.simultaneous.regression import GAINS, INTRINSIC, PARAMETERS
from impedance_estimator.simultaneous.signals import (
    decimated_signals,
    drive_actuator,
    rectified_reference,
    rectified_velocity,
    remember,
    restart_path,
)
from impedance_estimator.simultaneous.state import Plan, State
from impedance_estimator.simultaneous.voluntary_torque_noise import LOW_CORNER

ESTIMATES = 13


@sample_part
def _decimated_sample(p: Plan, s: State, learning: bool, torques: np.ndarray, t: float) -> None:
    """Carry out steps 3 and 4."""
    c = s.counters[0]
    u, w = s.signals, s.whitened
    size = u.shape[0] // 2
    channels = u.shape[0] if c.referenced else size + 1
    if learning and not c.filters_settled:
        # The histories are full. Torque and motion now start their filters at the same moment: a
        # torque of a movement that the first good sample cut would ring on for seconds alone.
        for model in range(s.filters.shape[0]):
            for j in range(w.shape[0]):
                w[j] = u[j]
            settle_filter(p.whitening[model], s.filters[model], w)
        c.filters_settled = 1
    for model in range(s.filters.shape[0]):
        for j in range(channels):
            w[j] = u[j]
        filter_step(p.whitening[model, : p.sections[model]], s.filters[model], w, channels)
        if model == 0:
            intrinsic, reflex = 0.0, 0.0
            for j in range(INTRINSIC):
                intrinsic += s.solution[j] * w[j]
            base = INTRINSIC + s.response.shape[0]
            added = s.nuisance.coefficients
            for j in range(base, base + BEND):
                intrinsic += added[j] * w[j]
            for j in range(INTRINSIC, base):
                reflex += (s.response[j - INTRINSIC] + added[j]) * w[j]
            reflex += added[base + BEND] * w[base + BEND]
            torques[0] = t
            torques[1], torques[2], torques[3] = (
                p.passband * w[size],
                p.passband * intrinsic,
                p.passband * reflex,
            )
        if learning:
            _keep(s.block[model, c.filled], w, c.referenced == 1)
    if learning:
        if c.filled == 0 or c.referenced:
            c.instrumented = c.referenced
        c.filled += 1
        # v₊ of the decimated sample that the signals belong to.
        newest = c.index // p.decimation - TAP_REACH
        stretch = s.slow_rectified[0, newest % (s.slow_rectified.shape[1] // 2)]
        s.stretch[0] += stretch
        s.stretch[1] += stretch * stretch


@sample_part
def _keep(row: np.ndarray, w: np.ndarray, referenced: bool) -> None:
    """Keep whitened signals in the order of `nuisance.accumulate`: without a reference the motion
    is its own instrument.
    """
    size = w.shape[0] // 2
    row[size] = w[size]
    for j in range(size):
        row[j] = w[size + 1 + j] if referenced else w[j]
        row[size + 1 + j] = w[j] if referenced else 0.0


@sample_part
def _take_sample(
    p: Plan, s: State, samples: np.ndarray, i: int, torques: np.ndarray, decimated: int
) -> bool:
    """Carry out steps 1 to 4 with one sample; return whether it made a decimated one."""
    k, c = s.clock[0], s.counters[0]
    last = 3 if p.measured_velocity else 2
    lag = (2 * (p.kernels.shape[1] // 2) + TAP_REACH * p.decimation) / p.rate
    t, x, torque = samples[i, 0], samples[i, 1], samples[i, last]
    reference = samples[i, last + 1]
    v = samples[i, 2] if p.measured_velocity else 0.0
    given = p.modelled_reflex or p.given_stretch
    reflex = samples[i, last + 2] if given else 0.0
    commanded_reflex = samples[i, last + 3] if given else 0.0
    validity.watch_rate(s.clock, p.rate, t)
    k.row_time = t if np.isfinite(t) else k.row_time + 1.0 / p.rate
    what = validity.judge_sample(s.clock, p.rate, p.memory, t, x, v, torque)
    if what == validity.RESTART_ALL:
        if k.pending == validity.VALID:
            k.pending = validity.SETTLING
        forget(s)
        k.quiet = k.still = 0
    if what == validity.CONTINUE and c.referenced != np.isfinite(reference):
        k.pending = validity.REFERENCE
        what = validity.RESTART_PATH
    if what == validity.RESTART_ALL or what == validity.RESTART_PATH:
        restart_path(p, s, x, v, torque, reference, reflex, commanded_reflex)
    if what != validity.DROP:
        c.index += 1
        at = c.index % (s.raw.shape[1] // 2)
        rectified_at = c.index % (s.rectified.shape[1] // 2)
        remember(s.raw, 0, at, x)
        remember(s.raw, 1, at, v)
        remember(s.raw, 2, at, torque)
        if given:
            remember(s.raw, 4, at, reflex)
            remember(s.raw, 5, at, commanded_reflex)
        smooth, rectified = rectified_velocity(p, s, at)
        remember(s.rectified, 0, rectified_at, rectified)
        if c.referenced:
            remember(s.raw, 3, at, drive_actuator(p, s, reference))
            remember(s.rectified, 1, rectified_at, rectified_reference(p, s, at))
        if k.pause > 0:
            k.pause -= 1
        elif validity.judge_motion(s.clock, p.rate, p.memory, smooth):
            forget(s)
        learning = k.pause == 0 and k.still == 0
        if learning:
            k.settled += 1
        if c.index % p.decimation == 0:
            decimated_signals(p, s, at, rectified_at)
            _decimated_sample(p, s, learning, torques[decimated], t - lag)
            return True
    return False


@part
def _write_row(p: Plan, s: State, row: np.ndarray) -> None:
    k, c, e = s.clock[0], s.counters[0], s.estimate
    valid = validity.reason_code(s.clock, p.settling_samples) == validity.VALID
    if valid:
        for i in range(GAINS):
            e[1 + i] = s.output[0, i]
            random = c.variance * max(s.scatter[c.model, i], 1.0) * s.output[1, i]
            e[9 + i] = np.sqrt(random + (s.model_error[i] * s.output[0, i]) ** 2)
        e[5], e[6] = c.vaf_intrinsic, c.vaf_total
        for j in range(s.response.shape[0]):
            s.valid_response[j] = mean_response(s, j)
    e[0] = k.row_time
    e[7] = 1.0 if valid else 0.0
    e[8] = c.doubt
    row[:] = e


@part
def _finish_block(p: Plan, s: State) -> None:
    """Carry out steps 5 to 9."""
    c, k = s.counters[0], s.clock[0]
    if c.blocks % (p.second // 2) == 0:
        clean_motion(p, s)
    store_block(p, s)
    if c.blocks % (p.second // 2) == 1:
        linearise(p, s)
    if p.windows.shape[0] > 0 and np.isfinite(c.variance) and c.blocks % SHORT_WINDOW_PERIOD == 0:
        detect_change(p, s)
    if c.blocks % p.second == 0:
        forget_shape(s)
    model, memory, length = c.model, c.memory, c.length
    normal = normal_matrix(s, model, length, 0)
    solution = np.empty(PARAMETERS)
    variance = solve_memory(p, s, normal, c.length, solution, s.covariance)
    if not np.isfinite(variance):
        k.intrinsic_fit = validity.COLLINEAR
        return
    k.intrinsic_fit = validity.VALID
    s.solution[:] = solution
    c.variance = variance
    response(s, s.solution, s.response)
    if c.blocks % p.second == 0:
        if c.length >= MIN_SCATTER_LENGTH * p.second:
            compare_noise_models(p, s)
        choose_noise_model(p, s)
    if p.lengths.shape[0] > 1:
        after = c.blocks % p.horizon
        if after == 0:
            choose_memory(p, s)
        if after < s.predictors.shape[0]:
            ask_memory(p, s, after, after)
    outputs(p, s)
    if model != LOW_CORNER or memory != c.memory or length != c.length:
        normal = normal_matrix(s, LOW_CORNER, c.length, 0)
    explained(p, s, normal)
    k.reflex_fit = validity.VALID if np.isfinite(c.vaf_total) else validity.NO_TORQUE


def _compile(source: int) -> Any:
    # `source` in the closures: see `compilation.source_fingerprint`.
    @njit(cache=True, error_model="numpy")
    def advance(
        p: Plan,
        s: State,
        samples: np.ndarray,
        n: int,
        rows: np.ndarray,
        torques: np.ndarray,
    ) -> tuple[int, int, int]:
        _ = source
        k, c = s.clock[0], s.counters[0]
        count = decimated = 0
        for i in range(n):
            if _take_sample(p, s, samples, i, torques, decimated):
                decimated += 1
                if c.filled == p.block_samples:
                    _finish_block(p, s)
            k.row_count += 1
            if k.row_count == p.estimate_every:
                k.row_count = 0
                _write_row(p, s, rows[count])
                count += 1
            if k.rate_lost:
                return i + 1, count, decimated
        return n, count, decimated

    return advance


advance = _compile(source_fingerprint())
"""advance(plan, state, samples, n, rows, torques) -> index of the next sample, rows written,
torque rows written. It stops before `n` where the sampling rate changes."""
