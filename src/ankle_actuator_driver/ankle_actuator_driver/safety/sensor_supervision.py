"""Checks whether position, velocity and torque of a powered plate fit each other and the command.

Nothing here is a model of the ankle. What is compared holds for every joint:

- the plate is at the commanded position, within the servo's lag, overshoot and compliance;
- the velocity is the position's derivative;
- whoever accelerates a footplate and bends an ankle needs torque: at least that of the footplate
  alone, and no less than a fifth of what this joint needed so far.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ankle_actuator_driver.safety.encoder_check import EncoderCheck
from ankle_actuator_driver.safety.torque_check import TorqueCheck
from ankle_interfaces.quantity import Quantity, Value

WINDOW = 0.12
"""[s] Length of the window that is checked: several edges of 13 ms, and short against the 200 ms
for a sensor's fault."""
SERVO_LAG = 0.04
"""[s] Time within which the plate has reached the commanded position: a 30 Hz servo needs 25 ms to
within 1 %, its encoder's filter the rest."""
OVERSHOOT = 0.15
"""Part of a movement by which the servo may overshoot: 5 % with a damping of 0.7, more with a
loosely tuned one."""
LEAST_SERVO_STIFFNESS = 1000.0
"""[N.m/rad] Stiffness of the softest drive: half of the 2100 N.m/rad that a geared servo of this
size has."""
AWAY_SHARE = 0.5
"""Part of the newest samples that must be away from where the plate should be: a single spike is
no fault, it is counted."""
AWAY_WINDOW = 0.03
"""[s] Length of the stretch of samples in which that part is counted: two packets."""
INTEGRAL_TOLERANCE = 0.02
"""[rad] Angle by which the integral of the velocity over a window may differ from the change in
position: two filters that differ by 5 ms at 3 rad/s, and an offset of 0.04 rad/s."""
LEAST_MOVEMENT = 0.005
"""[rad] Movement in a window from which the torque is judged: an eighth of the paper's
perturbation."""
LEAST_RESPONSE = 0.1
"""[N.m] Torque that the movement needs at the least, from which it is judged: three times what
regression finds by chance in a window of noise of 0.14 N.m."""
ALIVE_SHARE = 0.5
"""Part of that torque which a living sensor shows."""
FOUND_SHARE = 0.2
"""Part of the torque that this joint has needed so far for such a movement: a joint that relaxes
loses half of its stiffness, never its inertia."""
FOUND_WINDOWS = 20
"""Moving windows after which the joint counts as known."""
DEAD_TORQUE_TIME = 0.045
"""[s] Time for which the torque has to look dead: three packets."""
GAP_RATIO = 1.5
"""Multiple of the sampling interval from which samples are missing between two of them."""
VELOCITY_AVERAGE_SAMPLES = 8
"""Number of samples over which the velocity is averaged before it is differentiated: 4 ms."""


@dataclass(frozen=True)
class Expectations:
    """Holds what the least stiff joint and the worst allowed drive let the sensors show.

    Attributes
    ----------
    following
        How far the plate may be from the commanded position, apart from lag, overshoot and giving
        way [rad].
    inertia
        Inertia in front of the torque sensor that is always there [kg.m^2].
    stiffness
        Stiffness of the softest ankle [N.m/rad].
    """

    following: float = 0.01
    inertia: float = 0.003
    stiffness: float = 5.0


FOLLOWING_TOLERANCE = Quantity(
    "following_tolerance",
    "rad",
    0.001,
    0.05,
    Expectations.following,
    "a quarter of the paper's perturbation",
    "How far the measured position may stay from the commanded one, beside the servo's lag.",
)
LEAST_INERTIA = Quantity(
    "least_inertia",
    "kg.m^2",
    1e-4,
    1.0,
    Expectations.inertia,
    "a fifth of the paper's foot and footplate (0.0137); Ip of a calibrated rig is better",
    "Inertia behind the torque sensor that every subject has, footplate included; a torque sensor "
    "that shows less counts as dead.",
)
LEAST_STIFFNESS = Quantity(
    "least_stiffness",
    "N.m/rad",
    0.0,
    500.0,
    Expectations.stiffness,
    "a third of a relaxed ankle's 15 N.m/rad",
    "Stiffness of the softest ankle; a torque sensor that shows less counts as dead.",
)
SENSOR_PARAMETERS = (FOLLOWING_TOLERANCE, LEAST_INERTIA, LEAST_STIFFNESS)


