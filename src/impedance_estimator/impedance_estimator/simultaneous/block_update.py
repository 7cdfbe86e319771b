"""A complete block updates the estimate.

The steps are: linearise, look for a change, solve, choose the noise model, watch the scores.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator import validity
from impedance_estimator.compilation import part
from impedance_estimator.simultaneous import reflex_shapes
from impedance_estimator.simultaneous.change_detection import (
    MIN_OLDER_BLOCKS,
    OVERLAP_BLOCKS,
    find_change,
)
from impedance_estimator.simultaneous.memory import sum_recent, use_chosen_memory
from impedance_estimator.simultaneous.nuisance import nuisance_coefficients
from impedance_estimator.simultaneous.regression import (
    GAINS,
    INTRINSIC,
    LEAST_GAIN,
    PARAMETERS,
    log_evidence,
    solve_with_prior,
    squared_residual,
)
from impedance_estimator.simultaneous.state import Plan, State
from impedance_estimator.simultaneous.voluntary_torque_noise import FIRST_MODEL, most_likely

SHAPES = reflex_shapes.SHAPES
CHANGE_DEVIATIONS = np.array([100.0, 0.5, 0.005, 20.0])
"""One standard deviation of K, B, I and G about their old values after a change is a full
contraction [N.m/rad, N.m.s/rad, kg.m², N.m.s/rad]. It matters only until the first perturbation
after the change."""
_CHANGE_PRECISIONS = 1.0 / CHANGE_DEVIATIONS**2
INITIAL_DEVIATIONS = np.array([1e3, 10.0, 0.1, 1e3])
"""One standard deviation of K, B, I and G before any data is far beyond any ankle
[N.m/rad, N.m.s/rad, kg.m², N.m.s/rad].
"""
LARGEST_SHAPE_STEP = np.array([0.2, 0.2, 0.004])
"""ln ω, ln z and the delay [s] move by at most this in one relinearisation: the shape is linear
enough for steps of 20 % and 4 ms.
"""
STEP_SHARE = 0.5
"""Only this share of the step that the data ask for is made: in the human trials, whose noise is
not white, whole steps overshoot and G swings with them.
"""
SHAPE_DRIFT = np.array([0.05, 0.05, 0.001])
"""ln ω, ln z and the delay [s] drift by this standard deviation with a change of K or G: muscles
slow down with fatigue by a few per cent.
"""
DEVIATION_DRIFT = 0.1
"""The rest of the shape changes with K or G by this share of its prior standard deviation."""
DEVIATIONS = np.array([0.01, 0.03, 0.1, 0.3])
"""Candidates for the standard deviation of what the response has beyond a second-order muscle,
relative to a typical response. More than 0.3 explained no real trial better."""
SHAPE_FORGETTING = 1.0 / 60.0
"""What was known about the shape before the memory is forgotten at this rate [1/s], over a hold
period.
"""
MIN_LOG_LIKELIHOOD_GAIN = 5.0
"""Another noise model is chosen when its ln L is larger by this: a factor of 150, so that the
choice does not flicker.
"""
MIN_REPEATED_LOG_LIKELIHOOD_GAIN = 15.0
"""Another width of the deviation's prior, or a shorter memory, is chosen when its ln L is larger by
this. They are compared again and again, and a wrong choice costs more: 5 was passed by chance in 2
of 30 simulated runs of three minutes (G moved by 2 %) and by one odd second of a real trial (G fell
to a quarter)."""
LIKELIHOOD_MEMORY = 15.0
"""The running sum of ln L remembers so many seconds: a subject who starts to push is noticed within
seconds.
"""
LARGEST_VARIANCE_RATIO = 4.0
"""The new estimate gets full weight while the noise variance since a change is at most this many
times that before it. What is left of the change in the whitening filters makes it a hundred times
as large, and K and G of the first half second then anything.
"""
MIN_BLOCKS_AFTER_CHANGE = 10
"""The new estimate gets weight after so many blocks since a change (0.6 s): fewer fit one response
and predict no other.
"""
FULL_WEIGHT_BLOCKS = 32
"""The new estimate gets full weight, whatever its noise, from so many blocks since a change on (2
s, three perturbations): the subject may have become less steady with the change, and the old value
must not stay in the estimate.
"""
RESIDUAL_LAGS = 9
"""The residual's autocorrelation has so many lags of 256 Hz: up to 31 ms, half a period of 16 Hz.
Tremor is slower.
"""
RESIDUAL_RATE = 256.0
"""The residual's lags are samples at this rate [Hz]."""
MIN_SCATTER_LENGTH = 5.0
"""The scatter of the scores is watched once the memory has this length [s]: with less, the fit
follows each second of its data.
"""
BATCH_DURATION = 2
"""A batch of scores lasts so many seconds."""
SCATTER_MEMORY = 60.0
"""The running mean of the scores' scatter remembers so many seconds; its own error is then 20 %."""


