"""Smoothing and differentiation by one kernel, so that torque, position, velocity and acceleration
stay in step.

With a kernel h, its derivative h' and * for convolution:

    h * τ = K (h * x) + B (h * v) + I (h * a)
    h * a = h' * v,   h * v = h' * x,   h * a = h'' * x

A linear equation between signals holds unchanged between the smoothed ones, and the derivatives are
exact for the smoothed signals (Shinbrot, Trans. ASME 79 (1957) 741-746: modulating functions). The
kernel is a Gaussian.
"""

from __future__ import annotations

import math

import numpy as np
from numba import njit

from ankle_interfaces.errors import QuantityError

KERNEL_HALF_WIDTH = 4.5
"""The kernel ends at so many standard deviations, where the Gaussian has fallen to 4e-5."""


def gaussian_derivatives(sigma: float, rate: float) -> np.ndarray:
    """Return symmetric kernels for a value, its first and its second derivative, shape (3, 2 n +
    1), units 1, 1/s, 1/s².

    Corrected for sampling and cutting so that they are exact for polynomials of second order.

    Parameters
    ----------
    sigma
        Standard deviation of the Gaussian [s]; -3 dB at 0.133 / sigma [Hz].
    rate
        Sampling rate [Hz].

    Raises
    ------
    QuantityError
        A standard deviation under 0.7 samples, where the sampled second derivative is no longer
        one.
    """
    if sigma * rate < 0.7:
        raise QuantityError(
            f"smoothing {sigma:g} s is refused at {rate:g} Hz; allowed: at least {0.7 / rate:g} s"
        )
    n = math.ceil(KERNEL_HALF_WIDTH * sigma * rate)
    t = np.arange(-n, n + 1) / rate
    value = np.exp(-0.5 * (t / sigma) ** 2)
    value /= value.sum()
    first = t * value
    # The newest sample comes last: a rising signal has a positive slope.
    first /= np.sum(first * t)
    second = (t**2 / sigma**4 - 1.0 / sigma**2) * value
    second -= value * second.sum()
    second /= 0.5 * np.sum(second * t**2)
    return np.stack([value, first, second])


@njit(cache=True)
def weighted_stretches(values: np.ndarray, kernel: np.ndarray) -> np.ndarray:
    """Return Σ kernel times each stretch of a signal, one sum after the other, so that the result
    does not depend on how the signal is divided; shape (n - m + 1,).

    Parameters
    ----------
    values
        Samples of the signal, shape (n,).
    kernel
        Shape (m,), its last weight for the newest sample.
    """
    size = kernel.shape[0]
    out = np.zeros(values.shape[0] - size + 1)
    for k in range(size):
        for i in range(out.shape[0]):
            out[i] += kernel[k] * values[i + k]
    return out


@njit(cache=True)
def weighted_channels(channels: np.ndarray, kernels: np.ndarray, chosen: np.ndarray) -> np.ndarray:
    """Return `weighted_stretches` of several pairs of a channel and a kernel, shape (j, n - m + 1).

    Parameters
    ----------
    channels
        Shape (c, n).
    kernels
        Shape (k, m).
    chosen
        Number of a channel and of a kernel for each result, shape (j, 2).
    """
    out = np.empty((len(chosen), channels.shape[1] - kernels.shape[1] + 1))
    for j in range(len(chosen)):
        out[j] = weighted_stretches(channels[chosen[j, 0]], kernels[chosen[j, 1]])
    return out
