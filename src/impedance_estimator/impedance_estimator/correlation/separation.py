"""The separation of intrinsic and reflex torque, one sample after the other (van 't Veld et al.
2018, section II).

1. low-pass all inputs (C, CE)                          `digital_filters`
2. velocity and acceleration by backward differences    `differences`
3. v₊ = max(v, 0), then high-pass (rectify first)        `digital_filters`
4. K, B, I from running averages of products             `running_products`, `intrinsic_regression`
5. τ_I = K x + B v + I a,  τ_R = τ - τ_I
6. decimate τ_R and v₊, running correlations, h, G       `reflex_response`
7. variance accounted for, standard errors               here, `standard_errors`

`advance` does all of it for a block of samples. The state is a tuple of arrays that it changes in
place. What runs for every sample is compiled into it (``inline="always"``), which saves a sixth of
the time.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numba import njit

from impedance_estimator import standard_errors, validity
from impedance_estimator.compilation import source_fingerprint
from impedance_estimator.correlation import reflex_response as reflex
from impedance_estimator.correlation.differences import difference_step
from impedance_estimator.correlation.intrinsic_regression import (
    NO_VARIANCE,
    SOLVED,
    solve_intrinsic,
)
from impedance_estimator.correlation.running_products import add_products, average_products
from impedance_estimator.correlation.state import (
    ACCELERATION,
    INPUTS,
    POSITION,
    RECTIFIED,
    SUM_INTRINSIC,
    SUM_RECTIFIED,
    SUM_TORQUE,
    TORQUE,
    VAF_MOMENTS,
    VELOCITY,
    Plan,
    State,
)
from impedance_estimator.digital_filters import filter_step, settle_filter

ESTIMATES = 13
REFLEX_EVERY = 4
"""Decimated samples from one solution of the reflex response to the next: about 32 a second;
feedback needs 20-30 (paper, III-B).
"""


@njit
def _forget_averages(s: State) -> None:
    for array in (s.product_filter, s.correlation_filter, s.vaf_filter, s.batch_filter):
        array[:] = 0.0
    for values in (
        s.products,
        s.correlations,
        s.vaf_moments,
        s.score_moments,
        s.parameters,
        s.response,
        s.row_sums,
    ):
        values[:] = 0.0
    s.inverse[:] = 0.0
    s.product_sums[:] = 0.0
    c = s.clock[0]
    c.settled = c.chunks = 0
    c.intrinsic_fit = c.reflex_fit = validity.STILL


@njit
def _restart_path(p: Plan, s: State, x: float, v: float, torque: float) -> None:
    """Start low-pass, differences, decimation and batches from the steady state of the first good
    sample.
    """
    s.inputs[0], s.inputs[1], s.inputs[2] = x, torque, v
    settle_filter(p.lowpass, s.lowpass, s.inputs)
    s.position_history[:] = s.inputs[0]
    s.velocity_history[:] = s.inputs[2]
    s.sums[:] = 0.0
    s.product_sums[:] = 0.0
    s.rectified[:] = 0.0
    s.scores[:] = 0.0
    c = s.clock[0]
    c.chunk = c.batch = 0
    c.pause = p.pause_samples
    c.interruption = c.pending
    c.pending = validity.VALID


@njit
def _restart_all(p: Plan, s: State, x: float, v: float, torque: float) -> None:
    c = s.clock[0]
    if c.pending == validity.VALID:
        c.pending = validity.SETTLING
    _restart_path(p, s, x, v, torque)
    _forget_averages(s)
    s.filtered[:] = 0.0
    s.filtered[TORQUE], s.filtered[POSITION] = torque, x
    settle_filter(p.highpass, s.highpass, s.filtered)
    s.operating_point[0], s.operating_point[1] = x, 0.0
    c.quiet = c.still = 0


@njit
def _operating_point(mean: np.ndarray, longest: float, position: float) -> float:
    """Return the position from its running mean, over all samples so far and later over `longest`
    samples.
    """
    mean[1] = min(mean[1] + 1.0, longest)
    mean[0] += (position - mean[0]) / mean[1]
    return position - mean[0]


@njit
def _predicting(p: Plan, settled: int) -> bool:
    """Say whether estimates are good enough to be judged by their residual: after half of the
    settling time.
    """
    return settled > p.settling_samples // 2


@njit
def _solve_reflex(p: Plan, s: State) -> None:
    count = s.response.shape[0]
    for k in range(count):
        s.column[k] = s.correlations[k]
    s.column[0] *= 1.0 + p.ridge
    good = reflex.solve_toeplitz(
        s.column, s.correlations[count : 2 * count], s.response, s.row_sums, s.levinson
    )
    s.clock[0].reflex_fit = validity.VALID if good else validity.NO_REFLEX


@njit
def _decimated_sample(p: Plan, s: State, learning: bool, torques: np.ndarray, t: float) -> None:
    """Step 6 and the variances of step 7, for the mean of `decimation` samples."""
    c = s.clock[0]
    torque, intrinsic = s.sums[SUM_TORQUE] / p.decimation, s.sums[SUM_INTRINSIC] / p.decimation
    reflex.remember(s.rectified, s.sums[SUM_RECTIFIED] / p.decimation)
    s.sums[:] = 0.0
    residual = torque - intrinsic
    predicted = reflex.convolve_now(s.response, s.rectified, p.first_lag)
    # A mean stands for the middle of its samples.
    torques[0] = t - 0.5 * (p.decimation - 1) / p.rate
    torques[1], torques[2], torques[3] = torque, intrinsic, predicted
    if not learning:
        return
    reflex.average_correlations(
        p.reflex_average, s.correlation_filter, s.correlations, s.rectified, p.first_lag, residual
    )
    s.scores[3] += reflex.convolve_now(s.row_sums, s.rectified, p.first_lag) * (
        residual - predicted
    )
    s.scores[5] += 1.0
    if _predicting(p, c.settled):
        m = s.vaf_moments
        m[0], m[1], m[2] = torque, residual, residual - predicted
        for k in range(3):
            m[3 + k] = m[k] * m[k]
        m[6] = 1.0
        filter_step(p.vaf_average, s.vaf_filter, m, VAF_MOMENTS)
    average_products(p.average, s.product_filter, s.products, s.product_sums)
    fit = solve_intrinsic(s.products, s.parameters, s.inverse)
    c.intrinsic_fit = (
        validity.VALID
        if fit == SOLVED
        else validity.STILL
        if fit == NO_VARIANCE
        else validity.COLLINEAR
    )
    c.chunks += 1
    if c.chunks % REFLEX_EVERY == 0:
        _solve_reflex(p, s)


@njit
def _close_batch(p: Plan, s: State) -> None:
    """Take the averages of the scores over one batch into the standard errors."""
    c = s.clock[0]
    c.batch = 0
    if _predicting(p, c.settled):
        for k in range(3):
            s.batch[k] = s.scores[k] / s.scores[4]
        s.batch[3] = s.scores[3] / max(s.scores[5], 1.0)
        standard_errors.average_batch(p.batch_average, s.batch_filter, s.score_moments, s.batch)
    s.scores[:] = 0.0


@njit
def _variance_accounted_for(moments: np.ndarray, which: int) -> float:
    """Return 100 (1 - var(residual) / var(torque)) [%] from running moments; NaN where the torque
    does not vary.
    """
    gain = moments[6]
    if not gain > 0.0:
        return np.nan
    total = moments[3] / gain - (moments[0] / gain) ** 2
    left = moments[3 + which] / gain - (moments[which] / gain) ** 2
    return 100.0 * (1.0 - left / total) if total > 0.0 else np.nan


@njit
def _write_row(p: Plan, s: State, row: np.ndarray) -> None:
    c = s.clock[0]
    valid = validity.reason_code(s.clock, p.settling_samples) == validity.VALID
    vaf = _variance_accounted_for(s.vaf_moments, 1)
    if valid and not np.isfinite(vaf):
        valid = False
        c.reflex_fit = validity.NO_TORQUE
    e = s.estimate
    if valid:
        for k in range(3):
            e[1 + k] = s.parameters[k]
        e[4] = np.sum(s.response)
        e[5], e[6] = vaf, _variance_accounted_for(s.vaf_moments, 2)
        standard_errors.intrinsic_variance(
            s.score_moments, s.inverse, s.products[-1], p.intrinsic_factor, e[9:12]
        )
        e[12] = standard_errors.reflex_variance(
            s.score_moments, s.correlations[-1], p.reflex_factor
        )
        for k in range(9, 13):
            e[k] = np.sqrt(e[k])
        s.valid_response[:] = s.response
    e[0] = c.row_time
    e[7] = 1.0 if valid else 0.0
    row[:] = e


def _compile(source: int) -> Any:
    # `source` in the closure: see `compilation.source_fingerprint`.
    @njit(cache=True)
    def advance(
        p: Plan, s: State, samples: np.ndarray, n: int, rows: np.ndarray, torques: np.ndarray
    ) -> tuple[int, int, int]:
        _ = source
        # Arrays used for every sample are taken out of the tuples once; that alone halves the time.
        clock, inputs, filtered, signals, parameters, scores, sums = (
            s.clock,
            s.inputs,
            s.filtered,
            s.signals,
            s.parameters,
            s.scores,
            s.sums,
        )
        lowpass, lowpass_state, highpass, highpass_state = (
            p.lowpass,
            s.lowpass,
            p.highpass,
            s.highpass,
        )
        product_sums = s.product_sums
        difference, position_history, velocity_history, mean_position = (
            p.difference,
            s.position_history,
            s.velocity_history,
            s.operating_point,
        )
        highpassed, rate, memory, measured = p.highpassed, p.rate, p.memory, p.measured_velocity
        c = clock[0]
        last = 3 if measured else 2
        count = decimated = 0
        for i in range(n):
            t, x, torque = samples[i, 0], samples[i, 1], samples[i, last]
            v = samples[i, 2] if measured else 0.0
            validity.watch_rate(clock, rate, t)
            c.row_time = t if np.isfinite(t) else c.row_time + 1.0 / rate
            what = validity.judge_sample(clock, rate, memory, t, x, v, torque)
            if what == validity.RESTART_ALL:
                _restart_all(p, s, x, v, torque)
            elif what == validity.RESTART_PATH:
                _restart_path(p, s, x, v, torque)
            if what != validity.DROP:
                # 1. and 2.
                inputs[0], inputs[1], inputs[2] = x, torque, v
                filter_step(lowpass, lowpass_state, inputs, INPUTS)
                position, velocity = inputs[0], inputs[2]
                slope = difference_step(difference, position_history, position)
                if not measured:
                    velocity = slope
                acceleration = difference_step(difference, velocity_history, velocity)
                # 3.
                filtered[TORQUE], filtered[RECTIFIED] = inputs[1], max(velocity, 0.0)
                filtered[POSITION], filtered[VELOCITY], filtered[ACCELERATION] = (
                    position,
                    velocity,
                    acceleration,
                )
                filter_step(highpass, highpass_state, filtered, highpassed)
                if highpassed == 2:
                    filtered[POSITION] = _operating_point(
                        mean_position, p.operating_point_samples, position
                    )
                signals[0], signals[1], signals[2], signals[3] = (
                    filtered[POSITION],
                    filtered[VELOCITY],
                    filtered[ACCELERATION],
                    filtered[TORQUE],
                )
                if c.pause > 0:
                    c.pause -= 1
                elif validity.judge_motion(clock, rate, memory, velocity):
                    _forget_averages(s)
                # 5.
                intrinsic = (
                    parameters[0] * signals[0]
                    + parameters[1] * signals[1]
                    + parameters[2] * signals[2]
                )
                sums[SUM_TORQUE] += signals[3]
                sums[SUM_INTRINSIC] += intrinsic
                sums[SUM_RECTIFIED] += filtered[RECTIFIED]
                learning = c.pause == 0 and c.still == 0
                if learning:
                    # 4.
                    add_products(product_sums, signals)
                    for k in range(3):
                        scores[k] += signals[k] * (signals[3] - intrinsic)
                    scores[4] += 1.0
                    c.settled += 1
                    c.batch += 1
                    if c.batch == p.batch_samples:
                        _close_batch(p, s)
                c.chunk += 1
                if c.chunk == p.decimation:
                    c.chunk = 0
                    # 6. and 7.
                    _decimated_sample(p, s, learning, torques[decimated], t)
                    decimated += 1
            c.row_count += 1
            if c.row_count == p.estimate_every:
                c.row_count = 0
                _write_row(p, s, rows[count])
                count += 1
            if c.rate_lost:
                return i + 1, count, decimated
        return n, count, decimated

    return advance


advance = _compile(source_fingerprint())
"""advance(plan, state, samples, n, rows, torques) -> samples used, rows written, torque rows
written.
"""