@part
def forget(s: State) -> None:
    c = s.counters[0]
    s.sums[:] = 0.0
    s.totals[:] = 0.0
    c.filled = c.length = c.since = c.kept = c.memory = c.changed = c.unsettled = c.left_over = (
        c.blocks
    ) = c.batches = c.finished = 0
    c.model = FIRST_MODEL
    c.variance = np.nan
    c.dispersion = 1.0
    c.gain = 10.0 * LEAST_GAIN
    c.structure = 0
    c.delay = c.structure_gain = c.doubt = c.added_damping = c.added_inertia = 0.0
    s.signs[:] = 0.0
    s.residuals[:] = 0.0
    s.autocovariance[:] = 0.0
    s.nuisance.gamma[:] = 0.0
    s.nuisance.coefficients[:] = 0.0
    s.nuisance.combine[:] = 0.0
    for i in range(s.nuisance.combine.shape[0] - 1):
        s.nuisance.combine[i, i] = 1.0
    s.scatter[:] = 1.0
    s.likelihood[:] = 0.0
    s.predictors[:] = 0.0
    s.predicted[:] = 0.0
    s.prior[:] = s.initial[:, :GAINS]
    s.eta[0] = s.initial[0, GAINS:]
    s.eta[1:] = s.initial[:, GAINS:]
    s.deviation[:] = 0.0
    s.deviation[2] = 1.0
    c.deviation = 0
    s.solution[:] = 0.0
    s.response[:] = 0.0
    s.tangent[:] = 0.0
    k = s.clock[0]
    k.settled = 0
    k.intrinsic_fit = k.reflex_fit = validity.STILL


@part
def linearise(p: Plan, s: State) -> None:
    """Move η₀, d₀ and G₀ to the newest estimate."""
    c = s.counters[0]
    d = s.deviation[0]
    if np.isfinite(c.variance):
        gain = s.solution[3]
        held = gain if abs(gain) > LEAST_GAIN else LEAST_GAIN
        for j in range(d.shape[0]):
            d[j] = (gain * d[j] + s.solution[PARAMETERS + j]) / held
        for k in range(SHAPES):
            step = STEP_SHARE * min(
                max(s.solution[GAINS + k], -LARGEST_SHAPE_STEP[k]), LARGEST_SHAPE_STEP[k]
            )
            s.eta[0, k] = min(
                max(s.eta[0, k] + step, reflex_shapes.LOWEST_SHAPE[k]),
                reflex_shapes.HIGHEST_SHAPE[k],
            )
        c.gain = held
    reflex_shapes.shape_coordinates(s.eta[0], p.basis, p.lags, s.shape_work, s.tangent)
    for j in range(d.shape[0]):
        s.tangent[j, 0] += d[j]
        for k in range(SHAPES):
            s.tangent[j, 1 + k] *= c.gain


@part
def forget_shape(s: State) -> None:
    """Widen the prior of the shape by one second."""
    for k in range(SHAPES):
        default = s.initial[1, GAINS + k]
        s.eta[2, k] = min(np.sqrt(s.eta[2, k] ** 2 + SHAPE_FORGETTING * default**2), default)
    for j in range(s.deviation.shape[1]):
        s.deviation[2, j] = min(np.sqrt(s.deviation[2, j] ** 2 + SHAPE_FORGETTING), 1.0)


@part
def _prior(p: Plan, s: State, precision: np.ndarray, mean: np.ndarray) -> None:
    """Prior of all unknowns; the precision still without the noise variance."""
    c = s.counters[0]
    for i in range(GAINS):
        precision[i] = 1.0 / s.prior[1, i] ** 2
        mean[i] = s.prior[0, i]
    for k in range(SHAPES):
        precision[GAINS + k] = 1.0 / s.eta[2, k] ** 2
        mean[GAINS + k] = s.eta[1, k] - s.eta[0, k]
    for j in range(p.typical.shape[0]):
        precision[PARAMETERS + j] = (
            1.0 / (DEVIATIONS[c.deviation] * s.deviation[2, j] * c.gain * p.typical[j]) ** 2
        )
        mean[PARAMETERS + j] = c.gain * (s.deviation[1, j] - s.deviation[0, j])


@part
def solve_memory(
    p: Plan, s: State, blocks: int, solution: np.ndarray, covariance: np.ndarray
) -> float:
    """Solve for all unknowns over `blocks` blocks, whose normal matrix is `s.matrices[0]`; the
    noise variance, NaN where the data do not determine them."""
    c = s.counters[0]
    unknowns = solution.shape[0]
    normal, work = s.matrices[0], s.matrices[1:3]
    precision, mean = s.vectors[0], s.vectors[1]
    count = blocks * p.block_samples
    variance = c.variance if np.isfinite(c.variance) else normal[unknowns, unknowns] / count
    _prior(p, s, precision, mean)
    precision *= variance
    if np.isnan(solve_with_prior(normal, unknowns, precision, mean, solution, covariance, work)):
        return np.nan
    return squared_residual(normal, unknowns, solution) / max(count - PARAMETERS, 1)


