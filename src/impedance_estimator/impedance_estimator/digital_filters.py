"""Digital filters that keep their state between blocks: cascades of second-order sections over
several channels.

A section in direct form II transposed:

    y[n] = b0 u[n] + s0
    s0   = b1 u[n] - a1 y[n] + s1
    s1   = b2 u[n] - a2 y[n]

Designs come from `scipy.signal` by the bilinear transform with pre-warped cut-off.
"""

from __future__ import annotations

import numpy as np
from numba import njit
from scipy import signal

NO_FILTER = np.zeros((0, 6))


def butterworth_lowpass(order: int, cutoff: float, rate: float) -> np.ndarray:
    """Return the sections, shape (k, 6), of a Butterworth low-pass with -3 dB at `cutoff` [Hz], for
    samples at `rate` [Hz].
    """
    return np.ascontiguousarray(signal.butter(order, cutoff, fs=rate, output="sos"))


def bessel_lowpass(order: int, cutoff: float, rate: float) -> np.ndarray:
    """Return the sections, shape (k, 6), of a Bessel low-pass, for samples at `rate` [Hz].

    `cutoff` [Hz] is the frequency of the phase midpoint, as in Matlab's ``besself`` and Simulink's
    analog filter block, with which the original algorithm was built.
    """
    return np.ascontiguousarray(signal.bessel(order, cutoff, fs=rate, norm="phase", output="sos"))


def exponential_average(cutoff: float, rate: float) -> np.ndarray:
    """Return the sections, shape (2, 6), of two equal first-order low-passes in a row with poles at
    `cutoff` [Hz].

    Its weights are nowhere negative, so a running variance made with it is not either; a
    Butterworth average's are.
    """
    return np.repeat(signal.butter(1, cutoff, fs=rate, output="sos"), 2, axis=0)


def highpass(cutoff: float, rate: float) -> np.ndarray:
    """Return the sections, shape (1, 6), of a first-order high-pass with -3 dB at `cutoff` [Hz],
    for samples at `rate` [Hz].
    """
    return np.ascontiguousarray(signal.butter(1, cutoff, "highpass", fs=rate, output="sos"))


def weight_energy(sections: np.ndarray, rate: float) -> float:
    """Return the integral of the squared weighting function of a low-pass with unit gain [1/s]: its
    two-sided noise bandwidth.

    The inverse is the length [s] of the plain average that has the same variance for white noise.
    """
    _, denominator = signal.sos2tf(sections)
    # The response has died out after this many of its slowest time constants to 1e-13.
    slowest = float(np.max(np.abs(np.roots(denominator))))
    length = int(np.ceil(-30.0 / np.log(slowest)))
    impulse = np.zeros(length)
    impulse[0] = 1.0
    response = signal.sosfilt(sections, impulse)
    return float(rate * np.sum(response**2) / np.sum(response) ** 2)


def filter_state(sections: np.ndarray, channels: int) -> np.ndarray:
    """Return the state of a cascade at rest, shape (2, sections, channels)."""
    return np.zeros((2, max(len(sections), 1), channels))


@njit(inline="always")
def filter_step(sections: np.ndarray, state: np.ndarray, values: np.ndarray, channels: int) -> None:
    """Pass one sample of every channel through the cascade, in place.

    Parameters
    ----------
    sections
        Shape (k, 6), rows b0 b1 b2 1 a1 a2; k = 0 leaves the values as they are.
    state
        s0 and s1, shape (2, k, c): each of them in one piece, so that the compiler sees that they
        do not overlap, and computes several channels at once.
    values
        Shape (c,): input, then output.
    channels
        How many of the c values are filtered. A constant lets the compiler unroll the loop.
    """
    for k in range(sections.shape[0]):
        b0, b1, b2 = sections[k, 0], sections[k, 1], sections[k, 2]
        a1, a2 = sections[k, 4], sections[k, 5]
        first, second = state[0, k], state[1, k]
        for c in range(channels):
            u = values[c]
            y = b0 * u + first[c]
            first[c] = b1 * u - a1 * y + second[c]
            second[c] = b2 * u - a2 * y
            values[c] = y


@njit
def settle_filter(sections: np.ndarray, state: np.ndarray, values: np.ndarray) -> None:
    """Put the cascade into the steady state of constant inputs `values`, which become its outputs,
    in place.

    A filter started like this passes no transient of a signal's offset.
    """
    for k in range(sections.shape[0]):
        b0, b1, b2 = sections[k, 0], sections[k, 1], sections[k, 2]
        a1, a2 = sections[k, 4], sections[k, 5]
        gain = (b0 + b1 + b2) / (1.0 + a1 + a2)
        for c in range(values.shape[0]):
            u = values[c]
            y = gain * u
            state[1, k, c] = b2 * u - a2 * y
            state[0, k, c] = b1 * u - a1 * y + state[1, k, c]
            values[c] = y
