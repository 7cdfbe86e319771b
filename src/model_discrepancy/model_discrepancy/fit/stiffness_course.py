"""The course of the stiffness that a model does not explain, from what each piece of a recording
shows of it.

Over a piece i of a fifth of a second the whitened residual r shows a change of stiffness
``y_i = sum(c r) / sum(c ** 2)``, c the torque of a unit of stiffness, with a variance
``s ** 2 / sum(c ** 2)``. The changes are taken for a process of first order (Gauss-Markov), whose
spread and correlation time are those of the largest likelihood. What stands for piece i follows
from all other pieces, but for its neighbours (a Kalman filter from either end): the noise of a
piece has no part in its own course, so that what the course explains is no overfit, and vanishes in
a recording whose stiffness is constant.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from ankle_physics.term import term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.least_squares import orthonormal

COCONTRACTION = "cocontraction"
# Short against a contraction, which takes a second and more, long against the whitening filter.
PIECE_S = 0.2
# A course needs neighbours from which it follows.
FEWEST_PIECES = 40
# Correlation times that are tried: from the quickest contraction to a slow drift.
TIMES_S = (1.0, 2.0, 4.0, 8.0, 16.0, 40.0)
# Spreads that are tried, as shares of the root mean square of what the pieces show.
SPREADS = (0.05, 0.1, 0.2, 0.4, 0.8)


def courses_of_stiffness() -> frozenset[str]:
    """Return the names of the terms that change the stiffness in the course of a recording: the
    torque of each is a stiffness, other at each time, times the angle from its ``xc``.
    """
    return frozenset((COCONTRACTION, *term_library()[COCONTRACTION].generalises))


def stiffness_course(fitter: Fitter, fit: Fit) -> np.ndarray | None:
    """Return the course of the stiffness that a model does not explain.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    fit
        The model so far. What its terms explain that change the stiffness in the course of the
        recording counts as not explained.

    Returns
    -------
    np.ndarray | None
        Of mean 0 and root mean square 1 [1], shape (n,), at the columns' rate; None where the model
        has no stiffness, the recording is short, or the course of no piece follows from the others.
    """
    known = _without_courses(fitter, fit)
    return None if known is None else _course(fitter, known)


def _course(fitter: Fitter, known: Fit) -> np.ndarray | None:
    """Return what `stiffness_course` does, of a model without terms that change its stiffness."""
    rows = fitter.rows
    spectra = fitter.columns.spectra(known.values)
    own = np.where(rows.used, rows.whitened(spectra["stiffness", "K"]), 0.0)
    left = np.where(rows.used, known.residual, 0.0)
    length = int(PIECE_S * rows.rate)
    count = rows.count // length
    if count < FEWEST_PIECES:
        return None

    def pieces(signal: np.ndarray) -> np.ndarray:
        return signal[: count * length].reshape(count, length)

    unit = pieces(own)
    if ("reflex", "G") in spectra:
        # A reflex that varies is no stiffness that does.
        reflex = pieces(rows.whitened(spectra["reflex", "G"]))
        share = np.sum(reflex * unit, axis=1) / np.maximum(np.sum(reflex**2, axis=1), 1e-30)
        unit = unit - share[:, None] * reflex
    power = np.sum(unit**2, axis=1)
    level = float(np.mean(left[rows.used] ** 2))
    if not power.any() or level <= 0.0:
        return None
    change = predicted(np.sum(unit * pieces(left), axis=1), power, level)
    row = np.repeat(change, length)
    if float(row @ (own * left)[: len(row)]) <= 0.0:
        return None
    place = np.minimum((fitter.motion.time / PIECE_S).astype(int), count - 1)
    course = change[place] - np.mean(change[place])
    return np.asarray(course / np.sqrt(np.mean(course**2)))


def better_course(fitter: Fitter, fit: Fit) -> tuple[np.ndarray | None, float]:
    """Return the course of the stiffness as it is known beside a model, and the share of the
    whitened residual that it gains beyond the present course.

    Parameters
    ----------
    fitter, fit
        As for `stiffness_course`.

    Returns
    -------
    tuple[np.ndarray | None, float]
        The course as `stiffness_course` returns it, and the share, -1...1; None and 0 where there
        is no course.
    """
    known = _without_courses(fitter, fit)
    course = None if known is None else _course(fitter, known)
    if course is None or known is None:
        return None, 0.0
    rows, motion = fitter.rows, fitter.motion
    basis = orthonormal(fitter.derivatives(known)[0][rows.used])
    left = known.residual[rows.used]
    left = left - basis @ (basis.T @ left)

    def gain(of: np.ndarray | None) -> float:
        if of is None:
            return 0.0
        torque = of * (motion.position - motion.position.mean())
        column = rows.whitened(rows.spectrum(torque))[rows.used]
        column = column - basis @ (basis.T @ column)
        return max(float(column @ left), 0.0) ** 2 / float(column @ column) / float(left @ left)

    return course, gain(course) - gain(motion.cocontraction)


def _without_courses(fitter: Fitter, fit: Fit) -> Fit | None:
    """Return a model without the terms that change its stiffness in the course of a recording; None
    where it has no stiffness.
    """
    courses = courses_of_stiffness()
    kept = {name: values for name, values in fit.values.items() if name not in courses}
    return fitter.evaluate(kept) if "stiffness" in kept else None


def predicted(shown: np.ndarray, power: np.ndarray, level: float) -> np.ndarray:
    """Return what the other pieces tell of each one's change [N.m/rad], shape (n,).

    Parameters
    ----------
    shown
        Sum of the products of regressor [rad] and residual [N.m] of each piece, shape (n,); both
        whitened.
    power
        Sum of squares of the regressor of each piece [rad^2], shape (n,).
    level
        Power of the noise [N^2.m^2].
    """
    information = power / level
    seen = shown / level
    scale = float(np.sqrt(np.sum(seen**2 / np.maximum(information, 1e-30)) / np.sum(information)))
    times, spreads = np.array(list(product(TIMES_S, SPREADS))).T
    variance = (scale * spreads) ** 2
    step = np.exp(-PIECE_S / times)
    likelihood = _filtered(seen, information, variance, step)[2]
    best = slice(int(np.argmax(likelihood)), int(np.argmax(likelihood)) + 1)
    variance, step = variance[best], step[best]
    before, before_variance, _ = _filtered(seen, information, variance, step)
    after, after_variance, _ = (
        found[::-1] for found in _filtered(seen[::-1], information[::-1], variance, step)
    )
    precision = 1.0 / before_variance + 1.0 / after_variance - 1.0 / variance
    told = (before / before_variance + after / after_variance) / precision
    return np.asarray(told[:, 0])


def _filtered(
    seen: np.ndarray, information: np.ndarray, variance: np.ndarray, step: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return mean and variance of each piece's change by those before its neighbour, each of shape
    (n, processes), and the logarithm of each process's likelihood.
    """
    size = (len(seen), len(variance))
    means, variances = np.zeros(size), np.tile(variance, (len(seen), 1))
    mean: np.ndarray = np.zeros(len(variance))
    spread: np.ndarray = variance.copy()
    likelihood = np.zeros(len(variance))
    for k, (z, weight) in enumerate(zip(seen, information, strict=True)):
        if k:
            mean, spread = step * mean, step**2 * spread + (1.0 - step**2) * variance
        # Of y = z / weight with the variance 1 / weight, but for what no process changes.
        innovation, whole = z - weight * mean, 1.0 + weight * spread
        likelihood += 0.5 * spread * innovation**2 / whole - 0.5 * np.log(whole)
        likelihood += z * mean - 0.5 * weight * mean**2
        mean, spread = mean + spread * innovation / whole, spread / whole
        if k + 2 < len(seen):
            means[k + 2] = step**2 * mean
            variances[k + 2] = step**4 * spread + (1.0 - step**4) * variance
    return means, variances, likelihood
