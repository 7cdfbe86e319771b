"""The torque that the muscles hold, where no EMG tells.

It is what the base model leaves of the torque, below a cut-off. A joint whose stiffness follows
that torque, by ``ka`` for each newton metre, shows ``w = 1 + ka * (x - xc)`` of it at the angle x.
Where ka is large, as in a joint whose muscles contract together, the movement makes more slow
torque than the muscles do. The course that fits best, ``sum(w * left) / sum(w ** 2)`` over a window
about each moment, gives a better ka, and so on: alternating least squares. Where the plate moves
all the time, the window leaves the moment itself out: a reflex that varies would else seem to
follow the slow torque that it makes.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ankle_physics.term import term_library
from model_discrepancy.fit.columns import Columns
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.least_squares import bounded, orthonormal
from model_discrepancy.fit.preceding_torque import (
    LEAST_POWER,
    begins_from_rest,
    is_continuous,
    preceding_torque,
)
from model_discrepancy.fit.response_sizes import without_response_sizes
from model_discrepancy.fit.rows import Rows
from model_discrepancy.recording.motion import ACTIVATION_HZ, Motion

# Three give the last digit where the stiffness follows torque, one where it does not.
ROUNDS = 4
# Of the whitened residual, that the stiffness takes off. What gains less is no better course.
LEAST_IMPROVEMENT = 0.005
# Share of the movements that begin from rest, above which responses lie apart. In a binary sequence
# half or three quarters do, and the responses of the others made a joint of constant stiffness seem
# to follow torque.
LEAST_RESTED = 0.9
# The torque of a moment holds responses to movements of the last 0.3 s, and these end 0.3 s later.
BESIDE_GUARD_S = 0.35
# On either side. Windows of 0.4 and 1 s tell the same.
BESIDE_WINDOW_S = 0.6


def shown_share(position: np.ndarray, follows: float, centre: float) -> np.ndarray:
    """Return the share w of the muscles' torque that a joint shows [1], shape (n,).

    Parameters
    ----------
    position
        [rad], shape (n,).
    follows
        By how much the stiffness grows for each newton metre, ka [1/rad].
    centre
        The angle about which it acts, xc [rad].
    """
    return np.asarray(1.0 + follows * (position - centre))


def slow_torque(rows: Rows, left: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Return the slow torque of which so much is shown at each moment.

    Parameters
    ----------
    rows
        Of the recording.
    left
        What the base model leaves of the torque [N.m], shape (n,), at the columns' rate.
    shown
        Share of the torque that the joint shows [1], shape (n,).

    Returns
    -------
    np.ndarray
        [N.m], shape (n,).
    """
    power = shown**2
    mean = float(np.mean(power))
    slow = mean + rows.slow(rows.spectrum(power), ACTIVATION_HZ)
    weighted = left * shown
    return np.asarray(
        (float(np.mean(weighted)) + rows.slow(rows.spectrum(weighted), ACTIVATION_HZ))
        / np.maximum(slow, LEAST_POWER * mean)
    )


