"""Samples between two gaps pass from the sensors back to the joint, as `known_physics` describes.

Every filter keeps its state between calls.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ankle_physics.linear_dynamics import Delay, FirstOrder, SecondOrder
from ankle_physics.model import Model
from ankle_physics.rig_file import LONGEST_DELAY
from ankle_physics.signals import Signals
from ankle_physics.term import State
from impedance_estimator.estimator import ReflexColumns, SampleLayout
from impedance_estimator.held_torques import (
    COMMANDED,
    MEASURED,
    HeldTorques,
    TrackedTorques,
    foot_torques,
)
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.simultaneous.gaussian_derivatives import (
    gaussian_derivatives,
    weighted_channels,
)
from impedance_estimator.simultaneous.nuisance import (
    REFERENCE_FILTER_DAMPING,
    REFERENCE_FILTER_HZ,
)
from impedance_estimator.straps import Straps

WARM_UP = 0.1
"""The terms rest so long [s] before the first sample and after each gap: longer than every delay
and sensor's lag.
"""
SMOOTHING = 0.0015
"""[s] Standard deviation of the kernel before terms that run beside the regression: -3 dB at 88 Hz,
above what a perturbation moves."""
REST_VELOCITY = 0.005
"""[rad/s] Three times the noise of the smoothed velocity; 0.5 % of a perturbation's."""
FUSION_TIME = 0.03
"""[s] Held terms follow the position below 5 Hz and the measured velocity above. An encoder's noise
of 0.07 mrad, differentiated, travels 10 mrad/s: friction that slips over 4 mrad would forget its
torque within half a second, though nothing moves. A velocity channel is ten times quieter."""


DRIVE_TERMS = ("cyclic_angle_error", "lost_motion", "recovering_lost_motion", "uneven_angle")
"""Terms between the encoder and the plate."""


