"""A complete block updates the estimate.

The steps are: linearise, look for a change, solve; `noise_model_choice` then compares the noise
models.
"""

from __future__ import annotations

import numpy as np

from impedance_estimator import validity
from impedance_estimator.compilation import part
from impedance_estimator.simultaneous import reflex_shapes
from impedance_estimator.simultaneous.change_detection import (
    LONG_WINDOW_PERIOD,
    MIN_OLDER_BLOCKS,
    OVERLAP_BLOCKS,
    find_change,
)
from impedance_estimator.simultaneous.memory import normal_matrix, use_chosen_memory
from impedance_estimator.simultaneous.nuisance import nuisance_coefficients
from impedance_estimator.simultaneous.regression import (
    GAINS,
    INTRINSIC,
    LEAST_GAIN,
    PARAMETERS,
    solve_with_prior,
    squared_residual,
)
from impedance_estimator.simultaneous.state import Plan, State
from impedance_estimator.simultaneous.voluntary_torque_noise import (
    LOW_CORNER,
    MIDDLE_CORNER,
)

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
RESPONSE_SAMPLES = 30.0
"""So many samples of the residual count as one observation against the prior of the shape. What the
model leaves out lasts as long as a response rises (0.1 s at 256 Hz), where noise would be new at
every sample; taken as noise it pulls the shape to an edge of its range, and G with it."""
SHAPE_FORGETTING = 1.0 / 60.0
"""What was known about the shape before the memory is forgotten at this rate [1/s], over a hold
period.
"""
MIN_REPEATED_LOG_LIKELIHOOD_GAIN = 15.0
"""A shorter memory is chosen when its ln L is larger by this. Memories are compared again and
again, and a wrong choice costs precision: 5 was passed by chance in 2 of 30 simulated runs of three
minutes."""
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
SOON_CHANGED_FACTOR = 2.0
"""A change sooner after another than the scatter is known may be a reflex that varies from stretch
to stretch. Each one raises the threshold by this factor until a memory lasts: otherwise the memory
began anew with every second stretch, and never told how much they vary."""
MIN_SCATTER_LENGTH = 5.0
"""The scatter of the scores is watched once the memory has this length [s]: with less, the fit
follows each second of its data.
"""


@part
def forget(s: State) -> None:
    """Begin anew: everything learnt from earlier samples is dropped."""
    c = s.counters[0]
    s.totals[:] = 0.0
    c.filled = c.length = c.since = c.kept = c.memory = c.changed = c.unsettled = c.left_over = (
        c.blocks
    ) = c.batches = 0
    c.model = c.detection = MIDDLE_CORNER
    c.variance = np.nan
    c.dispersion = 1.0
    c.gain = 10.0 * LEAST_GAIN
    c.delay = c.doubt = c.added_damping = c.added_inertia = 0.0
    s.signs[:] = 0.0
    s.nuisance.gamma[:] = 0.0
    s.nuisance.coefficients[:] = 0.0
    s.nuisance.combine[:] = 0.0
    for i in range(s.nuisance.combine.shape[0] - 1):
        s.nuisance.combine[i, i] = 1.0
    s.scatter[:] = 1.0
    s.compared[:] = 0.0
    s.predictors[:] = 0.0
    s.predicted[:] = 0.0
    s.prior[:] = s.initial[:, :GAINS]
    s.eta[0] = s.initial[0, GAINS:]
    s.eta[1:] = s.initial[:, GAINS:]
    s.solution[:] = 0.0
    s.response[:] = 0.0
    s.tangent[:] = 0.0
    s.muscle[:] = 0.0
    s.stretch[:] = 0.0
    c.mean_stretch = 0.0
    k = s.clock[0]
    k.settled = 0
    k.intrinsic_fit = k.reflex_fit = validity.STILL


@part
def linearise(p: Plan, s: State) -> None:
    """Move η₀ and G₀ to the newest estimate."""
    c = s.counters[0]
    if np.isfinite(c.variance):
        for k in range(SHAPES):
            step = STEP_SHARE * min(
                max(s.solution[GAINS + k], -LARGEST_SHAPE_STEP[k]), LARGEST_SHAPE_STEP[k]
            )
            s.eta[0, k] = min(
                max(s.eta[0, k] + step, reflex_shapes.LOWEST_SHAPE[k]),
                reflex_shapes.HIGHEST_SHAPE[k],
            )
        gain = s.solution[3]
        c.gain = gain if abs(gain) > LEAST_GAIN else LEAST_GAIN
    if p.modelled_reflex:
        s.tangent[0, 0] = 1.0
        _combine_unknowns(s)
        return
    reflex_shapes.shape_coordinates(s.eta[0], p.basis, p.lags, s.shape_work, s.tangent)
    s.muscle[:] = 0.0
    for j in range(s.tangent.shape[0]):
        for lag in range(s.muscle.shape[0]):
            s.muscle[lag] += p.functions[lag, j] * s.tangent[j, 0]
    for j in range(s.tangent.shape[0]):
        for k in range(SHAPES):
            s.tangent[j, 1 + k] *= c.gain
    _combine_unknowns(s)


@part
def _combine_unknowns(s: State) -> None:
    """Set how the signals of the unknowns, and what is subtracted from the torque, are combined
    from the recorded ones.
    """
    combine, unknowns = s.nuisance.combine, s.nuisance.unknowns
    unknowns[:INTRINSIC] = combine[:INTRINSIC]
    unknowns[PARAMETERS] = combine[-1]
    for i in range(PARAMETERS - INTRINSIC):
        row = unknowns[INTRINSIC + i]
        row[:] = 0.0
        for j in range(s.tangent.shape[0]):
            for k in range(row.shape[0]):
                row[k] += s.tangent[j, i] * combine[INTRINSIC + j, k]


