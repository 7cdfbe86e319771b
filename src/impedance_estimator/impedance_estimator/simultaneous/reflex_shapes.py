"""Shapes of the reflex response: second-order muscles, and a small basis that spans all of them.

    h(t) = ω² / (s² + 2 z ω s + ω²) after a delay D: unit area, so that the gain G is its factor
    h(t; η) ≈ Σ_j c_j(η) b_j(t),   η = (ln ω, ln z, D)

The shape is that of van 't Veld et al. 2018, figure 1. b_j are the leading principal components
(Karhunen-Loève) of all shapes within `LOWEST_SHAPE` and `HIGHEST_SHAPE`, each weighted with its
prior probability. The data are reduced to sums of products of signals passed through b_j; from
these sums the fit for any ω, z and D follows without going back to the data.
"""

from __future__ import annotations

import math
from functools import cache

import numpy as np
from numba import njit

from impedance_estimator.compilation import part

SHAPES = 3
"""Parameters of a shape: ln ω [ln rad/s], ln z [1], delay [s]."""
LOWEST_SHAPE = np.array([math.log(6.0), math.log(0.35), 0.020])
"""The slowest shape: reflexes of spastic muscles and the real trials come down to 8 rad/s. Nothing
returns from the spine earlier than after 20 ms."""
HIGHEST_SHAPE = np.array([math.log(45.0), math.log(2.0), 0.080])
"""The fastest and latest shape: long-latency responses begin at 60 to 80 ms."""
PRIOR_MEAN = np.array([math.log(20.0), math.log(0.85), 0.043])
"""Middle of what is reported: 21 rad/s, 0.8, 40 ms (van 't Veld et al. 2018); short-latency
delays of the calf are 35 to 50 ms.
"""
PRIOR_DEVIATION = np.array([0.5, 0.35, 0.008])
"""Wide: ω 7-54 rad/s and z 0.4-1.7 lie within two standard deviations.

It decides only while there is no data.
"""
BASIS = 12
"""Number of basis functions.

With 12 every shape of ω 15-30 rad/s, z 0.6-1.0 and D 35-55 ms is met to 0.03 % of its energy, ω 8
rad/s to 0.02 %.
"""
LENGTH = 0.8
"""Responses have this length [s]: the slowest (ω = 8 rad/s, z = 1) has 2 % of its area after it."""
_GRID = (16, 9, 16)


def shape(eta: np.ndarray, lags: np.ndarray) -> np.ndarray:
    """Return h(t; η) [1/s], each value the mean over the interval around its lag, shape (n,).

    The response begins with a kink. Its plain samples, summed, miss the area by up to (step ω)² /
    12; its means do not.

    Parameters
    ----------
    eta
        ln ω, ln z and the delay [s], shape (3,).
    lags
        Evenly spaced, shape (n,) [s].
    """
    out = np.empty(len(lags))
    _shape(eta, lags, out)
    return out


@part
def _step_response(w: float, z: float, t: float) -> float:
    """Return ∫₀ᵗ of the undelayed response [1]."""
    if t <= 0.0:
        return 0.0
    q = z * z - 1.0
    f = w * math.sqrt(abs(q))
    if f * t < 1e-4:
        return 1.0 - (1.0 + w * t) * math.exp(-z * w * t)
    if q < 0.0:
        return 1.0 - math.exp(-z * w * t) * (math.cos(f * t) + z * w / f * math.sin(f * t))
    slow, fast = z * w - f, z * w + f
    return 1.0 - 0.5 * (fast * math.exp(-slow * t) - slow * math.exp(-fast * t)) / f


@njit
def _shape(eta: np.ndarray, lags: np.ndarray, out: np.ndarray) -> None:
    w, z, delay = math.exp(eta[0]), math.exp(eta[1]), eta[2]
    step = lags[1] - lags[0]
    before = _step_response(w, z, lags[0] - 0.5 * step - delay)
    for k in range(lags.shape[0]):
        after = _step_response(w, z, lags[k] + 0.5 * step - delay)
        out[k] = (after - before) / step
        before = after


@cache
def _family(step: float) -> tuple[np.ndarray, np.ndarray]:
    """Shapes on a grid, (k, n), and their prior probabilities, (k,)."""
    lags = np.arange(round(LENGTH / step)) * step
    axes = [
        np.linspace(low, high, n)
        for low, high, n in zip(LOWEST_SHAPE, HIGHEST_SHAPE, _GRID, strict=True)
    ]
    etas = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, SHAPES)
    probabilities = np.exp(-0.5 * np.sum(((etas - PRIOR_MEAN) / PRIOR_DEVIATION) ** 2, axis=1))
    return np.array([shape(eta, lags) for eta in etas]), probabilities / probabilities.sum()


@cache
def _basis(step: float, size: int) -> np.ndarray:
    family, probabilities = _family(step)
    # A shape counts as much as it is probable, whatever its peak.
    family = family * (probabilities / np.linalg.norm(family, axis=1))[:, None]
    _, vectors = np.linalg.eigh(family.T @ family)
    return np.ascontiguousarray(vectors[:, : -size - 1 : -1].T)


def basis(step: float, size: int = BASIS) -> np.ndarray:
    """Return b_j(t), orthonormal, shape (size, n), at lags 0, step, ... [s]."""
    return _basis(step, size).copy()


@part
def _project(functions: np.ndarray, values: np.ndarray, coordinates: np.ndarray) -> None:
    for j in range(functions.shape[0]):
        total = 0.0
        for n in range(values.shape[0]):
            total += functions[j, n] * values[n]
        coordinates[j] = total


@part
def coordinates(
    eta: np.ndarray, functions: np.ndarray, lags: np.ndarray, work: np.ndarray, out: np.ndarray
) -> None:
    """Return c(η), shape (m,), without its derivatives; otherwise as `shape_coordinates`, with
    `work` of shape (n,).
    """
    _shape(eta, lags, work)
    _project(functions, work, out)


@part
def shape_coordinates(
    eta: np.ndarray,
    functions: np.ndarray,
    lags: np.ndarray,
    work: np.ndarray,
    coordinates: np.ndarray,
) -> None:
    """Return c(η) and its derivatives by ln ω, ln z and delay.

    Parameters
    ----------
    eta
        ln ω, ln z and the delay [s], shape (3,).
    functions
        Basis, shape (m, n).
    lags
        Lags of the response [s], shape (n,).
    work
        Shape (2, n), overwritten.
    coordinates
        Shape (m, 4), replaced: c, ∂c/∂ln ω, ∂c/∂ln z, ∂c/∂D [1/s].
    """
    _shape(eta, lags, work[0])
    _project(functions, work[0], coordinates[:, 0])
    for k in range(SHAPES):
        # Central differences: the error is 1e-6 of the derivative.
        change = 1e-3 if k < 2 else 1e-5
        kept = eta[k]
        eta[k] = kept + change
        _shape(eta, lags, work[0])
        eta[k] = kept - change
        _shape(eta, lags, work[1])
        eta[k] = kept
        for n in range(lags.shape[0]):
            work[0, n] = (work[0, n] - work[1, n]) / (2.0 * change)
        _project(functions, work[0], coordinates[:, 1 + k])
