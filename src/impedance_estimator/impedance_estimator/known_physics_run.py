"""Samples are corrected by what is known of rig and subject.

The path from the sensors back to the joint is that of `known_physics`. The simultaneous estimator
also gets the torque of the calibrated reflex, along the motion and along the motion that the
reference commands, as regressors: it then follows how large the reflex is, not its shape.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from itertools import pairwise
from typing import NamedTuple

import numpy as np
from numba import njit

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.linear_dynamics import Delay, FirstOrder, SecondOrder
from ankle_physics.model import PLATE, Entry, Model, ModelRun
from ankle_physics.rig_file import LONGEST_DELAY
from ankle_physics.signals import Signals
from ankle_physics.term import Place, State
from impedance_estimator.known_physics import (
    ACTIVATION_TIME,
    REFLEX_WITH_GAIN,
    SUPPORTED_TERMS,
    KnownPhysics,
    shaping_terms,
)
from impedance_estimator.simultaneous.gaussian_derivatives import (
    gaussian_derivatives,
    weighted_channels,
)
from impedance_estimator.simultaneous.nuisance import (
    REFERENCE_FILTER_DAMPING,
    REFERENCE_FILTER_HZ,
)
from impedance_estimator.straps import Straps

SENSORS = (Place.TORQUE_SENSOR,)
WARM_UP = 0.1
"""The terms rest so long [s] before the first sample and after each gap: longer than every delay
and sensor's lag.
"""
LONGEST_STEP = 1.5
"""A step longer than so many sample intervals starts a new stretch."""
LEAST_PROJECTION = 0.2
"""A shape of which the plain reflex shows less cannot be followed; the standard error says so."""
SMOOTHING = 0.0015
"""[s] Standard deviation of the kernel before terms that run beside the regression: -3 dB at 88 Hz,
above what a perturbation moves."""
FUSION_TIME = 0.03
"""[s] Held terms follow the position below 5 Hz and the measured velocity above. An encoder's noise
of 0.07 mrad, differentiated, travels 10 mrad/s: friction that slips over 4 mrad would forget its
torque within half a second, though nothing moves. A velocity channel is ten times quieter."""
PROJECTION_TIME = 1.0
"""[s] Slower than this the voluntary torque hides the reflex."""


MEASURED, COMMANDED = "measured", "commanded"
_BEFORE_REFLEX = (Place.REFLEX_INPUT, Place.REFLEX_DYNAMICS, Place.ACTIVATION)
"""Terms there change what the reflex answers."""


class _Motion(NamedTuple):
    """Angle [rad], velocity [rad/s], acceleration [rad/s²] of plate or foot, each of shape (n,)."""

    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray


class KnownPhysicsRun:
    """Corrects one stream of samples; keeps all states between calls.

    Parameters
    ----------
    known
        Rig and subject.
    rate
        Sampling rate [Hz].
    measured_velocity
        Whether samples have a velocity.
    modelled_reflex
        Whether the torque of the reflex is given beside the samples instead of left in them.
    """

    def __init__(
        self,
        known: KnownPhysics,
        rate: float,
        measured_velocity: bool,
        modelled_reflex: bool = False,
    ) -> None:
        self._known = known
        self._rate = rate
        self._measured_velocity = measured_velocity
        self._modelled_reflex = modelled_reflex
        self._path: _Path | None = None
        self._newest = np.nan
        self._tracked = len(known.tracked)
        self.tracked_torques = np.zeros((2, 1 + self._tracked, 0))
        """Torque [N.m] of the calibrated reflex and of each tracked term at its calibrated size,
        along the motion and along that of the reference, for the samples of the last call; shape
        (2, 1 + count, n)."""

    def correct(self, samples: np.ndarray) -> np.ndarray:
        """Return samples as a joint alone would give them.

        Parameters
        ----------
        samples
            Shape (n, k): time [s], position [rad], velocity [rad/s] where measured, torque [N.m],
            and where there is one the reference [rad].

        Returns
        -------
        np.ndarray
            Shape (n, k). Samples that are not finite are passed on as they are. With a modelled
            reflex shape (n, k + 2): its torque [N.m] along the motion and along that of the
            reference.
        """
        samples = np.array(samples, dtype=float)
        out = _widened(samples, 2 * self._modelled_reflex)
        self.tracked_torques = np.zeros((2, 1 + self._tracked, len(samples)))
        used = 4 if self._measured_velocity else 3
        good, begins = _stretches(samples[:, :used], self._newest, LONGEST_STEP / self._rate)
        edges = [0, *(np.flatnonzero(begins[1:]) + 1).tolist(), len(samples)]
        for first, last in pairwise(edges):
            if first == last or not good[first]:
                continue
            if begins[first] or self._path is None:
                self._path = _Path(
                    self._known, self._rate, self._measured_velocity, self._modelled_reflex
                )
                self._path.settle(samples[first])
            out[first:last] = self._path.run(samples[first:last])
            if self._tracked:
                self.tracked_torques[:, :, first:last] = self._path.tracked_torques
        if len(samples):
            self._newest = samples[-1, 0] if good[-1] else np.nan
        return out

    @property
    def projection(self) -> float:
        """Return the share of a change of the reflex that the regression sees; see `_Extras`."""
        return 1.0 if self._path is None else self._path.projection

    def follow(self, stiffness: float) -> float:
        """Take over the estimated stiffness of the joint's core [N.m/rad].

        Returns
        -------
        float
            Share of a slow torque on the foot that reaches the plate [1]; 1 without straps.
        """
        if self._path is None or self._path.straps is None:
            return 1.0
        self._path.straps.follow(stiffness)
        return self._path.straps.share


@njit(cache=True)
def _stretches(samples: np.ndarray, newest: float, longest: float) -> tuple[np.ndarray, np.ndarray]:
    """Return which samples are finite, and which begin a stretch: after a gap, or not finite.

    Parameters
    ----------
    samples
        Shape (n, k), time [s] in the first column.
    newest
        Time of the sample before [s]; NaN where it was not finite or there was none.
    longest
        Step from which there is a gap [s].
    """
    good = np.empty(len(samples), np.bool_)
    begins = np.empty(len(samples), np.bool_)
    for k in range(len(samples)):
        good[k] = True
        for value in samples[k]:
            good[k] = good[k] and np.isfinite(value)
        step = samples[k, 0] - newest
        begins[k] = not (good[k] and abs(step) < longest)
        newest = samples[k, 0] if good[k] else np.nan
    return good, begins


def _widened(samples: np.ndarray, columns: int) -> np.ndarray:
    """Return a copy with so many columns of zeros behind it."""
    out = np.zeros((len(samples), samples.shape[1] + columns))
    out[:, : samples.shape[1]] = samples
    return out


class _Fusion:
    """Position from two channels: the encoder where it is slow, the velocity where it is fast.

    ``y = (x + T v) / (1 + T s)`` is x itself where v is its derivative; the noise of x counts below
    1 / T and that of v above.
    """

    def __init__(self, rate: float) -> None:
        self._lag = FirstOrder(rate)
        self._start = np.nan

    def run(self, motion: _Motion) -> _Motion:
        """Return the motion with the position of both channels."""
        if not np.isfinite(self._start):
            self._start = float(motion.position[0])
        both = motion.position - self._start + FUSION_TIME * motion.velocity
        return motion._replace(position=self._start + self._lag.run(both, FUSION_TIME))


class _Path:
    """From the sensors back to the joint, between two gaps."""

    def __init__(
        self, known: KnownPhysics, rate: float, measured_velocity: bool, modelled_reflex: bool
    ) -> None:
        model, rig = known.model, known.rig
        self._rate, self._measured = rate, measured_velocity
        self._modelled_reflex = modelled_reflex
        self._zero = (rig.zero_position, rig.zero_torque) if rig is not None else (0.0, 0.0)
        skew = known._value("channel_skew", "skew")
        slow_velocity = rig.velocity_delay.value if rig is not None else 0.0
        latest = max(skew, slow_velocity if measured_velocity else 0.0, 0.0)
        longest = 2.0 * LONGEST_DELAY
        self._delays = {
            "position": (Delay(rate, longest), latest),
            "velocity": (Delay(rate, longest), latest - slow_velocity),
            "torque": (Delay(rate, longest), latest - skew),
            "reference": (Delay(rate, longest), latest),
        }
        self._sensors = [
            entry
            for entry in model.entries
            if entry.term.place in SENSORS and entry.term.name != "channel_skew"
        ]
        self._sensor_states: dict[str, list[State]] = {}
        self.straps = Straps(model, rate, measured_velocity) if known.has_straps else None
        self._gap = model.entry("backlash") if model.has("backlash") else None
        self._gap_state = self._gap.term.start(rate) if self._gap is not None else {}
        self._plate_inertia = known.plate_inertia
        self._before: np.ndarray | None = None
        self._activation = FirstOrder(rate)
        self._extras = _Extras(model, rate, modelled_reflex)
        self._tracked = _TrackedTorques(known, rate, modelled_reflex) if known.tracked else None
        self.tracked_torques = np.zeros((2, 1 + len(known.tracked), 0))
        self._actuator = SecondOrder(rate)
        self._fusions = _Fusion(rate), _Fusion(rate)
        self._kernels = gaussian_derivatives(max(SMOOTHING, 0.8 / rate), rate)
        self._smoothing = self.straps is not None or self._extras.any

    @property
    def projection(self) -> float:
        """Return the share of a change of the reflex that the regression sees [1]."""
        return self._extras.projection

    def settle(self, sample: np.ndarray) -> None:
        """Start at rest with the values of a sample."""
        still = np.tile(sample, (round(WARM_UP * self._rate), 1))
        still[:, 0] = sample[0]
        if self._measured:
            still[:, 2] = 0.0
        if not np.isfinite(sample[-1]):
            still[:, -1] = 0.0
        self.run(still)

    def run(self, samples: np.ndarray) -> np.ndarray:
        """Return corrected samples of a stretch without gaps."""
        x = self._late("position", samples[:, 1] - self._zero[0])
        torque_column = 3 if self._measured else 2
        torque = self._late("torque", samples[:, torque_column] - self._zero[1])
        has_reference = samples.shape[1] > torque_column + 1
        reference = samples[:, -1] if has_reference else np.full(len(samples), np.nan)
        known = np.isfinite(reference)
        delayed = self._late("reference", np.where(known, reference, 0.0))
        # Without a measured velocity it is differentiated once the channels are even.
        v = self._late("velocity", samples[:, 2]) if self._measured else np.zeros(len(x))
        acceleration = np.zeros(len(x))
        if self._smoothing:
            x, v, torque, delayed, acceleration = self._smoothed(x, v, torque, delayed)
        plate = _Motion(x, v, acceleration)
        foot, added = plate, np.zeros(len(x))
        if self.straps is not None:
            # The plate moves otherwise than the foot: its inertia cannot be taken from I.
            added += self._plate_inertia * acceleration
            position, velocity, delayed = self.straps.foot(x, v, delayed)
            foot = _Motion(position, velocity, np.zeros(len(x)))
        if self._gap is not None:
            foot = self._behind_gap(foot)
        reflex = np.zeros((2, len(x)))
        if self._extras.any:
            held, reflex = self._modelled(plate, foot, delayed, torque)
            added += held
        # What the sensor sees of a torque, the regression sees of the motion that goes with it.
        out = _widened(samples, 2 * self._modelled_reflex)
        out[:, 1] = self._sense("position", foot.position)
        out[:, torque_column] = torque - self._sense("torque", added)
        if self._measured:
            out[:, 2] = self._sense("velocity", foot.velocity)
        if has_reference:
            out[:, samples.shape[1] - 1] = np.where(
                known, self._sense("reference", delayed), np.nan
            )
        if self._modelled_reflex:
            out[:, -2] = self._sense("reflex", reflex[0])
            out[:, -1] = self._sense("commanded reflex", reflex[1])
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
        now = np.vstack([x, v, torque, reference])
        if self._before is None:
            self._before = np.repeat(now[:, :1], kernels.shape[1] - 1, axis=1)
        joined = np.concatenate([self._before, now], axis=1)
        self._before = joined[:, -(kernels.shape[1] - 1) :]
        # The velocity channel is one derivative ahead of the position.
        source, ahead = (1, 0) if self._measured else (0, 1)
        weighted = weighted_channels(
            joined,
            kernels,
            np.array([[0, 0], [source, ahead], [2, 0], [3, 0], [source, ahead + 1]]),
        )
        return tuple(weighted)

    def _sense(self, channel: str, values: np.ndarray) -> np.ndarray:
        """Return a signal through the torque sensor's dynamics; each channel has its own state."""
        states = self._sensor_states.setdefault(
            channel, [entry.term.start(self._rate) for entry in self._sensors]
        )
        for entry, state in zip(self._sensors, states, strict=True):
            signals = Signals(self._rate, values, values, values)
            signals.torque = values
            entry.term.transform(signals, entry.values, state)
            values = signals.torque
        return values

    def _behind_gap(self, motion: _Motion) -> _Motion:
        """Return the motion of the foot that the plate takes along across a gap."""
        assert self._gap is not None
        signals = Signals(self._rate, *motion)
        self._gap.term.transform(signals, self._gap.values, self._gap_state)
        return _Motion(signals.foot_position, signals.foot_velocity, signals.foot_acceleration)

    def _modelled(
        self, plate: _Motion, foot: _Motion, reference: np.ndarray, torque: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the torque of the held terms [N.m], shape (n,), and of the reflex along the motion
        and along that of the reference, shape (2, n).
        """
        activation = self._activation.run(torque, ACTIVATION_TIME)

        def signals(at_plate: _Motion, at_foot: _Motion) -> Signals:
            made = Signals(self._rate, *at_plate, activation)
            made.move_foot(*at_foot)
            return made

        if self._measured:
            together = foot is plate
            plate = self._fusions[0].run(plate)
            foot = plate if together else self._fusions[1].run(foot)
        on_plate, on_foot, reflex = self._extras.torques(lambda: signals(plate, foot))
        commanded = np.zeros(len(torque))
        if self._modelled_reflex or self._tracked is not None:
            omega = 2.0 * np.pi * REFERENCE_FILTER_HZ
            nominal = _Motion(
                *self._actuator.run_with_rates(reference, omega, REFERENCE_FILTER_DAMPING)
            )
            if self._modelled_reflex:
                commanded = self._extras.commanded_reflex(signals(nominal, nominal))
            if self._tracked is not None:
                self.tracked_torques = np.array(
                    [
                        self._read(name, self._tracked.torques(name, motion))
                        for name, motion in (
                            (MEASURED, lambda: signals(plate, foot)),
                            (COMMANDED, lambda: signals(nominal, nominal)),
                        )
                    ]
                )
        if self.straps is not None:
            on_foot = self.straps.at_plate("held", on_foot)
            reflex = self.straps.at_plate("reflex", reflex)
            commanded = self.straps.at_plate("commanded", commanded)
        return on_plate + on_foot, np.array([reflex, commanded])

    def _read(self, name: str, torques: np.ndarray) -> np.ndarray:
        """Return torques of tracked terms as the sensor reads them, shape (1 + count, n)."""
        assert self._tracked is not None
        read = []
        for k, torque in enumerate(torques):
            channel = f"tracked {k} {name}"
            if self.straps is not None and not self._tracked.on_plate[k]:
                torque = self.straps.at_plate(channel, torque)
            read.append(self._sense(channel, torque))
        return np.array(read)


class _TrackedTorques:
    """The torque of the calibrated reflex and of each tracked term at its calibrated size."""

    def __init__(self, known: KnownPhysics, rate: float, modelled_reflex: bool) -> None:
        self._names = [entry.term.name for entry in known.tracked]
        self.on_plate = [False, *(entry.term.place in PLATE for entry in known.tracked)]
        # The sizes in force change; these are of the calibrated ones.
        entries = [Entry(e.term, dict(e.values)) for e in known.model.entries]
        used = [
            e
            for e in entries
            if e.term.name in self._names
            or _is_reflex(e)
            or (_is_held(e) and e.term.place in _BEFORE_REFLEX)
        ]
        plain = [e for e in entries if e.term.name == "reflex"]
        self._modelled = modelled_reflex
        self._runs = {name: (_run(used, rate), _run(plain, rate)) for name in (MEASURED, COMMANDED)}

    def torques(self, name: str, signals: Callable[[], Signals]) -> np.ndarray:
        """Return torques [N.m], shape (1 + count, n).

        Parameters
        ----------
        name
            `MEASURED` or `COMMANDED`: each motion has states of its own.
        signals
            Makes that motion; terms change it.
        """
        shaped, plain = self._runs[name]
        nothing = 0.0 * shaped.torque(signals())
        parts = shaped.parts
        if self._modelled:
            reflex = sum((t for name, t in parts.items() if name in REFLEX_WITH_GAIN), nothing)
        else:
            reflex = plain.torque(signals()) + nothing
        return np.array([reflex, *(parts[name] for name in self._names)])


class _Extras:
    """The torque that the held terms add to the joint's core."""

    def __init__(self, model: Model, rate: float, modelled_reflex: bool) -> None:
        held = [entry for entry in model.entries if _is_held(entry)]
        reflex = [entry for entry in model.entries if entry.term.name == "reflex"]
        self.any = bool(held) or modelled_reflex
        self._modelled = modelled_reflex
        self._plate = {e.term.name for e in held if e.term.place in PLATE}
        self._shaped = not modelled_reflex and bool(shaping_terms(model)) and bool(reflex)
        self._all = _run([*held, *(reflex if self._shaped or modelled_reflex else [])], rate)
        self._plain = _run(reflex, rate)
        self._commanded = _run(
            [e for e in (*held, *reflex) if e.term.place in _BEFORE_REFLEX or _is_reflex(e)], rate
        )
        self._slow = FirstOrder(rate), FirstOrder(rate)
        self._square = self._cross = 0.0

    @property
    def projection(self) -> float:
        """Return how much of the plain reflex a regression finds in the shaped one [1]; 1 without a
        shape.

        A reflex that is g times the calibrated one leaves (g - 1) times the shaped reflex beside
        the plain one, and only this share of it shows in the regression.
        """
        if not self._square > 0.0:
            return 1.0
        return max(self._cross / self._square, LEAST_PROJECTION)

    def torques(self, signals: Callable[[], Signals]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return the torque [N.m] on the plate and on the foot, and that of a modelled reflex (0
        where it is not modelled), each of shape (n,).

        Parameters
        ----------
        signals
            Makes the motion of plate and foot; terms change it.
        """
        whole = self._all.torque(signals())
        nothing = np.zeros(len(whole))
        parts = self._all.parts.items()
        plate = sum((torque for name, torque in parts if name in self._plate), nothing)
        reflex = sum((torque for name, torque in parts if name in REFLEX_WITH_GAIN), nothing)
        if self._modelled:
            return plate, whole - plate - reflex, reflex
        if not self._shaped:
            return plate, whole - plate, nothing
        plain = self._plain.torque(signals())
        a = plain - self._slow[0].run(plain, PROJECTION_TIME)
        b = reflex - self._slow[1].run(reflex, PROJECTION_TIME)
        self._square += float(a @ a)
        self._cross += float(a @ b)
        return plate, whole - plate - plain, nothing

    def commanded_reflex(self, signals: Signals) -> np.ndarray:
        """Return the torque of the modelled reflex along the motion of the reference [N.m].

        Parameters
        ----------
        signals
            That motion.
        """
        self._commanded.torque(signals)
        parts = self._commanded.parts.items()
        return sum(
            (torque for name, torque in parts if name in REFLEX_WITH_GAIN),
            np.zeros(len(signals.position)),
        )


def _is_reflex(entry: Entry) -> bool:
    return entry.term.name in REFLEX_WITH_GAIN


def _is_held(entry: Entry) -> bool:
    """Whether a term runs beside the regression and its torque is subtracted."""
    return not (
        entry.term.name in SUPPORTED_TERMS
        or entry.term.place in SENSORS
        or isinstance(entry.term, CompliantCoupling)
    )


def _run(entries: Sequence[Entry], rate: float) -> ModelRun:
    return Model([Entry(e.term, e.values) for e in entries]).start(rate)