def torque_beside(rate: float, left: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Return the torque that the muscles hold before and after each moment, without what they do
    then: `BESIDE_GUARD_S` away from it and more [N.m], shape (n,).

    Parameters
    ----------
    rate
        Of the samples [Hz].
    left, shown
        As for `slow_torque`.
    """
    far, near = (round(s * rate) for s in (BESIDE_GUARD_S + BESIDE_WINDOW_S, BESIDE_GUARD_S))
    moment = np.arange(len(left))

    def beside(signal: np.ndarray) -> np.ndarray:
        summed = np.concatenate([[0.0], np.cumsum(signal)])
        ends = (moment - near, moment + far), (moment - far, moment + near)
        last, first = (np.clip(both, 0, len(left)) for both in ends)
        return np.asarray(np.sum(summed[last] - summed[first], axis=0))

    power = beside(shown**2)
    return beside(left * shown) / np.maximum(power, LEAST_POWER * np.mean(power))


def held_torque(columns: Columns, left: np.ndarray, shown: np.ndarray) -> np.ndarray:
    """Return the torque that the muscles hold about each moment [N.m], shape (n,).

    Parameters
    ----------
    columns
        Of the recording.
    left, shown
        As for `slow_torque`.
    """
    if is_continuous(columns):
        return torque_beside(columns.motion.rate, left, shown)
    return slow_torque(columns.rows, left, shown)


def following(fitter: Fitter, fit: Fit) -> tuple[Motion, float]:
    """Return the motion with the torque that the muscles hold, and what they held before each
    movement; and the share of the whitened residual that this course gains beyond the present one,
    where the stiffness follows it.

    Parameters
    ----------
    fitter
        Whitened by the recording's noise.
    fit
        The model so far. What its terms explain that follow torque themselves counts as left.

    Returns
    -------
    tuple[Motion, float]
        The motion with ``activation`` and ``preceding`` [N.m], each of shape (n,), and the share of
        the whitened residual, 0...1; negative where the present course is better.
    """
    motion, rows = fitter.motion, fitter.rows
    fit = fitter.evaluate(
        {name: v for name, v in fit.values.items() if not term_library()[name].follows_torque}
    )
    columns, mean = fitter.columns, float(np.mean(motion.torque))
    left = rows.torque(fit.left)
    basis = orthonormal(fitter.derivatives(fit)[0][rows.used])
    centre = float(motion.position.mean())
    shown = np.ones(len(left))
    held, gained, ka = held_torque(columns, left, shown), -np.inf, 0.0
    for _ in range(ROUNDS):
        next_shown = shown_share(motion.position, ka, centre)
        course = held_torque(columns, left, next_shown)
        ka, gain = _stiffness_that_follows(fitter, fit, course, basis)
        if gain < gained + LEAST_IMPROVEMENT:
            break
        held, shown, gained = course, next_shown, gain
    _, known = _stiffness_that_follows(fitter, fit, motion.activation - mean, basis)
    restless = not begins_from_rest(columns)
    # Just before a movement that follows another one closely, the response to that one, which
    # varies, is under way, and it lasts on.
    overlap = not begins_from_rest(columns, LEAST_RESTED)
    steady = without_response_sizes(columns, fit.values, left) if overlap else left
    continuous = is_continuous(columns)
    better = replace(
        motion,
        activation=mean + held,
        preceding=mean + held if continuous else preceding_torque(columns, steady, shown),
        restless=restless,
        continuous=continuous,
    )
    return better, gained - known


def _stiffness_that_follows(
    fitter: Fitter, fit: Fit, held: np.ndarray, basis: np.ndarray
) -> tuple[float, float]:
    """Return by how much the stiffness follows a course of torque [1/rad], and the share of the
    whitened residual that it takes off.

    Parameters
    ----------
    fitter, fit
        As `following` takes them.
    held
        Torque about its mean [N.m], shape (n,).
    basis
        What the model imitates, orthonormal, shape (rows that are used, p).
    """
    rows, motion = fitter.rows, fitter.motion
    away = motion.position - motion.position.mean()
    columns = [rows.whitened(rows.spectrum(held * s))[rows.used] for s in (away, motion.velocity)]
    matrix = np.column_stack(columns)
    matrix = matrix - basis @ (basis.T @ matrix)
    ranges = [term_library()["activation_stiffness"].parameter(symbol) for symbol in ("ka", "ba")]
    lower, upper = (np.array([getattr(p, end) for p in ranges]) for end in ("lower", "upper"))
    residual = fit.residual[rows.used]
    residual = residual - basis @ (basis.T @ residual)
    amplitudes = bounded(matrix, residual, lower, upper)
    left = residual - matrix @ amplitudes
    return float(amplitudes[0]), 1.0 - float(left @ left) / float(residual @ residual)
