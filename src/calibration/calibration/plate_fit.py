"""Plate and torque sensor, fitted to the torque that follows the reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ankle_physics.terms.footplate_friction import FootplateFriction
from ankle_physics.terms.torque_sensor_lag import TorqueSensorLag
from ankle_physics.terms.torque_sensor_mode import TorqueSensorMode
from calibration.errors import CalibrationError
from calibration.fitted_value import Found, solved, stacked_parts, standard_errors
from calibration.rig_spectra import RigSpectra

# A dry bearing's velocity that rounds the jump of its friction at rest.
FRICTION_VELOCITY = 0.03  # rad/s
# Where searches for lag, mode and servo begin.
LAG_STARTS = (0.0005, 0.003)  # s
MODE_STARTS = (20.0, 45.0, 80.0)  # Hz
MODE_DAMPING_START = 0.08
# Channels of one rig are hardly further apart.
LONGEST_DELAY = 0.02  # s
# Another rounding of the friction, a lag or a mode is the rig's where it takes away this share of
# what is left without it beyond noise.
MIN_CUT = 0.5
# A search that ends this close to an end of its range was still on its way.
RANGE_MARGIN = 0.01


@dataclass(frozen=True)
class PlateFit:
    """Holds plate and sensor: values by name, and the spectrum of the torque before the sensor."""

    shape: dict[str, Found]
    linear: dict[str, Found]
    load: np.ndarray
    vaf: float


# Which parameter of the library each shape of the sensor is.
_SENSOR = {
    "lag": TorqueSensorLag.parameter("T"),
    "mode": TorqueSensorMode.parameter("frequency"),
    "mode_damping": TorqueSensorMode.parameter("damping"),
}


def _is_seen(shape: dict[str, Found]) -> bool:
    """Say whether the recording shows this sensor, and not the end of a range.

    A mode far above the recorded band, or a lag of a tenth of a millisecond, looks like a part of
    the delay, and is one.
    """
    margin = 1.0 + RANGE_MARGIN
    return all(
        allowed.lower * margin < shape[name].value < allowed.upper / margin
        for name, allowed in _SENSOR.items()
        if name in shape
    )


Response = Callable[[np.ndarray, np.ndarray], np.ndarray]


def fit_plate(spectra: RigSpectra, motion: np.ndarray) -> PlateFit:
    """Return plate and sensor: the simplest description that holds.

    What no description holds (a bearing's friction has many shapes) lets a lag or a mode that the
    sensor has not take away some per cent of what is left, however surely. One that it has leaves
    the noise.

    Parameters
    ----------
    spectra
        Spectra of the recording.
    motion
        Spectrum of the position that follows the reference [rad].

    Raises
    ------
    CalibrationError
        The motion explains too little of the torque.
    """
    plain: Response = lambda s, p: np.ones(len(s), dtype=complex)  # noqa: E731
    lagged: Response = lambda s, p: 1.0 / (1.0 + s * p[1])  # noqa: E731

    def resonant(s: np.ndarray, p: np.ndarray) -> np.ndarray:
        ratio = s / (2.0 * np.pi * p[1])
        return 1.0 / (1.0 + 2.0 * p[2] * ratio + ratio**2)

    tried: list[tuple[tuple[str, ...], Response, list[list[float]]]] = []
    tried.append((("delay",), plain, [[0.0]]))
    tried.append((("delay", "lag"), lagged, [[0.0, start] for start in LAG_STARTS]))
    modes = [[0.0, start, MODE_DAMPING_START] for start in MODE_STARTS]
    tried.append((("delay", "mode", "mode_damping"), resonant, modes))
    best: tuple[float, PlateFit] | None = None
    rounding, columns = _rounded_friction(spectra, motion)
    for names, response, starts in tried:
        left, fit = _fitted(spectra, columns, names, response, starts)
        if not _is_seen(fit.shape):
            continue
        if best is None or _is_cut(spectra, best[0], left):
            best = left, fit
    assert best is not None
    if not best[1].vaf > 50.0:
        raise CalibrationError(
            f"the plate's motion explains {best[1].vaf:.0f} % of the torque that follows the "
            "reference; check sign, units and mounting of the torque sensor"
        )
    best[1].shape["friction_velocity"] = rounding
    return best[1]


def _is_cut(spectra: RigSpectra, before: float, after: float) -> bool:
    """Say whether a further value takes away `MIN_CUT` of what noise does not leave anyway: a mode
    with little damping leaves less than the noise of all frequencies together, and triples the
    torque at its own.
    """
    noise = spectra.torque_noise
    return after - noise < (1.0 - MIN_CUT) * (before - noise)


def _rounded_friction(
    spectra: RigSpectra, motion: np.ndarray
) -> tuple[Found, dict[str, np.ndarray]]:
    """Return the velocity [rad/s] that rounds the jump of dry friction, and the plate's columns.

    Greased bearings and seals slip gradually. Taken for dry friction they look like a torque that
    comes early through a sensor that lags.
    """
    velocity = spectra.time_signal(motion * spectra.omega)
    columns = {
        "inertia": motion * spectra.omega**2,
        "slope": motion,
        "friction": spectra.spectrum(np.tanh(velocity / FRICTION_VELOCITY)),
        "viscosity": motion * spectra.omega,
    }
    goal, rest = stacked_parts(spectra.torque), np.column_stack(list(columns.values()))

    def left(shape: np.ndarray) -> np.ndarray:
        delay, rounding = shape
        rest[:, 2] = spectra.spectrum(np.tanh(velocity / rounding))
        regressors = stacked_parts(np.exp(-spectra.omega * delay)[:, None] * rest)
        regressors /= np.linalg.norm(regressors, axis=0)
        return goal - regressors @ solved(regressors, goal)

    allowed = FootplateFriction.parameter("v0")
    found = least_squares(
        left,
        [0.0, FRICTION_VELOCITY],
        bounds=([-LONGEST_DELAY, allowed.lower], [LONGEST_DELAY, allowed.upper]),
        x_scale=[1e-4, FRICTION_VELOCITY],
    )
    dry = least_squares(
        lambda delay: left(np.array([delay[0], FRICTION_VELOCITY])), [0.0], x_scale=[1e-4]
    )
    if not _is_cut(spectra, 2.0 * dry.cost, 2.0 * found.cost):  # costs are halves
        return Found(FRICTION_VELOCITY, 0.0), columns
    rounding = float(found.x[1])
    columns["friction"] = spectra.spectrum(np.tanh(velocity / rounding))
    return Found(rounding, float(standard_errors(found.jac, found.fun, spectra.frequency)[1])), (
        columns
    )


def _fitted(
    spectra: RigSpectra,
    columns: dict[str, np.ndarray],
    names: tuple[str, ...],
    response: Response,
    starts: list[list[float]],
) -> tuple[float, PlateFit]:
    """Return separable least squares: the linear values are solved for within."""
    stacked = np.column_stack(list(columns.values()))
    scale = np.linalg.norm(stacked, axis=0)
    goal = stacked_parts(spectra.torque)

    def design(shape: np.ndarray) -> np.ndarray:
        sensed = response(spectra.omega, shape) * np.exp(-spectra.omega * shape[0])
        return stacked_parts(sensed[:, None] * stacked / scale)

    def left(shape: np.ndarray) -> np.ndarray:
        regressors = design(shape)
        return goal - regressors @ solved(regressors, goal)

    lower = {"delay": -LONGEST_DELAY, "lag": 1e-5, "mode": 5.0, "mode_damping": 0.003}
    upper = {"delay": LONGEST_DELAY, "lag": 0.05, "mode": 300.0, "mode_damping": 1.5}
    found = min(
        (
            least_squares(
                left,
                start,
                bounds=([lower[k] for k in names], [upper[k] for k in names]),
                x_scale=[{"delay": 1e-4, "lag": 1e-3, "mode": 5.0}.get(k, 0.05) for k in names],
            )
            for start in starts
        ),
        key=lambda each: each.cost,
    )
    regressors = design(found.x)
    linear = solved(regressors, goal)
    residual = goal - regressors @ linear
    # Of all parameters together, so that the errors know of each other.
    slopes = np.column_stack([found.jac, -regressors])
    errors = standard_errors(slopes, residual, spectra.frequency)
    shape = {
        name: Found(float(value), float(error))
        for name, value, error in zip(names, found.x, errors, strict=False)
    }
    values = {
        name: Found(float(value / size), float(error / size))
        for name, value, error, size in zip(
            columns, linear, errors[len(names) :], scale, strict=True
        )
    }
    predicted = regressors @ linear
    # Of what follows the motion at all; the sensor's noise is nobody's to explain.
    lines = len(goal) // 2
    complex_prediction = predicted[:lines] + 1j * predicted[lines:]
    followed = spectra.following(spectra.torque, complex_prediction)
    missing = float(np.sum(np.abs(followed - complex_prediction) ** 2))
    vaf = 100.0 * (1.0 - missing / float(np.sum(np.abs(followed) ** 2)))
    return float(residual @ residual), PlateFit(shape, values, stacked @ (linear / scale), vaf)
