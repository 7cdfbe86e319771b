"""The position servo, fitted to the motion that follows the reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from calibration.fitted_value import Found, stacked_parts, standard_errors
from calibration.rig_spectra import RigSpectra

# A sag is stated where its relative standard error is at most this; else a load is needed. On the
# independent rig an empty plate of more gave 11 and 41 % too much, and one of less 1 %.
SAG_ACCURACY = 0.02
# Of the stiffness: by so much (rms) it was off on 30 rigs of an independent engine, whatever the
# scatter. A servo of second order with a delay is not quite the rig's.
SERVO_EQUATION_SHARE = 7e-4
SERVO_STARTS = (15.0, 30.0, 60.0)  # Hz


@dataclass(frozen=True)
class ServoFit:
    """Holds the servo, and the spectrum of the motion that it makes."""

    bandwidth: Found
    damping: Found
    stiffness: Found | None
    motion: np.ndarray


def fit_servo(spectra: RigSpectra, load: np.ndarray) -> ServoFit:
    """Return the second-order servo with a delay, and how far the spectrum of a load [N.m] moves
    it.
    """
    goal = stacked_parts(spectra.position)

    def response(shape: np.ndarray) -> np.ndarray:
        ratio = spectra.omega / (2.0 * np.pi * shape[0])
        second = 1.0 / (1.0 + 2.0 * shape[1] * ratio + ratio**2)
        return second * np.exp(-spectra.omega * shape[2])

    def left(shape: np.ndarray) -> np.ndarray:
        return goal - stacked_parts(response(shape) * (spectra.reference - shape[3] * load))

    scale = [5.0, 0.1, 1e-3, 1e-4]
    bounds = ([1.0, 0.05, -0.005, -0.01], [400.0, 5.0, 0.05, 0.02])
    found = min(
        (
            least_squares(left, [start, 0.7, 0.0, 0.0], bounds=bounds, x_scale=scale)
            for start in SERVO_STARTS
        ),
        key=lambda each: each.cost,
    )
    errors = standard_errors(found.jac, found.fun, spectra.frequency)
    sag = float(found.x[3])
    stiffness = None
    if sag > 0.0 and errors[3] <= SAG_ACCURACY * sag:
        error = float(np.hypot(errors[3] / sag, SERVO_EQUATION_SHARE))
        stiffness = Found(1.0 / sag, error / sag)
    return ServoFit(
        Found(float(found.x[0]), float(errors[0])),
        Found(float(found.x[1]), float(errors[1])),
        stiffness,
        response(found.x) * (spectra.reference - sag * load),
    )
