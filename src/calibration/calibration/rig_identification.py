"""The rig from a recording with the plate empty, or with a known load: everything by its reference.

The reference carries neither noise nor torque, so the part of each channel that follows it is known
far better than the channel itself. That part is found as a smoothed transfer from the reference
(`FREQUENCY_RESOLUTION` wide), and everything else is fitted to it:

    torque(f)   = S(f) e^(-2 pi i f d) [Ip a(f) + b v(f) + g x(f) + F tanh(v / v0)(f)]
    velocity(f) = 2 pi i f x(f) e^(-2 pi i f d_v)
    x(f)        = H(f) [r(f) - torque(f) / k_a]

S is 1, a lag or a mode of the torque sensor, whichever predicts best (BIC); H the servo; r the
reference. Standard errors come from the scatter of what is left between bands of frequency.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft, rfftfreq
from scipy.optimize import least_squares

from ankle_physics.terms.torque_sensor_mode import TorqueSensorMode
from calibration.errors import CalibrationError

# Width over which a transfer is taken as smooth: modes of rigs are wider (5 % of 60 Hz).
FREQUENCY_RESOLUTION = 1.0  # Hz
# A servo's motion differs from its second-order description by about this share.
SERVO_MODEL_ERROR = 0.02
# Fast edges reach no further through a drive of 30 Hz.
HIGHEST_FREQUENCY = 120.0  # Hz
# A plate holds still for at least this long at the start.
MIN_REST_DURATION = 0.5  # s
# Frequencies within such a band count as one observation for standard errors: a few times the
# resolution of the smoothed transfers.
ERROR_BAND = 4.0  # Hz
# Left out behind the start of rest, while the plate settles.
SETTLING_TIME = 0.5  # s
# Below, a reference does not move; noise of a measured reference lies below it.
REFERENCE_RESOLUTION = 1e-6  # rad
# Velocity that rounds the jump of dry friction at rest.
FRICTION_VELOCITY = 0.03  # rad/s
# A parameter counts as found where it is this many standard errors away from nothing.
MIN_SIGNIFICANCE = 3.0
# A sag is stated where its relative standard error is at most this; else a load is needed.
SAG_ACCURACY = 0.1
# Of servo and torque in turn; the load changes by less than its error in a fourth.
ROUNDS = 3
# Where searches for lag, mode and servo begin.
LAG_STARTS = (0.0005, 0.003)  # s
MODE_STARTS = (20.0, 45.0, 80.0)  # Hz
MODE_DAMPING_START = 0.08
# A search that ends this close to an end of its range was still on its way.
RANGE_MARGIN = 0.01
SERVO_STARTS = (15.0, 30.0, 60.0)  # Hz


@dataclass(frozen=True)
class Found:
    """Holds a value with its standard error, in the unit of its use."""

    value: float
    error: float


@dataclass(frozen=True)
class Signals:
    """Holds a recording of a rig.

    Attributes
    ----------
    rate
        [Hz].
    position
        [rad], shape (n,).
    velocity
        [rad/s], shape (n,); None where it was not measured.
    torque
        [N.m], shape (n,).
    reference
        Commanded angle [rad] at the samples' times, shape (n,).
    """

    rate: float
    position: np.ndarray
    velocity: np.ndarray | None
    torque: np.ndarray
    reference: np.ndarray


@dataclass(frozen=True)
class IdentifiedRig:
    """Holds what was identified of a rig from a recording.

    Attributes
    ----------
    torque_delay, velocity_delay
        After the position [s].
    inertia
        Of everything that moves with the plate [kg.m^2].
    friction
        Dry friction [N.m].
    slope
        Torque per angle [N.m/rad]: weight of the plate, and a spring that is mounted.
    lag
        Time constant of the torque sensor [s]; None where it has none.
    mode
        Frequency [Hz] and damping [1] of the torque sensor; None where it has none.
    bandwidth, damping
        Of the servo [Hz], [1].
    servo_stiffness
        k_a [N.m/rad]; None where the load was too small to tell.
    zero_position, zero_torque
        Readings [rad], [N.m] at a command of zero.
    noise
        Standard deviation of position [rad], velocity [rad/s] (None), torque [N.m] at rest.
    vaf
        Of the torque that follows the reference [%].
    """

    torque_delay: Found
    velocity_delay: Found | None
    inertia: Found
    friction: Found
    slope: Found
    lag: Found | None
    mode: tuple[Found, Found] | None
    bandwidth: Found
    damping: Found
    servo_stiffness: Found | None
    zero_position: float
    zero_torque: float
    noise: tuple[float, float | None, float]
    vaf: float


def identify_rig(signals: Signals) -> IdentifiedRig:
    """Identify a rig from one recording that begins and ends at rest.

    Parameters
    ----------
    signals
        The recording; about two minutes of the signal ``rig_calibration``.

    Raises
    ------
    CalibrationError
        No rest at the start, no movement, or a torque that does not follow the plate.
    """
    rest = _rest(signals)
    spectra = _Spectra(signals, rest)
    # First with the torque as it is read, then with the torque that acts, sensor undone: near a
    # mode of the sensor the two differ, and with them the motion of a servo that gives way.
    servo = _servo(spectra, spectra.following(spectra.torque, spectra.reference, known=False))
    for _ in range(ROUNDS):
        motion = spectra.following(spectra.position, servo.motion)
        fit = _torque(spectra, motion)
        servo = _servo(spectra, fit.load)
    zero_position = float(np.mean((signals.position - signals.reference)[rest]))
    at_rest = float(np.mean(signals.torque[rest]))
    noise = (
        _scatter(signals.position[rest]),
        None if signals.velocity is None else _scatter(signals.velocity[rest]),
        _scatter(signals.torque[rest]),
    )
    return IdentifiedRig(
        torque_delay=fit.shape["delay"],
        velocity_delay=_velocity_delay(spectra, motion),
        inertia=fit.linear["inertia"],
        friction=fit.linear["friction"],
        slope=fit.linear["slope"],
        lag=fit.shape.get("lag"),
        mode=(fit.shape["mode"], fit.shape["mode_damping"]) if "mode" in fit.shape else None,
        bandwidth=servo.bandwidth,
        damping=servo.damping,
        servo_stiffness=servo.stiffness,
        zero_position=zero_position,
        zero_torque=at_rest,
        noise=noise,
        vaf=fit.vaf,
    )


def _rest(signals: Signals) -> slice:
    moving = np.flatnonzero(np.abs(signals.reference - signals.reference[0]) > REFERENCE_RESOLUTION)
    if not len(moving):
        raise CalibrationError("the reference does not move: nothing can be calibrated")
    first, last = round(SETTLING_TIME * signals.rate), int(moving[0])
    if last < (MIN_REST_DURATION + SETTLING_TIME) * signals.rate:
        raise CalibrationError(
            f"the plate rests for {last / signals.rate:.2f} s before it first moves; at least "
            f"{MIN_REST_DURATION + SETTLING_TIME:g} s are needed"
        )
    return slice(first, last)


def _scatter(samples: np.ndarray) -> float:
    """Return the standard deviation without slow drift: from differences of neighbours."""
    return float(np.std(np.diff(samples)) / math.sqrt(2.0))


class _Spectra:
    """Spectra of what follows the reference, of the whole recording, and their noise."""

    def __init__(self, signals: Signals, rest: slice) -> None:
        n = len(signals.reference)
        self.length = next_fast_len(n + round(signals.rate), real=True)
        frequency = rfftfreq(self.length, 1.0 / signals.rate)
        used = (frequency > 0.0) & (frequency <= min(HIGHEST_FREQUENCY, 0.4 * signals.rate))
        self.frequency = frequency[used]
        self.rate = signals.rate
        self.used = used
        self.omega = 2j * np.pi * self.frequency
        self._half = max(1, round(0.5 * FREQUENCY_RESOLUTION * self.length / signals.rate))
        self.reference = self._raw(signals.reference - signals.reference[0])
        self.position = self._raw(signals.position - signals.position[rest].mean())
        self.torque = self._raw(signals.torque - signals.torque[rest].mean())
        self.velocity = None
        if signals.velocity is not None:
            self.velocity = self._raw(signals.velocity - signals.velocity[rest].mean())

    def _raw(self, signal: np.ndarray) -> np.ndarray:
        return rfft(signal, self.length)[self.used]

    def following(self, signal: np.ndarray, model: np.ndarray, known: bool = True) -> np.ndarray:
        """Return what of a spectrum follows a model of it, through a transfer that is smooth.

        With `known` the model is right but for `SERVO_MODEL_ERROR`; without, it is only
        proportional to what the signal follows. The nearer the model, the flatter is the transfer,
        and the less does smoothing distort it. At the lowest frequencies responses are steeper than
        the resolution, and the signal is far above its noise: there it stays as it is.
        """
        power = np.maximum(self._smooth(np.abs(model) ** 2), 1e-300)
        transfer = self._smooth(signal * model.conj()) / power
        left = self._smooth(np.abs(signal - transfer * model) ** 2)
        # Where the signal sinks in its noise the model is the better guide.
        noise = left / power / (2 * self._half + 1)
        weight = SERVO_MODEL_ERROR**2 / (SERVO_MODEL_ERROR**2 + noise) if known else 1.0
        followed = (1.0 + weight * (transfer - 1.0) if known else transfer) * model
        return np.where(self.frequency < 2.0 * FREQUENCY_RESOLUTION, signal, followed)

    def _smooth(self, values: np.ndarray) -> np.ndarray:
        width = 2 * self._half + 1
        padded = np.pad(values, self._half, mode="edge")
        total = np.cumsum(np.concatenate([[0.0], padded]))
        return (total[width:] - total[:-width]) / width

    def time_signal(self, spectrum: np.ndarray) -> np.ndarray:
        """Return the signal of a spectrum, shape (length,)."""
        whole = np.zeros(self.length // 2 + 1, dtype=complex)
        whole[self.used] = spectrum
        return irfft(whole, self.length)

    def spectrum(self, signal: np.ndarray) -> np.ndarray:
        """Return the spectrum of a signal of shape (length,)."""
        return rfft(signal, self.length)[self.used]


@dataclass(frozen=True)
class _Fit:
    """Plate and sensor: values by name, and the spectrum of the torque in front of the sensor."""

    shape: dict[str, Found]
    linear: dict[str, Found]
    load: np.ndarray
    vaf: float


@dataclass(frozen=True)
class _Servo:
    """The servo, and the spectrum of the motion that it makes."""

    bandwidth: Found
    damping: Found
    stiffness: Found | None
    motion: np.ndarray


def _is_mode(frequency: float) -> bool:
    """Whether a frequency [Hz] is that of a mode which the recording shows, not the end of a range.

    A mode far above the recorded band looks like a part of the delay, and is one.
    """
    allowed = TorqueSensorMode.parameter("frequency")
    margin = 1.0 + RANGE_MARGIN
    return allowed.lower * margin < frequency < allowed.upper / margin


Response = Callable[[np.ndarray, np.ndarray], np.ndarray]


def _torque(spectra: _Spectra, motion: np.ndarray) -> _Fit:
    """Return plate and sensor: the description of the sensor with the least BIC."""
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
    best: tuple[float, _Fit] | None = None
    columns = _columns(spectra, motion)
    for names, response, starts in tried:
        bic, fit = _fitted(spectra, columns, names, response, starts)
        if "mode" in names and not _is_mode(fit.shape["mode"].value):
            continue
        if best is None or bic < best[0]:
            best = bic, fit
    assert best is not None
    if not best[1].vaf > 50.0:
        raise CalibrationError(
            f"the plate's motion explains {best[1].vaf:.0f} % of the torque that follows the "
            "reference; check sign, units and mounting of the torque sensor"
        )
    return best[1]


def _columns(spectra: _Spectra, motion: np.ndarray) -> dict[str, np.ndarray]:
    velocity = spectra.time_signal(motion * spectra.omega)
    return {
        "inertia": motion * spectra.omega**2,
        "slope": motion,
        "friction": spectra.spectrum(np.tanh(velocity / FRICTION_VELOCITY)),
        "viscosity": motion * spectra.omega,
    }


def _fitted(
    spectra: _Spectra,
    columns: dict[str, np.ndarray],
    names: tuple[str, ...],
    response: Response,
    starts: list[list[float]],
) -> tuple[float, _Fit]:
    """Return separable least squares: the linear values are solved for within."""
    stacked = np.column_stack(list(columns.values()))
    scale = np.linalg.norm(stacked, axis=0)
    goal = _parts(spectra.torque)

    def design(shape: np.ndarray) -> np.ndarray:
        sensed = response(spectra.omega, shape) * np.exp(-spectra.omega * shape[0])
        return _parts(sensed[:, None] * stacked / scale)

    def left(shape: np.ndarray) -> np.ndarray:
        regressors = design(shape)
        return goal - regressors @ _solved(regressors, goal)

    lower = {"delay": -0.02, "lag": 1e-5, "mode": 5.0, "mode_damping": 0.003}
    upper = {"delay": 0.02, "lag": 0.05, "mode": 300.0, "mode_damping": 1.5}
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
    linear = _solved(regressors, goal)
    residual = goal - regressors @ linear
    count = len(goal)
    # Of all parameters together, so that the errors know of each other.
    slopes = np.column_stack([found.jac, -regressors])
    errors = _standard_errors(slopes, residual, spectra.frequency)
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
    bic = count * math.log(float(residual @ residual) / count) + len(names) * math.log(count)
    return bic, _Fit(shape, values, stacked @ (linear / scale), vaf)


def _standard_errors(slopes: np.ndarray, residual: np.ndarray, frequency: np.ndarray) -> np.ndarray:
    """Return standard errors of least squares whose residual is alike within `ERROR_BAND`.

    Smoothing spreads noise over neighbouring frequencies, and what the description does not hold
    lies in whole bands: lines of one band are no independent observations (Liang & Zeger,
    Biometrika 73 (1986) 13-22). Never less than the errors of white residuals.

    Parameters
    ----------
    slopes
        Derivatives of the residual, shape (2 n, p): real parts, then imaginary ones.
    residual
        Shape (2 n,).
    frequency
        [Hz], shape (n,).
    """
    inverse = np.linalg.pinv(slopes.T @ slopes)
    variance = float(residual @ residual) / (len(residual) - slopes.shape[1])
    bands = np.floor(frequency / ERROR_BAND).astype(int)
    scores = np.zeros((bands.max() + 1, slopes.shape[1]))
    np.add.at(scores, np.concatenate([bands, bands]), slopes * residual[:, None])
    count = len(np.unique(bands))
    spread = inverse @ (scores.T @ scores) @ inverse * (count / max(count - 1, 1))
    return np.asarray(np.sqrt(np.maximum(np.diag(spread), np.diag(inverse) * variance)))


def _solved(regressors: np.ndarray, goal: np.ndarray) -> np.ndarray:
    return np.linalg.solve(regressors.T @ regressors, regressors.T @ goal)


def _velocity_delay(spectra: _Spectra, motion: np.ndarray) -> Found | None:
    if spectra.velocity is None:
        return None
    expected = motion * spectra.omega
    goal = _parts(spectra.velocity)

    def left(shape: np.ndarray) -> np.ndarray:
        return goal - shape[1] * _parts(expected * np.exp(-spectra.omega * shape[0]))

    found = least_squares(left, [0.0, 1.0], x_scale=[1e-4, 0.1])
    errors = _standard_errors(found.jac, found.fun, spectra.frequency)
    return Found(float(found.x[0]), float(errors[0]))


def _servo(spectra: _Spectra, load: np.ndarray) -> _Servo:
    """Return second-order servo with a delay, and how far a load [N.m] moves it."""
    goal = _parts(spectra.position)

    def response(shape: np.ndarray) -> np.ndarray:
        ratio = spectra.omega / (2.0 * np.pi * shape[0])
        second = 1.0 / (1.0 + 2.0 * shape[1] * ratio + ratio**2)
        return second * np.exp(-spectra.omega * shape[2])

    def left(shape: np.ndarray) -> np.ndarray:
        return goal - _parts(response(shape) * (spectra.reference - shape[3] * load))

    scale = [5.0, 0.1, 1e-3, 1e-4]
    bounds = ([1.0, 0.05, -0.005, -0.01], [400.0, 5.0, 0.05, 0.02])
    found = min(
        (
            least_squares(left, [start, 0.7, 0.0, 0.0], bounds=bounds, x_scale=scale)
            for start in SERVO_STARTS
        ),
        key=lambda each: each.cost,
    )
    errors = _standard_errors(found.jac, found.fun, spectra.frequency)
    sag = float(found.x[3])
    stiffness = None
    if sag > 0.0 and errors[3] <= SAG_ACCURACY * sag:
        stiffness = Found(1.0 / sag, float(errors[3]) / sag**2)
    return _Servo(
        Found(float(found.x[0]), float(errors[0])),
        Found(float(found.x[1]), float(errors[1])),
        stiffness,
        response(found.x) * (spectra.reference - sag * load),
    )


def _parts(values: np.ndarray) -> np.ndarray:
    return np.concatenate([values.real, values.imag])
