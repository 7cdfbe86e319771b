"""The separation has a `Plan`, fixed at the start, and a `State` that it remembers."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

# Channels of the low-pass: position, torque, velocity.
INPUTS = 3
# Channels of the high-pass; 'torque' uses the first two.
TORQUE, RECTIFIED, POSITION, VELOCITY, ACCELERATION = range(5)
# Sums over one decimated sample.
SUM_TORQUE, SUM_INTRINSIC, SUM_RECTIFIED = range(3)
# First and second moments of torque, torque minus intrinsic, torque minus intrinsic and reflex; and
# a constant 1.
VAF_MOMENTS = 7


class Plan(NamedTuple):
    """Holds the constants of a separation at one sampling rate."""

    rate: float
    measured_velocity: bool
    highpassed: int
    """Channels that pass the high-pass: 2 (torque, v₊) or 5 (all)."""
    lowpass: np.ndarray
    difference: np.ndarray
    highpass: np.ndarray
    average: np.ndarray
    reflex_average: np.ndarray
    vaf_average: np.ndarray
    batch_average: np.ndarray
    decimation: int
    first_lag: int
    ridge: float
    operating_point_samples: float
    settling_samples: float
    pause_samples: int
    memory: float
    """Memory [s]"""
    estimate_every: int
    batch_samples: int
    intrinsic_factor: float
    reflex_factor: float


class State(NamedTuple):
    """Holds everything that is remembered between samples."""

    clock: np.ndarray
    lowpass: np.ndarray
    position_history: np.ndarray
    velocity_history: np.ndarray
    highpass: np.ndarray
    operating_point: np.ndarray
    """Mean position [rad] and the number of samples in it."""
    inputs: np.ndarray
    filtered: np.ndarray
    signals: np.ndarray
    product_sums: np.ndarray
    product_filter: np.ndarray
    products: np.ndarray
    parameters: np.ndarray
    inverse: np.ndarray
    sums: np.ndarray
    rectified: np.ndarray
    """Decimated v₊, the newest first."""
    correlation_filter: np.ndarray
    correlations: np.ndarray
    column: np.ndarray
    response: np.ndarray
    """Δ h, shape (L,): reflex torque per v₊ of one decimated sample."""
    row_sums: np.ndarray
    levinson: np.ndarray
    vaf_filter: np.ndarray
    vaf_moments: np.ndarray
    scores: np.ndarray
    """Sums over the present batch, and the score's number of samples for K, B, I and for G."""
    batch: np.ndarray
    batch_filter: np.ndarray
    score_moments: np.ndarray
    estimate: np.ndarray
    """The last valid row and the response that belongs to it."""
    valid_response: np.ndarray
