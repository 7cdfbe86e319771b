"""What the simultaneous estimator knows at the start (`Plan`) and what it remembers (`State`)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

COUNTERS = np.dtype(
    [
        (name, np.int64)
        for name in (
            "index",
            "filled",
            "blocks",
            "newest",
            "length",
            "since",
            "kept",
            "memory",
            "changed",
            "unsettled",
            "left_over",
            "model",
            "deviation",
            "batches",
            "finished",
        )
    ]
    + [
        (name, np.float64)
        for name in ("variance", "noise_before", "gain", "vaf_intrinsic", "vaf_total", "dispersion")
    ]
)
"""Counters: newest raw sample, decimated samples in the present block, blocks so far, newest block
in the ring, blocks in the memory, blocks since the last change and since the last interruption
(both at most the full memory), which memory is chosen, whether there was a change since the choice,
whether the estimate since the change is not yet believed in full, how many of the blocks since the
last change may be from before it, noise model, width of the deviation's prior, batches of scores,
whether a block is complete. Noise variance now and before the last change [N²m²], G₀ [N.m.s/rad],
VAF [%], mean scatter of the scores [1]."""


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
    area: np.ndarray
    """Of each basis function, shape (m,)."""
    typical: np.ndarray
    """Standard deviation of each coordinate over all shapes of unit area, shape (m,)."""
    whitening: np.ndarray
    """Sections of every noise model, shape (models, 2, 6)."""
    passband: float
    """What brings signals whitened under the first noise model back to their size."""
    block_samples: int
    memory_blocks: int
    lengths: np.ndarray
    """Memories that can be chosen [blocks], falling; one more is the full memory whatever changed.
    """
    horizon: int
    """Blocks that every memory predicts before it is asked anew."""
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
    """Position, velocity, torque, shape (3, 2 (3 n + 1)): written twice, so that the newest ones
    are always in one piece.
    """
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
    deviation: np.ndarray
    """d₀; its prior's mean, and its standard deviation relative to the chosen one; shape (3, m)."""
    tangent: np.ndarray
    """c(η₀) + d₀ and G₀ times its derivatives, shape (m, 4)."""
    prior: np.ndarray
    """Mean and standard deviation of K, B, I, G before the memory, shape (2, 4)."""
    solution: np.ndarray
    """The unknowns of `regression`, shape (m + 7,)."""
    covariance: np.ndarray
    """Over the noise variance, shape (m + 7, m + 7)."""
    output: np.ndarray
    """K, B, I, G; their variances over the noise variance; shape (2, 4)."""
    held: np.ndarray
    """K, B, I, G before the last change, shape (4,)."""
    response: np.ndarray
    """Reflex torque per basis function, shape (m,)."""
    likelihood: np.ndarray
    """Running ln L of the noise models, shape (models,)."""
    predictors: np.ndarray
    """K, B, I, reflex per basis function and -1 as each memory has them, shape (memories, m + 4).
    """
    predicted: np.ndarray
    """Running ln L of the memories' predictions, shape (memories,)."""
    scatter: np.ndarray
    """Observed over expected variance of the scores of K, B, I and G, shape (4,)."""
    estimate: np.ndarray
    valid_response: np.ndarray
    matrices: np.ndarray
    vectors: np.ndarray
    projection: np.ndarray
    packed: np.ndarray
    shape_work: np.ndarray