class Motion(NamedTuple):
    """Holds angle [rad], velocity [rad/s] and acceleration [rad/s²] of plate or foot, each (n,)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class JointPath:
    """Corrects the samples of a stretch without gaps.

    Parameters
    ----------
    known
        Rig and subject.
    layout
        Of the samples, and which columns of the reflex are put behind them.

    Attributes
    ----------
    straps
        Between plate and foot; None where the foot is fixed.
    tracked_torques
        As those of `KnownPhysicsRun`.
    """

    def __init__(self, known: KnownPhysics, layout: SampleLayout) -> None:
        model, rig, rate = known.model, known.rig, layout.rate
        self._layout = layout
        self._zero = (rig.zero_position, rig.zero_torque) if rig is not None else (0.0, 0.0)
        skew = model.entry("channel_skew").values["skew"] if model.has("channel_skew") else 0.0
        slow_velocity = rig.velocity_delay.value if rig is not None else 0.0
        latest = max(skew, slow_velocity if layout.measured_velocity else 0.0, 0.0)
        longest = 2.0 * LONGEST_DELAY
        self._delays = {
            "position": (Delay(rate, longest), latest),
            "velocity": (Delay(rate, longest), latest - slow_velocity),
            "torque": (Delay(rate, longest), latest - skew),
            "reference": (Delay(rate, longest), latest),
        }
        self._sensors = known.torque_sensors
        self._sensor_states: dict[str, list[State]] = {}
        self.straps = Straps(model, rate, layout.measured_velocity) if known.has_straps else None
        self._on_foot = foot_torques(model, rate) if self.straps is not None else None
        self._drive_train = _Connections(model, DRIVE_TERMS, rate)
        self._gap = _Connections(model, ("backlash",), rate)
        self._plate_inertia = known.plate_inertia
        self._before: np.ndarray | None = None
        self._unsmoothed_velocity = np.zeros(0)
        modelled = layout.reflex is ReflexColumns.TORQUE
        self._held = HeldTorques(model, rate, modelled)
        self._tracked = TrackedTorques(known, rate, modelled) if known.tracked else None
        self.tracked_torques = np.zeros((2, 1 + len(known.tracked), 0))
        self._actuator = SecondOrder(rate)
        self._fusions = _Fusion(rate), _Fusion(rate)
        self._kernels = gaussian_derivatives(max(SMOOTHING, 0.8 / rate), rate)
        stretch = layout.reflex is ReflexColumns.STRETCH
        self._smoothing = (
            self.straps is not None or self._drive_train.any or self._held.any or stretch
        )
        self._commanding = layout.reflex is not ReflexColumns.NONE or self._tracked is not None

    @property
    def projection(self) -> float:
        """Return the share of a change of the reflex that the regression sees [1]."""
        return self._held.projection

    def settle(self, sample: np.ndarray) -> None:
        """Start at rest with the values of a sample."""
        still = np.tile(sample, (round(WARM_UP * self._layout.rate), 1))
        still[:, 0] = sample[0]
        if self._layout.measured_velocity:
            still[:, 2] = 0.0
        if not np.isfinite(sample[-1]):
            still[:, -1] = 0.0
        self.run(still)

    def run(self, samples: np.ndarray) -> np.ndarray:
        """Return corrected samples with the columns of the reflex behind them.

        Parameters
        ----------
        samples
            Shape (n, k), finite but for the reference.
        """
        measured, reflex_columns = self._layout.measured_velocity, self._layout.reflex
        x = self._late("position", samples[:, 1] - self._zero[0])
        torque_column = 3 if measured else 2
        torque = self._late("torque", samples[:, torque_column] - self._zero[1])
        has_reference = samples.shape[1] > torque_column + 1
        reference = samples[:, -1] if has_reference else np.full(len(samples), np.nan)
        known = np.isfinite(reference)
        delayed = self._late("reference", np.where(known, reference, 0.0))
        # Without a measured velocity it is differentiated once the channels are even.
        v = self._late("velocity", samples[:, 2]) if measured else np.zeros(len(x))
        acceleration = np.zeros(len(x))
        if self._smoothing:
            x, v, torque, delayed, acceleration = self._smoothed(x, v, torque, delayed)
        plate = self._drive_train.run(Motion(x, v, acceleration))
        foot, added = plate, np.zeros(len(x))
        if self.straps is not None:
            # The plate moves otherwise than the foot: its inertia cannot be taken from I.
            added += self._plate_inertia * plate.acceleration
            position, velocity, delayed = self.straps.foot(plate.position, plate.velocity, delayed)
            foot = Motion(position, velocity, np.zeros(len(x)))
        foot = self._gap.run(foot)
        commanded = self._commanded(delayed) if self._commanding else foot
        # Straps smooth the foot's motion themselves.
        moves_alike = foot is plate and not self._drive_train.any
        drive = self._drive(v) if self._smoothing and moves_alike else foot.velocity
        # On the foot: held terms, and the reflex along the motion and along the commanded one.
        on_foot: np.ndarray = np.zeros((3, len(x)))
        if self._held.any:
            on_plate, on_foot = self._modelled(plate, foot, drive, commanded)
            added += on_plate
        if reflex_columns is ReflexColumns.STRETCH:
            on_foot[1:] = np.maximum([drive, commanded.velocity], 0.0)
        if self.straps is not None and (self._held.any or reflex_columns is not ReflexColumns.NONE):
            on_foot = self.straps.at_plate("on the foot", on_foot)
        added += on_foot[0]
        # What the sensor sees of a torque, the regression sees of the motion that goes with it.
        out = widened(samples, self._layout.reflex)
        if reflex_columns is not ReflexColumns.NONE:
            for column, name, along in ((-2, MEASURED, on_foot[1]), (-1, COMMANDED, on_foot[2])):
                out[:, column] = self._sense(f"reflex {name}", along)
        out[:, 1] = self._sense("position", foot.position)
        out[:, torque_column] = torque - self._sense("torque", added)
        if measured:
            out[:, 2] = self._sense("velocity", foot.velocity)
        if has_reference:
            out[:, samples.shape[1] - 1] = np.where(
                known, self._sense("reference", delayed), np.nan
            )
        return out

    def _late(self, name: str, values: np.ndarray) -> np.ndarray:
        delay, seconds = self._delays[name]
        return delay.run(values, seconds) if seconds > 0.0 else values

    def _smoothed(
        self, x: np.ndarray, v: np.ndarray, torque: np.ndarray, reference: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return all signals and the acceleration through one kernel, late by half its length.

        A reflex rectifies the velocity and friction follows its sign: both would answer noise.
        """
        kernels = self._kernels
        now = np.array([x, v, torque, reference])
        if self._before is None:
            self._before = np.repeat(now[:, :1], kernels.shape[1] - 1, axis=1)
        joined = np.concatenate([self._before, now], axis=1)
        self._before = joined[:, -(kernels.shape[1] - 1) :]
        # The velocity channel is one derivative ahead of the position.
        source, ahead = (1, 0) if self._layout.measured_velocity else (0, 1)
        weighted = weighted_channels(
            joined,
            kernels,
            np.array([[0, 0], [source, ahead], [2, 0], [3, 0], [source, ahead + 1]]),
        )
        half = kernels.shape[1] // 2
        self._unsmoothed_velocity = joined[1, half:-half] if ahead == 0 else weighted[1]
        return tuple(weighted)

    def _drive(self, smoothed: np.ndarray) -> np.ndarray:
        """Return the velocity [rad/s] that stretches the calf, as it was measured and, at rest,
        smoothed.

        Rectified, a smoothed velocity loses area where a pulse turns, and noise at rest gains some.
        """
        moves = np.abs(smoothed) > REST_VELOCITY
        return np.where(moves, self._unsmoothed_velocity, smoothed)

    def _sense(self, channel: str, values: np.ndarray) -> np.ndarray:
        """Return a signal through the torque sensor's dynamics; each channel has its own state."""
        if not self._sensors:
            return values
        if channel not in self._sensor_states:
            self._sensor_states[channel] = [
                entry.term.start(self._layout.rate) for entry in self._sensors
            ]
        for entry, state in zip(self._sensors, self._sensor_states[channel], strict=True):
            signals = Signals(self._layout.rate, values, values, values)
            signals.torque = values
            entry.term.transform(signals, entry.values, state)
            values = signals.torque
        return values

    def _at_sensor(self, channel: str, torque: np.ndarray) -> np.ndarray:
        """Return what the sensor reads of a torque on the foot [N.m]."""
        if self.straps is not None:
            (torque,) = self.straps.at_plate(channel, torque[np.newaxis])
        return self._sense(channel, torque)

    def _commanded(self, reference: np.ndarray) -> Motion:
        """Return the motion to which a nominal actuator turns the reference [rad]."""
        omega = 2.0 * np.pi * REFERENCE_FILTER_HZ
        return Motion(*self._actuator.run_with_rates(reference, omega, REFERENCE_FILTER_DAMPING))

    def _modelled(
        self,
        plate: Motion,
        foot: Motion,
        drive: np.ndarray,
        commanded: Motion,
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return torques [N.m]: of the held terms on the plate, shape (n,); on the foot, shape
        (3, n), of the held terms and of a modelled reflex along the motion and along the commanded
        one.
        """

        def signals(at_plate: Motion, at_foot: Motion) -> Signals:
            made = Signals(self._layout.rate, *at_plate)
            made.move_foot(*at_foot)
            return made

        def measured() -> Signals:
            made = signals(plate, foot)
            made.drive = drive
            return made

        if self._layout.measured_velocity:
            together = foot is plate
            plate = self._fusions[0].run(plate)
            foot = plate if together else self._fusions[1].run(foot)
        if self.straps is not None and self._on_foot is not None:
            x, v = self.straps.pushed(self._on_foot.torque(measured()))
            foot = foot._replace(position=foot.position - x, velocity=foot.velocity - v)
            drive = drive - v
        on_plate, on_foot, reflex = self._held.torques(measured)
        along_command = np.zeros(len(drive))
        if self._layout.reflex is ReflexColumns.TORQUE:
            along_command = self._held.commanded_reflex(signals(commanded, commanded))
        if self._tracked is not None:
            self.tracked_torques = np.array(
                [
                    self._read(name, self._tracked.torques(name, motion))
                    for name, motion in (
                        (MEASURED, measured),
                        (COMMANDED, lambda: signals(commanded, commanded)),
                    )
                ]
            )
        return on_plate, np.array([on_foot, reflex, along_command])

    def _read(self, name: str, torques: np.ndarray) -> np.ndarray:
        """Return torques of tracked terms as the sensor reads them, shape (1 + count, n)."""
        assert self._tracked is not None
        read = []
        for k, torque in enumerate(torques):
            see = self._sense if self._tracked.on_plate[k] else self._at_sensor
            read.append(see(f"tracked {k} {name}", torque))
        return np.array(read)


class _Connections:
    """Takes a motion along through uneven and loose parts of the drive: gear, worn shaft, gap."""

    def __init__(self, model: Model, names: tuple[str, ...], rate: float) -> None:
        self._rate = rate
        # In the order of the model, as it was fitted.
        entries = [entry for entry in model.entries if entry.term.name in names]
        self._parts = [(entry, entry.term.start(rate)) for entry in entries]

    @property
    def any(self) -> bool:
        """Tell whether the model has any of them."""
        return bool(self._parts)

    def run(self, motion: Motion) -> Motion:
        """Return the motion behind them; the same where there are none."""
        if not self._parts:
            return motion
        signals = Signals(self._rate, *motion)
        for entry, state in self._parts:
            entry.term.transform(signals, entry.values, state)
        return Motion(signals.foot_position, signals.foot_velocity, signals.foot_acceleration)


class _Fusion:
    """Fuses position from two channels: the encoder at low, the velocity at high frequencies.

    ``y = (x + T v) / (1 + T s)`` is x itself where v is its derivative; the noise of x counts below
    1 / T and that of v above.
    """

    def __init__(self, rate: float) -> None:
        self._lag = FirstOrder(rate)
        self._start = np.nan

    def run(self, motion: Motion) -> Motion:
        """Return the motion with the position of both channels."""
        if not np.isfinite(self._start):
            self._start = float(motion.position[0])
        both = motion.position - self._start + FUSION_TIME * motion.velocity
        return motion._replace(position=self._start + self._lag.run(both, FUSION_TIME))


def widened(samples: np.ndarray, reflex: ReflexColumns) -> np.ndarray:
    """Return a copy of samples with zeros in the columns of the reflex behind it.

    Parameters
    ----------
    samples
        Shape (n, k).
    reflex
        Says whether there are such columns.
    """
    columns = 0 if reflex is ReflexColumns.NONE else 2
    out = np.zeros((len(samples), samples.shape[1] + columns))
    out[:, : samples.shape[1]] = samples
    return out
