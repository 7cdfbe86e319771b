"""The error of the measured angle, as far as a model holds it and a recording shows it."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ankle_physics.signals import Signals
from ankle_physics.term import term_library
from model_discrepancy.fit.fit_result import Fit
from model_discrepancy.fit.fitter import Fitter
from model_discrepancy.fit.signal_path import Column

TERMS = ("cyclic_angle_error", "uneven_angle")
"""Terms that change the angle by an amount that depends on the angle alone."""
# A curve of 13 knots needs a few points for each.
_POINTS = 121


def angle_error(values: Mapping[str, Mapping[str, float]], angles: np.ndarray) -> np.ndarray:
    """Return the plate's angle less the measured one, without its straight line [rad], shape (n,).

    A recording tells no offset and no slope of the error: they would be a zero and a gain.

    Parameters
    ----------
    values
        Of a model, by term and symbol.
    angles
        Measured ones [rad], shape (n,).
    """
    still = np.zeros_like(angles)
    signals = Signals(1.0, angles, still, still)
    for name in (name for name in values if name in TERMS):
        term = term_library()[name]()
        term.transform(signals, values[name], term.start(signals.rate))
    error = signals.position - angles
    return error - np.polyval(np.polyfit(angles, error, 1), angles)


def angle_curve(fitter: Fitter, fit: Fit) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the angles that a recording covers, the error there and its standard error [rad], each
    of shape (n,).

    Parameters
    ----------
    fitter
        Of the recording.
    fit
        With its draws (`Fitter.with_errors`); the standard error is 0 without them.
    """
    middle, half = fitter.columns.mean_angle, 0.5 * fitter.columns.angle_span
    angles = np.linspace(middle - half, middle + half, _POINTS)
    here = angle_error(fit.values, angles)
    slopes: dict[Column, np.ndarray | float] = {}
    for name, symbol in fit.draws:
        if name in TERMS:
            size = fit.errors[name][symbol]
            moved = {n: dict(given) for n, given in fit.values.items()}
            moved[name][symbol] += size
            slopes[name, symbol] = (angle_error(moved, angles) - here) / size
    return angles, here, fit.error_of(slopes) if slopes else np.zeros_like(angles)
