"""Standard errors of least squares whose residual is coloured.

The residual of a running least-squares estimate is not white: the intrinsic fit leaves the whole
reflex torque in it, the reflex fit leaves voluntary torque. What counts is how much the running
average of the score (regressor times residual) varies. Averages of the score over batches longer
than its correlation, times the variance of the batches under the averaging filter, give that
without a model of the noise (batch means; Newey & West, Econometrica 55 (1987) 703-708, for the
sandwich form):

    cov(θ) = R⁻¹ S R⁻¹,   S = T_b <g g'> ∫ w²(t) dt,   g = batch average of s e

w is the weighting function of the averaging filter with unit area. The standard errors hold for
stationary parameters; bias (errors in the regressors, torque high-passed alone) is not in them.
"""

from __future__ import annotations

import numpy as np
from numba import njit

from impedance_estimator.digital_filters import filter_step

BATCH_DURATION = 4.0
"""A batch [s] is longer than the time over which the scores are correlated: one perturbation
response (0.5-0.7 s). Longer batches leave fewer of them within the averages' memory of about 18 s.
"""
BATCH_PERIOD = 0.1
"""A batch is at most this share of the averaging filter's period: the filter runs at one sample per
batch.

4 s at the default cut-off of 0.025 Hz.
"""

SCORES = 4
"""There is a score for each of K, B, I and G."""

MOMENTS = 8
"""The 6 products of the intrinsic scores, the square of the reflex score, and a constant 1."""


def batch_length(cutoff: float) -> float:
    """Return the length of a batch [s] under an averaging filter with a cut-off [Hz]."""
    return min(BATCH_DURATION, BATCH_PERIOD / cutoff)


@njit
def average_batch(
    sections: np.ndarray, state: np.ndarray, moments: np.ndarray, scores: np.ndarray
) -> None:
    """Put one batch of scores into their running second moments.

    Parameters
    ----------
    sections, state
        Averaging low-pass at one sample per batch, `MOMENTS` channels; without negative weights.
    moments
        Shape (`MOMENTS`,), replaced by the new running averages.
    scores
        Shape (`SCORES`,), batch averages of the scores.
    """
    k = 0
    for i in range(3):
        for j in range(i, 3):
            moments[k] = scores[i] * scores[j]
            k += 1
    moments[k] = scores[3] * scores[3]
    moments[k + 1] = 1.0
    filter_step(sections, state, moments, MOMENTS)


@njit
def intrinsic_variance(
    moments: np.ndarray, inverse: np.ndarray, gain: float, factor: float, variance: np.ndarray
) -> None:
    """Return the variances of K, B and I: the diagonal of R⁻¹ S R⁻¹.

    Parameters
    ----------
    moments
        Running moments of the signals, shape (`MOMENTS`,).
    inverse
        Shape (3, 3), inverse of the running normal matrix.
    gain
        Present gain of the running averages in `inverse`.
    factor
        T_b ∫ w² dt [1].
    variance
        Shape (3,), replaced.
    """
    batches = moments[MOMENTS - 1]
    if not batches > 0.0:
        variance[:] = np.nan
        return
    for p in range(3):
        total = 0.0
        k = 0
        for i in range(3):
            for j in range(i, 3):
                double = 1.0 if i == j else 2.0
                total += double * inverse[p, i] * inverse[p, j] * moments[k]
                k += 1
        variance[p] = total / batches * factor * gain * gain


@njit
def reflex_variance(moments: np.ndarray, gain: float, factor: float) -> float:
    """Return the variance of G, the sum of the reflex response, whose score is (1' T⁻¹ v₊) e.

    Parameters
    ----------
    moments
        Running moments of the signals, shape (`MOMENTS`,).
    gain
        Present gain of the running correlations in T.
    factor
        T_b ∫ w² dt [1].
    """
    batches = moments[MOMENTS - 1]
    if not batches > 0.0:
        return np.nan
    return moments[MOMENTS - 2] / batches * factor * gain * gain