@part
def response(s: State, solution: np.ndarray, coordinates: np.ndarray) -> None:
    """Reflex torque per basis function, shape (m,), from a solution of the linear problem."""
    for j in range(coordinates.shape[0]):
        coordinates[j] = solution[PARAMETERS + j]
        for i in range(PARAMETERS - INTRINSIC):
            coordinates[j] += solution[INTRINSIC + i] * s.tangent[j, i]


@part
def choose_deviation(p: Plan, s: State) -> None:
    """The width of the deviation's prior under which the memory is most likely."""
    c = s.counters[0]
    normal, precision, mean, solution = s.matrices[0], s.vectors[0], s.vectors[1], s.vectors[2]
    sum_recent(s, c.model, c.length, normal, 0)
    count = float(c.length * p.block_samples)
    present, best, largest = -np.inf, 0, -np.inf
    kept = c.deviation
    for candidate in range(DEVIATIONS.shape[0]):
        c.deviation = candidate
        _prior(p, s, precision, mean)
        precision *= c.variance
        determinant = solve_with_prior(
            normal, solution.shape[0], precision, mean, solution, s.matrices[3], s.matrices[1:3]
        )
        if np.isnan(determinant):
            continue
        evidence = log_evidence(
            normal, solution.shape[0], precision, mean, solution, determinant, count
        )
        if evidence > largest:
            best, largest = candidate, evidence
        if candidate == kept:
            present = evidence
    c.deviation = (
        best if largest > present + MIN_REPEATED_LOG_LIKELIHOOD_GAIN * c.dispersion else kept
    )


@part
def detect_change(p: Plan, s: State) -> None:
    c = s.counters[0]
    sum_recent(s, c.model, c.since, s.matrices[6], 0)
    window, d, noise = find_change(
        s.ring[c.model],
        c.newest,
        c.since,
        c.left_over if c.since < p.memory_blocks else 0,
        p.windows,
        s.matrices[6],
        s.tangent,
        _CHANGE_PRECISIONS,
        p.block_samples,
        s.matrices,
        s.recorded,
        s.packed,
        s.nuisance.combine,
        s.nuisance.work,
        s.projection,
        s.vectors,
    )
    if d < p.threshold * c.dispersion:
        return
    if not c.unsettled:
        c.unsettled = 1
        c.noise_before = noise
        s.held[:] = s.output[0]
    for i in range(GAINS):
        s.prior[0, i] = s.solution[i]
        s.prior[1, i] = CHANGE_DEVIATIONS[i]
    for k in range(SHAPES):
        s.eta[1, k] = s.eta[0, k] + s.solution[GAINS + k]
        known = 2.0 * c.variance * s.covariance[GAINS + k, GAINS + k] + SHAPE_DRIFT[k] ** 2
        s.eta[2, k] = min(np.sqrt(known), s.initial[1, GAINS + k])
    for j in range(p.typical.shape[0]):
        s.deviation[1, j] = s.deviation[0, j] + s.solution[PARAMETERS + j] / c.gain
        width = DEVIATIONS[c.deviation] * c.gain * p.typical[j]
        known = (
            2.0 * c.variance * s.covariance[PARAMETERS + j, PARAMETERS + j] / width**2
            + DEVIATION_DRIFT**2
        )
        s.deviation[2, j] = min(np.sqrt(known), 1.0)
    forgotten = c.since - window
    c.left_over = OVERLAP_BLOCKS[0] if forgotten >= MIN_OLDER_BLOCKS else c.left_over - forgotten
    c.since = window
    # All memories but the last now begin with the change: none of them has an advantage.
    s.predicted[:-1] = np.max(s.predicted[:-1])
    c.changed = 1
    if s.predicted[-1] <= s.predicted[0] + MIN_REPEATED_LOG_LIKELIHOOD_GAIN * c.dispersion:
        c.memory = 0
    use_chosen_memory(p, s)


@part
def choose_noise_model(p: Plan, s: State) -> None:
    """Second by second and in logarithms, so that a change of the ankle, which spoils the errors of
    all models alike, decides nothing.
    """
    c = s.counters[0]
    count = p.second * p.block_samples
    for model in range(s.ring.shape[0]):
        sum_recent(s, model, p.second, s.matrices[0], 0)
        squares = squared_residual(s.matrices[0], s.solution.shape[0], s.solution)
        s.likelihood[model] *= 1.0 - 1.0 / LIKELIHOOD_MEMORY
        if squares > 0.0:
            s.likelihood[model] -= 0.5 * count * np.log(squares / count)
    c.model = most_likely(s.likelihood, c.model, MIN_LOG_LIKELIHOOD_GAIN * c.dispersion)


