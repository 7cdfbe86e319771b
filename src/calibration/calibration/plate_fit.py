"""Plate and torque sensor, fitted to the torque that follows the reference."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.optimize import least_squares

from ankle_physics.terms.torque_sensor_lag import TorqueSensorLag
from ankle_physics.terms.torque_sensor_mode import TorqueSensorMode
from calibration.errors import CalibrationError
from calibration.fitted_value import Found, solved, stacked_parts, standard_errors
from calibration.rig_spectra import RigSpectra

# Where searches for the friction's v0 [rad/s] and relaxation time [s] begin: a dry bearing that
# creeps to rest, and seals.
FRICTION_STARTS = ((0.003, 0.05), (0.1, 0.005))
FRICTION_RANGES = ((0.002, 1.0), (0.002, 10.0))
# Below, the measured velocity is noise, and the plate rests; a slow sweep has 0.03 rad/s.
RESTING_VELOCITY = 0.008  # rad/s
# Where searches for lag, mode and servo begin.
LAG_STARTS = (0.0005, 0.003)  # s
MODE_STARTS = (20.0, 45.0, 80.0)  # Hz
MODE_DAMPING_START = 0.08
# Channels of one rig are hardly further apart.
LONGEST_DELAY = 0.02  # s
# A lag or a mode is the rig's where it takes away this share of what is left beyond noise. On the
# independent rig a lag that is not there takes away up to 13 % (what friction has that the equation
# has not), and one of 3 ms that is there 44 %.
MIN_CUT = 0.4
# Friction that has a larger share of the torque's energy hides a lag: on the independent rig, with
# a quarter, one that was found put 85 % into the inertia; a spring on the plate leaves 0.3 %.
MOST_FRICTION = 0.02
# With more damping a mode rings for less than a period, and friction looks alike.
MOST_DAMPING = 0.3
# A search that ends this close to an end of its range was still on its way.
RANGE_MARGIN = 0.01


@dataclass(frozen=True)
class PlateFit:
    """Holds a plate and its sensor.

    Attributes
    ----------
    shape, linear
        Values of the sensor and of the plate, by name.
    response
        What the sensor makes of the torque that acts, at each line.
    vaf
        Of the torque that follows the motion [%].
    searched
        The best values of every description that was tried, where the next search begins.
    """

    shape: dict[str, Found]
    linear: dict[str, Found]
    response: np.ndarray
    vaf: float
    searched: dict[tuple[str, ...], list[float]]


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
    if "mode_damping" in shape and shape["mode_damping"].value > MOST_DAMPING:
        return False
    margin = 1.0 + RANGE_MARGIN
    return all(
        allowed.lower * margin < shape[name].value < allowed.upper / margin
        for name, allowed in _SENSOR.items()
        if name in shape
    )


Response = Callable[[np.ndarray, np.ndarray], np.ndarray]


def fit_plate(spectra: RigSpectra, motion: np.ndarray, before: PlateFit | None = None) -> PlateFit:
    """Return plate and sensor: the simplest description that holds.

    What no description holds (a bearing's friction has many shapes) lets a lag or a mode that the
    sensor has not take away some per cent of what is left, however surely. One that it has leaves
    the noise.

    Parameters
    ----------
    spectra
        Spectra of the recording.
    motion
        Spectrum of the position [rad].
    before
        What was found with a motion that was known less well; None: searches begin anew.

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

    plate = Plate(spectra, motion)
    tried: list[tuple[tuple[str, ...], Response, list[list[float]]]] = []
    tried.append((("delay",), plain, [[0.0]]))
    tried.append((("delay", "lag"), lagged, [[0.0, start] for start in LAG_STARTS]))
    modes = [[0.0, start, MODE_DAMPING_START] for start in MODE_STARTS]
    tried.append((("delay", "mode", "mode_damping"), resonant, modes))
    frictions = np.log(FRICTION_STARTS).tolist()
    chosen: _Search | None = None
    searched: dict[tuple[str, ...], list[float]] = {}
    for names, response, starts in tried:
        search = _Search(plate, names, response)
        known = None if before is None else before.searched[names]
        search.run([known] if known else [[*a, *b] for a in starts for b in frictions])
        searched[names] = search.values.tolist()
        hidden = "lag" in names and search.friction_share() > MOST_FRICTION
        if hidden or not _is_seen(search.shape()):
            continue
        if chosen is None or _is_cut(spectra, chosen.left, search.left):
            chosen = search
    assert chosen is not None
    fit = chosen.fit(searched)
    if not fit.vaf > 50.0:
        raise CalibrationError(
            f"the plate's motion explains {fit.vaf:.0f} % of the torque that follows the "
            "reference; check sign, units and mounting of the torque sensor"
        )
    return fit


@njit(cache=True)
def friction_of(velocity: np.ndarray, rounding: float, decay: float) -> np.ndarray:
    """Return the friction of a bearing for each sample, as a part of its largest, shape (n,).

    It is tanh(v / v0) while the plate moves. Behind a movement it stays, and relaxes: a bearing
    that sticks keeps its torque, one that creeps loses it.

    Parameters
    ----------
    velocity
        [rad/s], shape (n,).
    rounding
        v0 [rad/s].
    decay
        Factor of what is left of the torque from one sample to the next.
    """
    out = np.empty_like(velocity)
    torque = 0.0
    for k in range(len(velocity)):
        moving = abs(velocity[k]) > RESTING_VELOCITY
        torque = math.tanh(velocity[k] / rounding) if moving else torque * decay
        out[k] = torque
    return out


class Plate:
    """Gives the torques that the motion of a plate needs, with friction of any shape.

    Friction that is taken for another one looks like a torque that comes early or late, or through
    a sensor that lags.

    Parameters
    ----------
    spectra
        Spectra of the recording.
    motion
        Spectrum of the position [rad].

    Attributes
    ----------
    names
        Of the torques: inertia, slope, friction, viscosity.
    """

    names = ("inertia", "slope", "friction", "viscosity")

    def __init__(self, spectra: RigSpectra, motion: np.ndarray) -> None:
        self.spectra = spectra
        self._velocity = spectra.time_signal(motion * spectra.omega)
        self._columns = np.column_stack(
            [
                motion * spectra.omega**2,
                motion,
                np.zeros_like(motion),
                motion * spectra.omega,
            ]
        )
        self._friction = (math.nan, math.nan)

    def torques(self, rounding: float, relaxation: float) -> np.ndarray:
        """Return the spectra of all torques per unit, shape (lines, 4).

        Parameters
        ----------
        rounding, relaxation
            v0 [rad/s] and relaxation time [s] of the friction.
        """
        if (rounding, relaxation) != self._friction:
            decay = math.exp(-1.0 / (relaxation * self.spectra.rate))
            friction = friction_of(self._velocity, rounding, decay)
            self._columns[:, 2] = self.spectra.spectrum(friction)
            self._friction = (rounding, relaxation)
        return self._columns


def _is_cut(spectra: RigSpectra, before: float, after: float) -> bool:
    """Say whether a further value takes away `MIN_CUT` of what noise does not leave anyway: a mode
    with little damping leaves less than the noise of all frequencies together, and triples the
    torque at its own.
    """
    noise = spectra.torque_noise
    return after - noise < (1.0 - MIN_CUT) * (before - noise)


class _Search:
    """Finds plate and sensor by separable least squares: the linear values are solved for within.

    Parameters
    ----------
    plate
        Whose torques are fitted.
    names
        Of the values of the sensor.
    response
        Of the sensor.
    """

    def __init__(self, plate: Plate, names: tuple[str, ...], response: Response) -> None:
        self.names, self.response, self.values = names, response, np.zeros(len(names) + 2)
        self._plate = plate
        self._goal = stacked_parts(plate.spectra.torque)
        self._jacobian = np.zeros((len(self._goal), len(self.values)))
        self.left = math.inf

    def run(self, starts: list[list[float]]) -> None:
        """Search from each start; the last two values are the logarithms of the friction's."""
        lower = {"delay": -LONGEST_DELAY, "lag": 1e-5, "mode": 5.0, "mode_damping": 0.003}
        upper = {"delay": LONGEST_DELAY, "lag": 0.05, "mode": 300.0, "mode_damping": 1.5}
        least, largest = np.log(FRICTION_RANGES).T
        sizes = [{"delay": 1e-4, "lag": 1e-3, "mode": 5.0}.get(name, 0.05) for name in self.names]
        found = min(
            (
                least_squares(
                    self._residual,
                    start,
                    bounds=(
                        [*(lower[name] for name in self.names), *least],
                        [*(upper[name] for name in self.names), *largest],
                    ),
                    x_scale=[*sizes, 0.3, 0.3],
                )
                for start in starts
            ),
            key=lambda each: each.cost,
        )
        self.values, self._jacobian, self.left = found.x, found.jac, 2.0 * float(found.cost)

    def _design(self, values: np.ndarray) -> np.ndarray:
        omega = self._plate.spectra.omega
        sensed = self.response(omega, values) * np.exp(-omega * values[0])
        design = stacked_parts(sensed[:, None] * self._plate.torques(*np.exp(values[-2:])))
        return design / np.linalg.norm(design, axis=0)

    def _residual(self, values: np.ndarray) -> np.ndarray:
        regressors = self._design(values)
        return self._goal - regressors @ solved(regressors, self._goal)

    def shape(self) -> dict[str, Found]:
        """Return the values of the sensor, without errors."""
        return {
            name: Found(float(value), 0.0)
            for name, value in zip(self.names, self.values, strict=False)
        }

    def friction_share(self) -> float:
        """Return the friction's share of the torque's energy [1]."""
        design = self._design(self.values)
        torques = design * solved(design, self._goal)
        friction = torques[:, self._plate.names.index("friction")]
        total = torques.sum(axis=1)
        return float(friction @ friction / (total @ total))

    def fit(self, searched: dict[tuple[str, ...], list[float]]) -> PlateFit:
        """Return what was found, with standard errors, and with what was searched."""
        spectra = self._plate.spectra
        omega, (rounding, relaxation) = spectra.omega, np.exp(self.values[-2:])
        sensed = self.response(omega, self.values) * np.exp(-omega * self.values[0])
        torques = self._plate.torques(rounding, relaxation)
        design = stacked_parts(sensed[:, None] * torques)
        scale = np.linalg.norm(design, axis=0)
        linear = solved(design / scale, self._goal) / scale
        residual = self._goal - design @ linear
        # Of all parameters together, so that the errors know of each other.
        slopes = np.column_stack([self._jacobian, -design / scale])
        errors = standard_errors(slopes, residual, spectra.frequency)
        shape = {
            name: Found(float(value), float(error))
            for name, value, error in zip(self.names, self.values, errors, strict=False)
        }
        error = float(errors[len(self.names)])
        shape["friction_velocity"] = Found(float(rounding), float(rounding) * error)
        values = {
            name: Found(float(value), float(error / size))
            for name, value, error, size in zip(
                self._plate.names, linear, errors[len(self.values) :], scale, strict=True
            )
        }
        predicted = sensed * (torques @ linear)
        # Of what follows the motion at all; the sensor's noise is nobody's to explain.
        followed = spectra.following(spectra.torque, predicted)
        missing = float(np.sum(np.abs(followed - predicted) ** 2))
        vaf = 100.0 * (1.0 - missing / float(np.sum(np.abs(followed) ** 2)))
        return PlateFit(shape, values, sensed, vaf, searched)
