"""The simultaneous estimator has a `Plan`, fixed at the start, and a `State` that it remembers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Nuisance(NamedTuple):
    """Holds what `explained_motion` finds; n signals of the motion, of which e are nuisance."""

    gamma: np.ndarray
    """Γ per recorded signal, shape (n, m + 4)."""
    combine: np.ndarray
    """T, shape (m + 4, n); the last row is what is subtracted from the torque."""
    unknowns: np.ndarray
    """The rows of T that belong to the unknowns of `regression`, and its last row, shape (8, n)."""
    coefficients: np.ndarray
    """What the nuisance terms add to the torque per recorded signal, shape (n,)."""


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
            "detection",
            "batches",
            "referenced",
            "instrumented",
            "centred",
            "filters_settled",
        )
    ]
    + [
        (name, np.float64)
        for name in (
            "variance",
            "noise_before",
            "gain",
            "vaf_intrinsic",
            "vaf_total",
            "dispersion",
            "delay",
            "added_damping",
            "added_inertia",
            "doubt",
            "mean_stretch",
        )
    ]
)
"""Counters: newest raw sample, decimated samples in the present block, blocks so far, newest
block in the ring, blocks in the memory, blocks since the last change and since the last
interruption (both at most the full memory), which memory is chosen, whether there was a change
since the choice, whether the estimate since the change is not yet believed in full, how many of
the blocks since the last change may be from before it, noise model of the estimate and of the
detection, batches of scores, whether the reference is there, whether it was for any sample of
the present block, decimated samples since the operating point was begun, whether the whitening
filters started with full histories. Noise variance now and before the last change [N²m²], G₀
[N.m.s/rad], VAF [%], mean scatter of the scores [1], delay of the torque [s], what it adds to B
and I, doubt [1], mean velocity of the stretches in the memory [rad/s]."""


class Plan(NamedTuple):
    """Holds the constants of the estimator at one sampling rate."""

    rate: float
    measured_velocity: bool
    modelled_reflex: bool
    """Whether the torque of a reflex with unit gain comes with the samples: its shape is held."""
    given_stretch: bool
    """Whether rectified velocity comes with the samples, filtered as the reflex' torque is."""
    kernels: np.ndarray
    """Smoothing, first and second derivative, shape (3, 2 n + 1)."""
    rest_velocity: float
    decimation: int
    functions: np.ndarray
    """Reflex basis times the decimated interval, shape (lags, m)."""
    basis: np.ndarray
    lags: np.ndarray
    area: np.ndarray
    """Area under each basis function, shape (m,)."""
    whitening: np.ndarray
    """Sections of every noise model, shape (models, 2, 6)."""
    sections: np.ndarray
    """How many of them each noise model needs: the others leave a signal as it is."""
    passband: float
    """Factor that brings signals whitened under the first noise model back to their size."""
    block_samples: int
    memory_blocks: int
    lengths: np.ndarray
    """Memories that can be chosen [blocks], falling; one more is the full memory whatever changed.
    """
    horizon: int
    """Blocks that every memory predicts before it is asked anew."""
    windows: np.ndarray
    """Candidates for a change; none: no detection."""
    short_windows: int
    """How many of them, the first ones, are looked at most often."""
    threshold: float
    second: int
    """Blocks in a second."""
    settling_samples: float
    pause_samples: int
    memory: float
    estimate_every: int


class State(NamedTuple):
    """Holds everything that is remembered between samples."""

    clock: np.ndarray
    counters: np.ndarray
    nuisance: Nuisance
    raw: np.ndarray
    """Position, velocity, torque, reference, reflex column along the motion and along that of the
    reference, shape (6, 2 (3 n + 1)): written twice, so that the newest ones are always in one
    piece.
    """
    rectified: np.ndarray
    """Rectified signals of the measured motion and of the reference, shape (2, 2 (2 n + 1)),
    likewise.
    """
    slow_rectified: np.ndarray
    stretches: np.ndarray
    """Sums of v₊ and of its square in every block of the ring, shape (capacity, 2)."""
    stretch: np.ndarray
    """Those of the present block, shape (2,)."""
    muscle: np.ndarray
    """Response of a muscle with the shape η₀ times the decimated interval, shape (lags,)."""
    actuator: np.ndarray
    """Filter state of the nominal actuator, shape (2,)."""
    slow_states: np.ndarray
    """Relaxing position, yielding torque and operating point of both motions, shape (2, 3)."""
    past: np.ndarray
    """Signals of the last decimated samples, both ways of the taps' reach."""
    signals: np.ndarray
    """Motion (n signals), torque, instruments (n signals), shape (2 n + 1,)."""
    whitened: np.ndarray
    filters: np.ndarray
    """State of the whitening filters, shape (models, 2, sections, 2 n + 1)."""
    block: np.ndarray
    """Whitened instruments, torque and motion of the present block, shape (models, samples of a
    block, 2 n + 1)."""
    ring: np.ndarray
    """Shape (models, capacity, packed)."""
    totals: np.ndarray
    """Over the memory, shape (models, packed)."""
    eta: np.ndarray
    """η₀; its prior's mean and standard deviation; shape (3, 3)."""
    tangent: np.ndarray
    """c(η₀) and G₀ times its derivatives, shape (m, 4)."""
    initial: np.ndarray
    """Mean and standard deviation of K, B, I, G and η before any data, shape (2, 7)."""
    prior: np.ndarray
    """Mean and standard deviation of K, B, I, G before the memory, shape (2, 4)."""
    solution: np.ndarray
    """The unknowns of `regression`, shape (7,)."""
    covariance: np.ndarray
    """Over the noise variance, shape (7, 7)."""
    output: np.ndarray
    """K, B, I, G; their variances over the noise variance; shape (2, 4)."""
    held: np.ndarray
    """K, B, I, G before the last change, shape (4,)."""
    response: np.ndarray
    """Reflex torque per basis function, shape (m,)."""
    compared: np.ndarray
    """K, B, I and G of the whole memory and their variances under each noise model, shape (models,
    2, 4); zero before there are any."""
    model_error: np.ndarray
    """Relative error of K, B, I and G that no scatter within the memory shows, part of their
    standard errors, shape (4,); see `doubt`."""
    predictors: np.ndarray
    """Torque per instrument as each memory predicts it, shape (memories, n)."""
    predicted: np.ndarray
    """Running ln L of the memories' predictions, shape (memories,)."""
    scatter: np.ndarray
    """Observed over expected variance of the scores of K, B, I and G, shape (models, 4)."""
    signs: np.ndarray
    """Signs of doubt, in the order of `doubt.SIGNS`."""
    estimate: np.ndarray
    valid_response: np.ndarray
    shape_work: np.ndarray