def expectations_from(values: Mapping[str, Value]) -> Expectations:
    """Return the expectations that the values of `SENSOR_PARAMETERS` describe."""
    return Expectations(*(float(values[parameter.name]) for parameter in SENSOR_PARAMETERS))


@dataclass(frozen=True)
class _Window:
    """Holds the newest samples."""

    time: np.ndarray
    commanded: np.ndarray
    position: np.ndarray
    velocity: np.ndarray
    torque: np.ndarray

    def since(self, begin: float) -> _Window:
        kept = self.time >= begin
        return _Window(*(getattr(self, name)[kept] for name in self.__dataclass_fields__))

    def since_last_gap(self) -> _Window:
        steps = np.diff(self.time)
        gaps = np.flatnonzero(steps > GAP_RATIO * steps.min(initial=np.inf))
        return self.since(float(self.time[gaps[-1] + 1])) if len(gaps) else self

    @property
    def length(self) -> float:
        return float(self.time[-1] - self.time[0])


class SensorSupervision:
    """Checks the sensors of a powered plate.

    Parameters
    ----------
    expectations
        May be changed at any time.

    Attributes
    ----------
    spikes
        Samples that were away from where the plate should be, without making a fault.
    """

    def __init__(self, expectations: Expectations | None = None) -> None:
        self.expectations = expectations or Expectations()
        self.spikes = 0
        self._torque = TorqueCheck()
        self._encoder = EncoderCheck()
        self._parts: deque[_Window] = deque()
        self._dead_since: float | None = None
        self._resumed = math.nan  # time of the first sample after the last gap [s]
        self._found: deque[float] = deque(maxlen=10 * FOUND_WINDOWS)

    def forget(self) -> None:
        """Begin again, because the plate was not powered or begins another movement."""
        self._torque.forget()
        self._encoder.forget()
        self._parts.clear()
        self._dead_since = None
        self._resumed = math.nan

    def forget_joint(self) -> None:
        """Forget the joint's torque, because another joint may be on the plate."""
        self.forget()
        self._found.clear()

    def fault(
        self, time: np.ndarray, commanded: np.ndarray, samples: np.ndarray, torque_limit: float
    ) -> str | None:
        """Return what is wrong with the sensors after further samples; None where all is well.

        Parameters
        ----------
        time
            [s], increasing, shape (n,), n of at least 1.
        commanded
            Commanded position at these times [rad], shape (n,).
        samples
            Measured position [rad], velocity [rad/s], torque [N.m], shape (n, 3).
        torque_limit
            Largest torque that is allowed [N.m].
        """
        self._parts.append(_Window(time, commanded, *samples.T))
        while self._parts[0].time[-1] < time[-1] - WINDOW:
            self._parts.popleft()
        window = _Window(
            *(
                np.concatenate([getattr(part, name) for part in self._parts])
                for name in _Window.__dataclass_fields__
            )
        )
        whole = window.since_last_gap()
        if whole is not window:
            self._resumed = float(whole.time[0])
        interrupted = float(whole.time[0]) == self._resumed
        return (
            self._torque.passed(time, samples[:, 2], torque_limit)
            or self._not_following(window)
            or self._away(whole, len(time), SERVO_LAG if interrupted else 0.0)
            or self._velocity_contradicts(whole)
            or self._torque_dead(whole, WINDOW if interrupted else 0.5 * WINDOW)
        )

    def _not_following(self, window: _Window) -> str | None:
        position, commanded = float(window.position[-1]), float(window.commanded[-1])
        if self._encoder.stuck(float(window.time[-1]), commanded, position):
            return (
                "the measured position does not follow though the plate was commanded to move: "
                "encoder stuck, slipping or disconnected"
            )
        return None

    def _away(self, window: _Window, new: int, settled: float) -> str | None:
        """Return whether the plate is away from all positions that were commanded within the
        lag.

        The first `settled` seconds of the window are not judged: the plate may still follow a
        command that fell into the gap before it.
        """
        if window.length < max(SERVO_LAG, settled):
            return None
        newest = window.since(max(window.time[-1] - AWAY_WINDOW, window.time[0] + settled))
        lag = window.since(window.time[-1] - AWAY_WINDOW - SERVO_LAG)
        low, high = float(lag.commanded.min()), float(lag.commanded.max())
        tolerance = (
            self.expectations.following
            + OVERSHOOT * (high - low)
            + np.abs(newest.torque) / LEAST_SERVO_STIFFNESS
        )
        beyond = np.maximum(low - newest.position, newest.position - high) - tolerance
        away = beyond > 0
        if away.mean() >= AWAY_SHARE:
            return (
                f"the measured position of {newest.position[-1]:.4g} rad is "
                f"{(beyond + tolerance).max():.3g} rad from where the plate was commanded to be: "
                "the encoder slips, or the drive does not follow"
            )
        self.spikes += int(away[-new:].sum())
        return None

    def _velocity_contradicts(self, window: _Window) -> str | None:
        if window.length < 0.5 * WINDOW:
            return None
        moved = float(window.position[-1] - window.position[0])
        said = float(0.5 * (window.velocity[1:] + window.velocity[:-1]) @ np.diff(window.time))
        if abs(moved - said) > INTEGRAL_TOLERANCE:
            return (
                f"the measured velocity says {said:.3g} rad where the position moved by "
                f"{moved:.3g} rad: one of the two sensors is wrong"
            )
        return None

    def _torque_dead(self, window: _Window, shortest: float) -> str | None:
        """Return whether the torque has looked dead for long enough; a window shorter than
        `shortest` [s] tells nothing: one that begins with missing samples holds a part of a
        movement, for which a joint may need less torque than for whole ones.
        """
        if window.length < shortest:
            self._dead_since = None
            return None
        now = float(window.time[-1])
        dead = self._looks_dead(window)
        if not dead:
            self._dead_since = None
        elif self._dead_since is None:
            self._dead_since = now
        elif now - self._dead_since >= DEAD_TORQUE_TIME:
            return dead
        return None

    def _looks_dead(self, window: _Window) -> str | None:
        if np.ptp(window.position) < LEAST_MOVEMENT:
            return None
        interval = window.length / (len(window.time) - 1)
        smooth = np.convolve(
            window.velocity,
            np.full(VELOCITY_AVERAGE_SAMPLES, 1.0 / VELOCITY_AVERAGE_SAMPLES),
            mode="valid",
        )
        inside = slice(VELOCITY_AVERAGE_SAMPLES // 2, VELOCITY_AVERAGE_SAMPLES // 2 + len(smooth))
        motion = np.column_stack([window.position[inside], smooth, np.gradient(smooth, interval)])
        motion = motion - motion.mean(axis=0)
        torque = window.torque[inside] - window.torque[inside].mean()
        least = max(
            self.expectations.inertia * float(motion[:, 2].std()),
            self.expectations.stiffness * float(motion[:, 0].std()),
        )
        if least < LEAST_RESPONSE:
            return None
        size = motion.std(axis=0) + 1e-12
        response, *_ = np.linalg.lstsq(motion / size, torque, rcond=1e-6)
        shown = float((motion / size @ response).std())
        known = len(self._found) >= FOUND_WINDOWS
        needed = max(
            ALIVE_SHARE * least,
            FOUND_SHARE * least * float(np.median(self._found)) if known else 0.0,
        )
        if shown >= needed:
            self._found.append(shown / least)
            return None
        return (
            f"the torque shows {shown:.2g} N.m of a movement that needs {needed:.2g} N.m at the "
            "least: torque sensor dead"
        )
