"""Delay, torque sensor and inertia, where the plate keeps moving one way.

There friction hardly changes (`one_way_motion`), and everything is linear:

    torque(f) = S(f) e^(-2 pi i f d) [Ip a(f) + b v(f) + g x(f) + F c(f)]

S is 1, a lag or a mode of the torque sensor. c is the course of the friction: of a dry bearing only
what the sensor remembers of the last reversal reaches into a stretch.

The measured motion has noise that grows with frequency. Least squares shrink what is noisy, and
would take noise for a sensor that lags. So the part of the motion that the reference explains is
the instrument z (Söderström & Stoica, Instrumental Variable Methods for System Identification,
1983): with slopes D of the model by its values,

    D(z)' (torque - model of the measured motion) = 0

Standard errors come from the scatter of what is left between the stretches (Liang & Zeger,
Biometrika 73 (1986) 13-22).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares

from ankle_physics.rig_file import LONGEST_DELAY
from ankle_physics.term import Parameter
from ankle_physics.terms.torque_sensor_lag import TorqueSensorLag
from ankle_physics.terms.torque_sensor_mode import TorqueSensorMode
from calibration.errors import CalibrationError
from calibration.fitted_value import Found, solved
from calibration.friction_course import Friction
from calibration.one_way_motion import OneWayMotion
from calibration.rig_spectra import HIGHEST_FREQUENCY, RigSpectra

# Where searches begin: a lag, and modes so close that none falls between two.
LAG_STARTS = (0.0005, 0.003)  # s
MODE_STARTS = tuple(np.geomspace(12.0, HIGHEST_FREQUENCY, 24).tolist())  # Hz
MODE_DAMPING_START = 0.06
# Of them the best by one evaluation each are followed.
FOLLOWED_STARTS = 2
# A mode is the sensor's where more than this share of the noise is left without it beyond noise,
# and where it takes away this share. The noise of ten seconds at rest is known to 4 %. On the
# independent rig modes of 26 to 84 Hz leave 3 to 300 times the noise, and take away 95 %.
MIN_EXCESS = 0.2
MIN_CUT = 0.4
# With more damping a mode rings for less than a period, and a lag looks alike.
MOST_DAMPING = 0.3
# A lag is the sensor's where it is this many of its standard errors: one in 30 000 by chance.
LAG_SIGNIFICANCE = 4.0
# A search that ends this close to an end of its range was still on its way.
RANGE_MARGIN = 0.01
# What the course has wrong of each reversal, its time and its width, is found by
# derivatives of the course: a reversal lasts a millisecond or two, and a sensor's mode rings slowly
# beside it.
MOMENTS = 3
# Steps of the instrumental variables from where least squares end.
STEPS = 10
# Difference of a value, in its scale, over which a slope is taken.
DIFFERENCE = 0.01
# A step of the values that is this small beside their standard errors ends them.
SMALLEST_STEP = 0.01

Response = Callable[[np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class SensorFit:
    """Holds the torque sensor and the inertia of the plate.

    Attributes
    ----------
    shape
        ``delay``, and ``lag`` or ``mode`` and ``mode_damping``.
    inertia
        Of everything that moves with the plate [kg.m^2].
    response
        What sensor and delay make of the torque that acts, at each line.
    """

    shape: dict[str, Found]
    inertia: Found
    response: np.ndarray


@dataclass(frozen=True)
class _Sensor:
    """Describes a torque sensor by names, ranges and scales of its values, and its response."""

    names: tuple[str, ...]
    ranges: tuple[tuple[float, float], ...]
    scales: tuple[float, ...]
    starts: tuple[tuple[float, ...], ...]
    response: Response

    def is_inside(self, values: np.ndarray) -> bool:
        """Say whether values are finite and within their ranges, and not at an end of one."""
        return all(
            (lower < value < upper)
            if lower < 0.0
            else (lower * (1.0 + RANGE_MARGIN) < value < upper / (1.0 + RANGE_MARGIN))
            for value, (lower, upper) in zip(values, self.ranges, strict=True)
        )


def _undistorted(s: np.ndarray, _: np.ndarray) -> np.ndarray:
    return np.ones(len(s), dtype=complex)


def _lagged(s: np.ndarray, p: np.ndarray) -> np.ndarray:
    return np.asarray(1.0 / (1.0 + s * p[1]))


def _resonant(s: np.ndarray, p: np.ndarray) -> np.ndarray:
    ratio = s / (2.0 * np.pi * p[1])
    return np.asarray(1.0 / (1.0 + 2.0 * p[2] * ratio + ratio**2))


def _range(parameter: Parameter) -> tuple[float, float]:
    return parameter.lower, parameter.upper


_DELAYS = (-LONGEST_DELAY, LONGEST_DELAY)
_FREQUENCIES = (_range(TorqueSensorMode.parameter("frequency"))[0], HIGHEST_FREQUENCY)
DELAY = _Sensor(("delay",), (_DELAYS,), (1e-4,), ((0.0,),), _undistorted)
LAG = _Sensor(
    ("delay", "lag"),
    (_DELAYS, _range(TorqueSensorLag.parameter("T"))),
    (1e-4, 1e-3),
    tuple((0.0, start) for start in LAG_STARTS),
    _lagged,
)
MODE = _Sensor(
    ("delay", "mode", "mode_damping"),
    (_DELAYS, _FREQUENCIES, _range(TorqueSensorMode.parameter("damping"))),
    (1e-4, 1.0, 0.01),
    tuple((0.0, start, MODE_DAMPING_START) for start in MODE_STARTS),
    _resonant,
)


class SensorSearch:
    """Finds the torque sensor of a recording.

    Parameters
    ----------
    spectra
        Spectra of the recording.
    rest
        Samples at which the plate rests.

    Raises
    ------
    CalibrationError
        The plate hardly ever keeps moving one way.
    """

    def __init__(self, spectra: RigSpectra, rest: slice) -> None:
        self._spectra = spectra
        self._stretches = OneWayMotion(spectra)
        self._goal = self._stretches(spectra.torque)
        self._noise = len(self._goal) * self._stretches.variance(spectra.torque, rest)
        self._searched: dict[_Sensor, np.ndarray] = {}

    def run(self, motion: np.ndarray, instrument: np.ndarray, friction: Friction) -> SensorFit:
        """Return the simplest description that holds.

        A further run begins where the one before ended.

        Parameters
        ----------
        motion
            Spectrum of the position [rad], as well as it is known.
        instrument
            The part of the position that follows the reference [rad].
        friction
            Its course, as far as it is known.
        """
        torques = self._torques(motion, friction)
        left = {sensor: self._least_squares(sensor, torques) for sensor in (DELAY, LAG, MODE)}
        measured = self._torques(self._spectra.position, friction)
        instruments = self._torques(instrument, friction)
        if self._is_mode(left):
            found = self._by_instruments(MODE, measured, instruments)
            if found is not None:
                return found
        found = self._by_instruments(LAG, measured, instruments)
        if found is not None:
            lag = found.shape["lag"]
            if lag.value > LAG_SIGNIFICANCE * lag.error:
                return found
        found = self._by_instruments(DELAY, measured, instruments)
        if found is None:
            raise CalibrationError(
                "the torque does not follow the plate; check sign, units and mounting of the "
                "torque sensor"
            )
        return found

    def _is_mode(self, left: dict[_Sensor, float]) -> bool:
        """Say whether a mode takes away `MIN_CUT` of what noise does not leave anyway, and rings.

        It is compared with the noise of the stretches' own filter: a mode with little damping
        leaves less than the noise of all frequencies together.
        """
        values = self._searched[MODE]
        excess = min(left[DELAY], left[LAG]) - self._noise
        return (
            excess > MIN_EXCESS * self._noise
            and left[MODE] - self._noise < (1.0 - MIN_CUT) * excess
            and MODE.is_inside(values)
            and values[2] <= MOST_DAMPING
        )

    def _torques(self, motion: np.ndarray, friction: Friction) -> np.ndarray:
        """Return the spectra of inertia, viscosity, slope, and friction with its derivatives per
        unit, shape (lines, 3 + MOMENTS), of a motion's spectrum.
        """
        spectra = self._spectra
        velocity = spectra.time_signal(motion * spectra.omega)
        course = spectra.spectrum(friction.course(velocity, spectra.rate))
        return np.column_stack(
            [
                motion * spectra.omega**2,
                motion * spectra.omega,
                motion,
                *(course * spectra.omega**k for k in range(MOMENTS)),
            ]
        )

    def _design(self, sensor: _Sensor, values: np.ndarray, torques: np.ndarray) -> np.ndarray:
        """Return what the sensor shows of each torque in all stretches, shape (n, 3 + MOMENTS)."""
        sensed = self._sensed(sensor, values)
        return np.column_stack([self._stretches(sensed * torque) for torque in torques.T])

    def _sensed(self, sensor: _Sensor, values: np.ndarray) -> np.ndarray:
        omega = self._spectra.omega
        return sensor.response(omega, values) * np.exp(-omega * values[0])

    def _solved(self, design: np.ndarray) -> np.ndarray:
        scale = np.linalg.norm(design, axis=0)
        return solved(design / scale, self._goal) / scale

    def _least_squares(self, sensor: _Sensor, torques: np.ndarray) -> float:
        """Search the values of a sensor, the linear ones solved for within; what they leave."""

        def left(values: np.ndarray) -> np.ndarray:
            design = self._design(sensor, values, torques)
            return self._goal - design @ self._solved(design)

        starts: list[np.ndarray] = [np.array(start) for start in sensor.starts]
        if sensor in self._searched:
            starts = [self._searched[sensor]]
        elif len(starts) > FOLLOWED_STARTS:
            starts.sort(key=lambda start: float(np.sum(left(start) ** 2)))
        lower, upper = np.transpose(sensor.ranges)
        found = min(
            (
                least_squares(left, start, bounds=(lower, upper), x_scale=sensor.scales)
                for start in starts[:FOLLOWED_STARTS]
            ),
            key=lambda each: each.cost,
        )
        self._searched[sensor] = found.x
        return 2.0 * float(found.cost)

    def _by_instruments(
        self, sensor: _Sensor, measured: np.ndarray, instruments: np.ndarray
    ) -> SensorFit | None:
        """Return the values by instrumental variables, from those of the least squares; None where
        they do not come to rest within their ranges.
        """
        count = len(sensor.names)
        values = self._searched[sensor]
        design = self._design(sensor, values, measured)
        linear = self._solved(design)
        for _ in range(STEPS):
            design = self._design(sensor, values, measured)
            slopes = self._slopes(sensor, values, linear, measured)
            instrument = self._slopes(sensor, values, linear, instruments)
            residual = self._goal - design @ linear
            scale = np.linalg.norm(slopes, axis=0)
            try:
                inverse = np.linalg.inv((instrument / scale).T @ (slopes / scale))
            except np.linalg.LinAlgError:
                return None
            scores = np.zeros((self._stretches.stretch[-1] + 1, len(scale)))
            np.add.at(scores, self._stretches.stretch, instrument / scale * residual[:, None])
            step = inverse @ scores.sum(axis=0) / scale
            errors = np.sqrt(np.diag(inverse @ (scores.T @ scores) @ inverse.T)) / scale
            values, linear = values + step[:count], linear + step[count:]
            if not sensor.is_inside(values):
                return None
            if np.all(np.abs(step) < SMALLEST_STEP * errors):
                break
        else:
            return None
        shape = {
            name: Found(float(value), float(error))
            for name, value, error in zip(sensor.names, values, errors, strict=False)
        }
        return SensorFit(
            shape,
            Found(float(linear[0]), float(errors[count])),
            self._sensed(sensor, values),
        )

    def _slopes(
        self, sensor: _Sensor, values: np.ndarray, linear: np.ndarray, torques: np.ndarray
    ) -> np.ndarray:
        """Return the slopes of the model by its values, those of the sensor first, shape (n, p)."""
        design = self._design(sensor, values, torques)
        modelled = design @ linear
        columns = []
        for k, scale in enumerate(sensor.scales):
            near = values.copy()
            near[k] += DIFFERENCE * scale
            moved = self._design(sensor, near, torques) @ linear
            columns.append((moved - modelled) / (DIFFERENCE * scale))
        return np.column_stack([*columns, design])