@part
def _output_weights(p: Plan, s: State, output: int, weights: np.ndarray) -> None:
    """K, B, I or G as a linear combination of the unknowns."""
    weights[:] = 0.0
    weights[output] = 1.0
    if output == INTRINSIC:
        # The second-order part has unit area.
        for j in range(p.area.shape[0]):
            weights[output] += p.area[j] * s.deviation[0, j]
            weights[PARAMETERS + j] = p.area[j]


@part
def outputs(p: Plan, s: State) -> None:
    """K, B, I, G and, in units of the noise variance, their variances."""
    c = s.counters[0]
    weights = s.vectors[0]
    for output in range(GAINS):
        _output_weights(p, s, output, weights)
        value = variance = 0.0
        for i in range(weights.shape[0]):
            value += weights[i] * s.solution[i]
            for j in range(weights.shape[0]):
                variance += weights[i] * weights[j] * s.covariance[i, j]
        s.output[0, output], s.output[1, output] = value, variance
    nuisance_coefficients(p, s)
    s.output[0, 1] += c.added_damping
    s.output[0, 2] += c.added_inertia
    if c.unsettled:
        # Between the estimate before the change and the new one, as far as the new one is believed.
        believed = 0.0
        if c.since >= FULL_WEIGHT_BLOCKS:
            believed = 1.0
        elif c.since >= MIN_BLOCKS_AFTER_CHANGE:
            believed = min(LARGEST_VARIANCE_RATIO * c.noise_before / c.variance, 1.0)
        c.unsettled = believed < 1.0
        for output in range(GAINS):
            s.output[0, output] = s.held[output] + believed * (s.output[0, output] - s.held[output])


@part
def watch_scatter(p: Plan, s: State) -> None:
    """Scores of the last batch against what white noise would give; what the standard errors are
    widened by.
    """
    c = s.counters[0]
    normal, weights, influence, fitted = s.matrices[0], s.vectors[0], s.vectors[1], s.vectors[2]
    unknowns = s.solution.shape[0]
    sum_recent(s, c.model, BATCH_DURATION * p.second, normal, 0)
    weight = 1.0 / min(c.batches + 1.0, SCATTER_MEMORY)
    mean = 0.0
    for output in range(GAINS):
        _output_weights(p, s, output, weights)
        # influence = C weights: what one unit of score does to the output.
        for i in range(unknowns):
            total = 0.0
            for j in range(unknowns):
                total += s.covariance[i, j] * weights[j]
            influence[i] = total
        observed = expected = 0.0
        for i in range(unknowns):
            score, total = normal[i, unknowns], 0.0
            for j in range(unknowns):
                score -= normal[i, j] * s.solution[j]
                total += normal[i, j] * influence[j]
            observed += influence[i] * score
            expected += influence[i] * total
            fitted[i] = total
        # The fit has already taken part of the scores: their variance is N - N C N.
        for i in range(unknowns):
            for j in range(unknowns):
                expected -= fitted[i] * s.covariance[i, j] * fitted[j]
        ratio = observed * observed / (c.variance * expected) if expected > 0.0 else 1.0
        s.scatter[output] += weight * (ratio - s.scatter[output])
        mean += s.scatter[output] / GAINS
    c.batches += 1
    c.dispersion = max(mean, 1.0)


@part
def explained(p: Plan, s: State) -> None:
    """Variance of the torque (above the lowest corner) that both pathways and the intrinsic one
    account for.
    """
    c = s.counters[0]
    normal = s.matrices[0]
    sum_recent(s, 0, c.length, normal, 0)
    unknowns = s.solution.shape[0]
    size = s.nuisance.combine.shape[1]
    total = s.totals[0][size * (size + 1) // 2 + size]
    if not total > 0.0:
        c.vaf_total = c.vaf_intrinsic = np.nan
        return
    c.vaf_total = 100.0 * (1.0 - squared_residual(normal, unknowns, s.solution) / total)
    c.vaf_intrinsic = 100.0 * (1.0 - squared_residual(normal, INTRINSIC, s.solution) / total)


@part
def watch_residual(s: State, residual: float) -> None:
    """Running autocovariance of the residual, over `LIKELIHOOD_MEMORY`."""
    e, a = s.residuals, s.autocovariance
    for k in range(e.shape[0] - 1, 0, -1):
        e[k] = e[k - 1]
    e[0] = residual
    forgetting = 1.0 / (LIKELIHOOD_MEMORY * RESIDUAL_RATE)
    for k in range(e.shape[0]):
        a[k] += forgetting * (e[0] * e[k] - a[k])
