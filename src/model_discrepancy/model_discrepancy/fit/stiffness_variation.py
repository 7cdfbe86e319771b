"""How much the stiffness varies in the course of a recording, and from one movement to the next,
from the residual of a fit.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import toeplitz
from scipy.signal import correlate

from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.movements import find_onsets
from model_discrepancy.fit.reflex_variation import (
    ReflexVariation,
    moved_from_rest,
    spread_beyond_noise,
)

# Muscles that stiffen after a startle, or let go, begin 80 to 120 ms after the movement and do so
# for a quarter of a second (Brown et al., Brain 114 (1991) 1891).
_BEGIN_S, _LENGTH_S = 0.1, 0.26
# The whitening filter's answer to the end of it.
_TAIL_S = 0.05
_FEWEST_MOVEMENTS = 20
# Pieces of the recording that are shorter follow any such change.
_PIECE_S = 0.1
_FEWEST_PIECES = 50


def stiffness_variation(
    fitter: Fitter, fit: Fit, reflex: ReflexVariation, mean: float
) -> tuple[float, float] | None:
    """Return the standard deviation of the stiffness over short pieces of a recording, beyond what
    noise makes, as a share of its mean, with its standard error.

    Parameters
    ----------
    fitter, fit
        A model with stiffness, and its residual.
    reflex
        How its reflex varies. Where responses overlap, what that leaves is not known well enough.
    mean
        Stiffness of the base model [N.m/rad]: beside terms that act like a spring a model's own may
        be next to nothing.

    Returns
    -------
    tuple or None
        None where responses overlap, and without stiffness.
    """
    if not _is_known(fit, reflex, mean):
        return None
    rows = fitter.rows
    spectrum = fitter.columns.spectra(fit.values)[("stiffness", "K")]
    torque = rows.whitened(mean * spectrum)
    length = int(_PIECE_S * rows.rate)
    kept = rows.count // length * length
    # The reflex of an earlier movement, which varies, would count as a stiffness that does.
    single = rows.used & moved_from_rest(fitter)
    whole = single[:kept].reshape(-1, length).all(axis=1)
    own, left = (signal[:kept].reshape(-1, length)[whole] for signal in (torque, reflex.residual))
    power = np.sum(own**2, axis=1)
    if np.count_nonzero(power) < _FEWEST_PIECES:
        return None
    own, left, power = own[power > 0.0], left[power > 0.0], power[power > 0.0]
    size = np.sum(own * left, axis=1) / power
    return _spread(size, power, _noise_along(own, reflex.residual[rows.used]))


def _is_known(fit: Fit, reflex: ReflexVariation, mean: float) -> bool:
    """Say whether what a varying reflex leaves is known well enough, and there is stiffness."""
    return reflex.apart and mean > 0.0 and "stiffness" in fit.values


def _spread(size: np.ndarray, power: np.ndarray, noise: float) -> tuple[float, float] | None:
    """Return the spread of sizes about their mean beyond what noise makes."""
    return spread_beyond_noise(size - np.average(size, weights=power), power, noise)


def _without_largest(size: np.ndarray, power: np.ndarray) -> np.ndarray:
    """Return which sizes count, bool, shape (n,): all but the one that deviates most."""
    deviation = power * (size - np.average(size, weights=power)) ** 2
    return np.arange(len(size)) != np.argmax(deviation)


def _noise_along(own: np.ndarray, residual: np.ndarray) -> float:
    """Return the mean power of the noise along given shapes, or that of single rows where it is
    larger.

    The rows reach beyond the frequencies of the fit, and slow torque is whitened roughly only:
    successive rows are alike, and noise along a short smooth shape is more than that of a single
    row. Along a longer one it seems to be less; but what a varying reflex leaves comes after
    movements, as the shape does.

    Parameters
    ----------
    own
        The shapes, shape (k, length).
    residual
        What a model leaves, shape (n,).
    """
    length = own.shape[1]
    lags = correlate(residual, residual, method="fft")[len(residual) - 1 :][:length] / len(residual)
    along = np.einsum("kl,lm,km->k", own, toeplitz(lags), own)
    return max(float(np.mean(along / np.sum(own**2, axis=1))), float(lags[0]))


def stiffness_after_movements(
    fitter: Fitter, fit: Fit, reflex: ReflexVariation, mean: float
) -> tuple[float, float] | None:
    """Return the standard deviation of the stiffness from one movement to the next, a tenth to a
    third of a second after each, beyond what noise makes, as a share of its mean, with its standard
    error.

    Within that time the stiffness is taken to rise and fall like a squared sine. Where the joint is
    held away from its mean angle, that changes the torque as much as during the movement.

    Parameters
    ----------
    fitter, fit, reflex, mean
        As for `stiffness_variation`.

    Returns
    -------
    tuple or None
        None where responses overlap, where movements are few, and without stiffness.
    """
    if not _is_known(fit, reflex, mean):
        return None
    rows = fitter.rows
    onsets = _apart(find_onsets(fitter.columns).time)
    single = rows.used & moved_from_rest(fitter)
    torque = rows.whitened(rows.spectrum(mean * _angle_after(fitter.columns, onsets)))
    size, power, shapes = [], [], []
    for begin in onsets + _BEGIN_S:
        first, last = int(begin * rows.rate), int((begin + _LENGTH_S + _TAIL_S) * rows.rate)
        own, left = torque[first:last], reflex.residual[first:last]
        if last <= rows.count and single[first:last].all() and (known := float(own @ own)) > 0.0:
            size.append(float(own @ left) / known)
            power.append(known)
            shapes.append(own)
    if len(size) < _FEWEST_MOVEMENTS:
        return None
    length = min(len(own) for own in shapes)
    noise = _noise_along(np.array([own[:length] for own in shapes]), reflex.residual[rows.used])
    # One movement is no variation: startles come with every third. Next to the mean angle a torque
    # that differed once made 94 % of the variation in a recording without a mismatch.
    sizes, powers = np.array(size), np.array(power)
    kept = _without_largest(sizes, powers)
    return _spread(sizes[kept], powers[kept], noise)


def _apart(onsets: np.ndarray) -> np.ndarray:
    """Return the times of movements [s] of which none begins while the time after another lasts."""
    far = np.diff(onsets, append=np.inf) > _LENGTH_S + _TAIL_S
    return onsets[far]


def _angle_after(columns: Columns, onsets: np.ndarray) -> np.ndarray:
    """Return the angle from its mean [rad], times a squared sine after each of these times [s],
    shape (n,).
    """
    motion = columns.motion
    shape = np.zeros(len(motion.position))
    rise = np.sin(np.pi * np.arange(int(_LENGTH_S * motion.rate)) / (_LENGTH_S * motion.rate)) ** 2
    for first in np.round((onsets + _BEGIN_S) * motion.rate).astype(int):
        shape[first : first + len(rise)] = rise[: max(len(shape) - first, 0)]
    return shape * (motion.position - columns.mean_angle)
