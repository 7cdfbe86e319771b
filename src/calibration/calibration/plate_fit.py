"""Friction and weight of a plate, fitted to the torque that follows the reference."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from calibration.errors import CalibrationError
from calibration.fitted_value import Found, solved, stacked_parts, standard_errors
from calibration.friction_course import Friction
from calibration.rig_spectra import RigSpectra
from calibration.sensor_fit import SensorFit

# Where searches for the friction's v0 [rad/s] and relaxation time [s] begin: a dry bearing that
# creeps to rest, and seals.
FRICTION_STARTS = ((0.003, 0.05), (0.1, 0.005))
FRICTION_RANGES = ((0.002, 1.0), (0.002, 10.0))
FRICTION_SCALE = 0.3  # of their logarithms
# A torque sensor whose sign, unit or mounting is wrong leaves more.
LEAST_VAF = 50.0  # %


@dataclass(frozen=True)
class PlateFit:
    """Holds friction and weight of a plate.

    Attributes
    ----------
    friction, friction_velocity
        Dry friction [N.m], and the velocity [rad/s] that rounds its jump at rest.
    slope
        Torque per angle [N.m/rad].
    vaf
        Of the torque that follows the motion [%].
    course
        Of the friction.
    """

    friction: Found
    friction_velocity: Found
    slope: Found
    vaf: float
    course: Friction


def fit_plate(spectra: RigSpectra, motion: np.ndarray, sensor: SensorFit) -> PlateFit:
    """Return friction and weight, by separable least squares.

    Parameters
    ----------
    spectra
        Spectra of the recording.
    motion
        Spectrum of the position [rad].
    sensor
        Torque sensor and inertia, which are taken as known.

    Raises
    ------
    CalibrationError
        The motion explains too little of the torque.
    """
    sensed = sensor.response
    inertia = sensor.inertia.value * sensed * motion * spectra.omega**2
    goal = stacked_parts(spectra.torque - inertia)
    velocity = spectra.time_signal(motion * spectra.omega)
    columns = np.column_stack([motion, np.zeros_like(motion), motion * spectra.omega])

    def torques(values: np.ndarray) -> np.ndarray:
        """Return the spectra of slope, friction and viscosity per unit, shape (lines, 3)."""
        course = Friction(*np.exp(values)).course(velocity, spectra.rate)
        columns[:, 1] = spectra.spectrum(course)
        return sensed[:, None] * columns

    def left(values: np.ndarray) -> np.ndarray:
        design = stacked_parts(torques(values))
        design /= np.linalg.norm(design, axis=0)
        return goal - design @ solved(design, goal)

    lower, upper = np.log(FRICTION_RANGES).T
    found = min(
        (
            least_squares(left, np.log(start), bounds=(lower, upper), x_scale=FRICTION_SCALE)
            for start in FRICTION_STARTS
        ),
        key=lambda each: each.cost,
    )
    torque = torques(found.x)
    design = stacked_parts(torque)
    scale = np.linalg.norm(design, axis=0)
    linear = solved(design / scale, goal) / scale
    # Of all parameters together, so that the errors know of each other.
    slopes = np.column_stack([found.jac, -design / scale])
    errors = standard_errors(slopes, found.fun, spectra.frequency)
    course = Friction(*np.exp(found.x).tolist())
    rounding = Found(course.rounding, course.rounding * float(errors[0]))
    slope, friction, _ = (
        Found(float(value), float(error / size))
        for value, error, size in zip(linear, errors[2:], scale, strict=True)
    )
    predicted = inertia + torque @ linear
    # Of what follows the motion at all; the sensor's noise is nobody's to explain.
    followed = spectra.following(spectra.torque, predicted)
    missing = float(np.sum(np.abs(followed - predicted) ** 2))
    vaf = 100.0 * (1.0 - missing / float(np.sum(np.abs(followed) ** 2)))
    if not vaf > LEAST_VAF:
        raise CalibrationError(
            f"the plate's motion explains {vaf:.0f} % of the torque that follows the "
            "reference; check sign, units and mounting of the torque sensor"
        )
    return PlateFit(friction, rounding, slope, vaf, course)