@part
def forget_shape(s: State) -> None:
    """Widen the prior of the shape by one second."""
    for k in range(SHAPES):
        default = s.initial[1, GAINS + k]
        s.eta[2, k] = min(np.sqrt(s.eta[2, k] ** 2 + SHAPE_FORGETTING * default**2), default)


@part
def prior_of_unknowns(s: State, precision: np.ndarray, mean: np.ndarray) -> None:
    """Return the prior of all unknowns; the precision still without the noise variance."""
    for i in range(GAINS):
        precision[i] = 1.0 / s.prior[1, i] ** 2
        mean[i] = s.prior[0, i]
    for k in range(SHAPES):
        precision[GAINS + k] = RESPONSE_SAMPLES / s.eta[2, k] ** 2
        mean[GAINS + k] = s.eta[1, k] - s.eta[0, k]


@part
def solve_memory(
    p: Plan,
    s: State,
    normal: np.ndarray,
    blocks: int,
    solution: np.ndarray,
    covariance: np.ndarray,
) -> float:
    """Solve for all unknowns over `blocks` blocks, whose normal matrix is given, into `solution`
    and `covariance`; return the noise variance, NaN where the data do not determine the unknowns.
    """
    c = s.counters[0]
    precision, mean = np.empty(PARAMETERS), np.empty(PARAMETERS)
    count = blocks * p.block_samples
    variance = c.variance if np.isfinite(c.variance) else normal[PARAMETERS, PARAMETERS] / count
    prior_of_unknowns(s, precision, mean)
    precision *= variance
    if np.isnan(solve_with_prior(normal, PARAMETERS, precision, mean, solution, covariance)):
        return np.nan
    return squared_residual(normal, PARAMETERS, solution) / max(count - PARAMETERS, 1)


@part
def response(s: State, solution: np.ndarray, coordinates: np.ndarray) -> None:
    """Return the reflex torque per basis function, shape (m,), from a solution of the linear
    problem.
    """
    for j in range(coordinates.shape[0]):
        coordinates[j] = 0.0
        for i in range(PARAMETERS - INTRINSIC):
            coordinates[j] += solution[INTRINSIC + i] * s.tangent[j, i]


@part
def detect_change(p: Plan, s: State) -> None:
    """Look for a change of the joint in the memory, and shorten the memory to what came after."""
    c = s.counters[0]
    all_windows = c.blocks % LONG_WINDOW_PERIOD == 0
    window, d, noise = find_change(
        s.ring[c.detection],
        c.newest,
        c.since,
        c.left_over if c.since < p.memory_blocks and all_windows else 0,
        p.windows if all_windows else p.windows[: p.short_windows],
        normal_matrix(s, c.detection, c.since, 0),
        _CHANGE_PRECISIONS,
        p.block_samples,
        s.nuisance.unknowns,
    )
    if d < p.threshold * c.dispersion:
        return
    if c.since < MIN_SCATTER_LENGTH * p.second:
        c.dispersion *= SOON_CHANGED_FACTOR
    if not c.unsettled:
        c.unsettled = 1
        c.noise_before = noise
        s.held[:] = s.output[0]
    for i in range(GAINS):
        s.prior[0, i] = s.solution[i]
        s.prior[1, i] = min(CHANGE_DEVIATIONS[i], s.initial[1, i])
    for k in range(SHAPES):
        s.eta[1, k] = s.eta[0, k] + s.solution[GAINS + k]
        known = 2.0 * c.variance * s.covariance[GAINS + k, GAINS + k] + SHAPE_DRIFT[k] ** 2
        s.eta[2, k] = min(np.sqrt(known), s.initial[1, GAINS + k])
    forgotten = c.since - window
    c.left_over = OVERLAP_BLOCKS[0] if forgotten >= MIN_OLDER_BLOCKS else c.left_over - forgotten
    c.since = window
    # All memories but the last now begin with the change: none of them has an advantage.
    s.predicted[:-1] = np.max(s.predicted[:-1])
    c.changed = 1
    if s.predicted[-1] <= s.predicted[0] + MIN_REPEATED_LOG_LIKELIHOOD_GAIN * c.dispersion:
        c.memory = 0
    c.model = c.detection
    use_chosen_memory(p, s)


@part
def outputs(p: Plan, s: State) -> None:
    """Return K, B, I, G and, in units of the noise variance, their variances."""
    c = s.counters[0]
    for i in range(GAINS):
        s.output[0, i], s.output[1, i] = s.solution[i], s.covariance[i, i]
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
def explained(p: Plan, s: State, normal: np.ndarray) -> None:
    """Set the shares of the torque's variance (above the lowest corner) that both pathways and the
    intrinsic one account for.

    Parameters
    ----------
    p, s
        Plan and state of the estimator.
    normal
        Normal matrix of the memory under the model with the lowest corner.
    """
    c = s.counters[0]
    size = s.nuisance.combine.shape[1]
    total = s.totals[LOW_CORNER][size * (size + 1) // 2 + size]
    if not total > 0.0:
        c.vaf_total = c.vaf_intrinsic = np.nan
        return
    c.vaf_total = 100.0 * (1.0 - squared_residual(normal, PARAMETERS, s.solution) / total)
    c.vaf_intrinsic = 100.0 * (1.0 - squared_residual(normal, INTRINSIC, s.solution) / total)
