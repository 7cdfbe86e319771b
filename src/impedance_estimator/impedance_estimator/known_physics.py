"""Known physics of rig and subject, undone before the regression sees the samples.

A rig file says what lies between joint and sensors, a subject's model what the joint has beyond
inertia, viscosity, stiffness and reflex. Sample by sample, through the same term library that
simulates and diagnoses:

1. zeros are subtracted and the delays of torque and velocity are evened out;
2. the lag or mode of the torque sensor is applied to the motion, so that both have it;
3. friction and weight of the plate are subtracted, its inertia from the estimated I, behind straps
   from the torque;
4. straps: the foot's motion follows from the plate's (`straps`), and so behind a gap between both;
5. the torque of every other term along this motion is subtracted.

What is left is the torque of a joint with K, B, I and a reflex, which the estimator follows. The
stated K and G are again those of the whole joint at its operating point
(`ankle_physics.impedance`): what the held terms add to the tangent and to the reflex' area is
added to the estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy import signal

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.errors import ModelError
from ankle_physics.impedance import OperatingPoint, reflex_gain, tangent
from ankle_physics.linear_dynamics import Delay, FirstOrder
from ankle_physics.model import PAPER_TERMS, Entry, Model, ModelRun
from ankle_physics.rig_file import LONGEST_DELAY, RigFile
from ankle_physics.signals import Signals
from ankle_physics.term import Place
from impedance_estimator.estimator import ESTIMATE_COLUMNS, Expectation
from impedance_estimator.straps import Straps, coupling

SUPPORTED_TERMS = (
    *PAPER_TERMS,
    "backlash",
    "channel_skew",
    "footplate_inertia",
    "servo_compliance",
    "voluntary_torque",
)
"""Terms that are not subtracted as a torque: those that are estimated, those that change the motion
or I, the servo's (the reference is the instrument for it), and voluntary torque, which is noise."""
SENSORS = (Place.TORQUE_SENSOR,)
WARM_UP = 0.1
"""The terms rest so long [s] before the first sample and after each gap: longer than every delay
and sensor's lag.
"""
LONGEST_STEP = 1.5
"""A step longer than so many sample intervals starts a new stretch."""
OPERATING_POINT_TIME = 10.0
"""Position and torque are averaged over so long [s]: half the estimator's memory."""
RELATIVE_INERTIA_CHANGE = 0.05
"""The foot may lie otherwise in its straps than during the calibration: 5 % is a centimetre at the
heel."""
SHAPE_CHANGE = np.array([0.05, 0.05, 0.001])
"""ln ω, ln z and the delay [s] of the reflex change by this standard deviation within a session:
muscles slow down with fatigue by a few per cent."""
REFLEX_WITH_GAIN = frozenset(
    {"reflex", "activation_reflex_gain", "position_reflex_gain", "reflex_drift"}
)
"""The reflex and what changes its gain: they grow and shrink together as the subject changes it."""
LEAST_PROJECTION = 0.2
"""A shape of which the plain reflex shows less cannot be followed; the standard error says so."""
PROJECTION_TIME = 1.0
"""[s] Slower than this the voluntary torque hides the reflex."""
ACTIVATION_TIME = 1.0
"""Torque is averaged over so long [s] for terms that follow the muscles' activation."""


@dataclass(frozen=True)
class KnownPhysics:
    """A rig and a subject's model.

    Attributes
    ----------
    rig
        None: nothing is known of the rig.
    subject
        None: nothing is known of the subject.

    Raises
    ------
    ModelError
        A term marked ``tracked`` that the estimator cannot follow.
    """

    rig: RigFile | None = None
    subject: Model | None = None
    model: Model = field(init=False)

    def __post_init__(self) -> None:
        subject = self.subject if self.subject is not None else Model([])
        model = subject if self.rig is None else self.rig.twin(subject)
        for entry in model.entries:
            if entry.tracked and entry.term.name not in PAPER_TERMS:
                raise ModelError(
                    f"term '{entry.term.name}' is marked as tracked; the estimator tracks "
                    f"{', '.join(PAPER_TERMS)} and holds the others"
                )
        object.__setattr__(self, "model", model)

    @property
    def plate_inertia(self) -> float:
        """Inertia of the plate, which is in the measured torque and not in the joint [kg.m²]."""
        return self._value("footplate_inertia", "Ip")

    @property
    def has_straps(self) -> bool:
        """Whether the foot moves otherwise than the plate."""
        return coupling(self.model) is not None

    @property
    def calibrated_gain(self) -> float:
        """G of the reflex' core in the calibrated session [N.m.s/rad]; 0 where none is known."""
        return self._value("reflex", "G")

    def added_stiffness(self, position: float, torque: float, time: float) -> float:
        """Return the stiffness that the held terms add to the estimate [N.m/rad].

        Parameters
        ----------
        position, torque
            Means of the memory [rad], [N.m].
        time
            Since the start [s].
        """
        at = OperatingPoint(position=position, torque=torque, time=time)
        return tangent(self.model, at)[0] - self._value("stiffness", "K")

    def added_gain(self, position: float, torque: float, time: float) -> float:
        """Return the reflex gain that the held terms add to the estimate [N.m.s/rad]; arguments as
        above.
        """
        if not self.model.has("reflex") or not _shaped(self.model):
            return 0.0
        at = OperatingPoint(position=position, torque=torque, time=time)
        return reflex_gain(self.model, at) - self._value("reflex", "G")

    def expectation(self) -> Expectation:
        """Return what the calibrated session says about the joint's core before the first sample.

        Inertia is that of rigid bodies and the shape of the reflex that of a muscle: both change
        little within a session. K, B and G are what the subject changes.
        """
        mean, deviation = np.zeros(7), np.full(7, np.inf)
        if self.subject is None:
            return Expectation(mean, deviation)
        if self.model.has("inertia"):
            # Without straps the plate moves with the foot, and its inertia is estimated with it.
            plate = 0.0 if self.has_straps else self.plate_inertia
            mean[2] = self._value("inertia", "I") + plate
            deviation[2] = RELATIVE_INERTIA_CHANGE * mean[2]
        if self.model.has("reflex"):
            mean[4] = np.log(self._value("reflex", "omega"))
            mean[5] = np.log(self._value("reflex", "z"))
            mean[6] = self._value("reflex", "delay")
            deviation[4:] = SHAPE_CHANGE
        return Expectation(mean, deviation)

    def calibration_errors(self) -> tuple[float, float]:
        """Return the standard error of K [N.m/rad] and the relative one of G [1] in the calibrated
        session, which no later data take away: the held terms are as uncertain.
        """
        stiffness = self._error("stiffness", "K")
        gain = self._value("reflex", "G")
        return stiffness, self._error("reflex", "G") / gain if gain > 0.0 else 0.0

    def _error(self, term: str, symbol: str) -> float:
        if not self.model.has(term):
            return 0.0
        return float(self.model.entry(term).standard_errors.get(symbol, 0.0))

    def _value(self, term: str, symbol: str) -> float:
        return float(self.model.entry(term).values[symbol]) if self.model.has(term) else 0.0

    def describe(self) -> str:
        """Return in one line which terms are used."""
        names = [e.term.name for e in self.model.entries if e.term.name not in PAPER_TERMS]
        return ", ".join(names) or "inertia, viscosity, stiffness and reflex alone"


def load_known_physics(model: str = "", rig: str = "") -> KnownPhysics | None:
    """Return known physics from a model file and a rig file; an empty name is none, None where both
    are.

    Raises
    ------
    ModelError
        A file that is no model or rig file, or a term that cannot be tracked.
    OSError
        A file that cannot be read.
    """
    if not model and not rig:
        return None
    return KnownPhysics(RigFile.load(rig) if rig else None, Model.load(model) if model else None)


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
    """

    def __init__(self, known: KnownPhysics, rate: float, measured_velocity: bool) -> None:
        self._known = known
        self._rate = rate
        self._measured_velocity = measured_velocity
        self._path: _Path | None = None
        self._newest = np.nan

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
            The same shape. Samples that are not finite are passed on as they are.
        """
        samples = np.array(samples, dtype=float)
        used = 4 if self._measured_velocity else 3
        good = np.isfinite(samples[:, :used]).all(axis=1)
        steps = np.diff(samples[:, 0], prepend=self._newest) * self._rate
        begins = ~(good & (np.abs(steps) < LONGEST_STEP)) | ~np.concatenate(
            [[np.isfinite(self._newest)], good[:-1]]
        )
        edges = [*np.flatnonzero(begins).tolist(), len(samples)]
        if not edges or edges[0] != 0:
            edges.insert(0, 0)
        for first, last in pairwise(edges):
            if first == last or not good[first]:
                continue
            if begins[first] or self._path is None:
                self._path = _Path(self._known, self._rate, self._measured_velocity)
                self._path.settle(samples[first])
            samples[first:last] = self._path.run(samples[first:last])
        if len(samples):
            self._newest = samples[-1, 0] if good[-1] else np.nan
        return samples

    @property
    def projection(self) -> float:
        """Share of a change of the reflex that the regression sees [1]; see `_Extras`."""
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


class _Path:
    """From the sensors back to the joint, between two gaps."""

    def __init__(self, known: KnownPhysics, rate: float, measured_velocity: bool) -> None:
        model, rig = known.model, known.rig
        self._rate, self._measured = rate, measured_velocity
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
            [
                (entry, entry.term.start(rate))
                for entry in model.entries
                if entry.term.place in SENSORS and entry.term.name != "channel_skew"
            ]
            for _ in range(3)
        ]
        self.straps = Straps(model, rate, measured_velocity) if known.has_straps else None
        self._gap = model.entry("backlash") if model.has("backlash") else None
        self._gap_state = self._gap.term.start(rate) if self._gap is not None else {}
        self._plate_inertia = known.plate_inertia
        self._before: np.ndarray | None = None
        self._activation = FirstOrder(rate)
        self._extras = _Extras(model, rate)
        self._centred = self.straps is not None or (self._extras.any and not measured_velocity)

    @property
    def projection(self) -> float:
        """Share of a change of the reflex that the regression sees [1]."""
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
        x, v, delayed = (self._sense(k, values) for k, values in enumerate((x, v, delayed)))
        acceleration = np.zeros(len(x))
        if self._centred:
            x, v, torque, delayed, acceleration = self._centre(x, v, torque, delayed)
        foot, foot_velocity = x, v
        if self.straps is not None:
            # The plate moves otherwise than the foot: its inertia cannot be taken from I.
            torque = torque - self._plate_inertia * acceleration
            foot, foot_velocity, delayed = self.straps.foot(x, v, delayed)
        if self._gap is not None:
            foot, foot_velocity = self._behind_gap(foot, foot_velocity)
        torque = torque - self._extra_torque(x, v, foot, foot_velocity, torque)
        out = samples.copy()
        out[:, 1], out[:, torque_column] = foot, torque
        if self._measured:
            out[:, 2] = foot_velocity
        if has_reference:
            out[:, -1] = np.where(known, delayed, np.nan)
        return out

    def _late(self, name: str, values: np.ndarray) -> np.ndarray:
        delay, seconds = self._delays[name]
        return delay.run(values, seconds)

    def _centre(
        self, x: np.ndarray, v: np.ndarray, torque: np.ndarray, reference: np.ndarray
    ) -> tuple[np.ndarray, ...]:
        """Return all signals a sample later, with derivatives about that sample.

        A backward difference is half a sample late, which at 1 kHz is as much as a skew.
        """
        now = np.column_stack([x, v, torque, reference])
        before = now[[0, 0]] if self._before is None else self._before
        joined = np.concatenate([before, now])
        self._before = joined[-2:]
        middle = joined[1:-1]
        if self._measured:
            velocity = middle[:, 1]
            acceleration = (joined[2:, 1] - joined[:-2, 1]) * self._rate / 2.0
        else:
            velocity = (joined[2:, 0] - joined[:-2, 0]) * self._rate / 2.0
            acceleration = (joined[2:, 0] - 2.0 * middle[:, 0] + joined[:-2, 0]) * self._rate**2
        return middle[:, 0], velocity, middle[:, 2], middle[:, 3], acceleration

    def _sense(self, channel: int, values: np.ndarray) -> np.ndarray:
        """Return a signal of the motion through the torque sensor's dynamics."""
        for entry, state in self._sensors[channel]:
            signals = Signals(self._rate, values, values, values)
            signals.torque = values
            entry.term.transform(signals, entry.values, state)
            values = signals.torque
        return values

    def _behind_gap(
        self, position: np.ndarray, velocity: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Motion of the foot [rad], [rad/s] that the plate takes along across a gap."""
        assert self._gap is not None
        signals = Signals(self._rate, position, velocity, np.zeros(len(position)))
        self._gap.term.transform(signals, self._gap.values, self._gap_state)
        return signals.foot_position, signals.foot_velocity

    def _extra_torque(
        self,
        x: np.ndarray,
        v: np.ndarray,
        foot: np.ndarray,
        foot_velocity: np.ndarray,
        torque: np.ndarray,
    ) -> np.ndarray:
        if not self._extras.any:
            return np.zeros(len(x))
        # Everything that is multiplied by an acceleration is estimated or in the plate's inertia.
        still = np.zeros(len(x))
        activation = self._activation.run(torque, ACTIVATION_TIME)

        def signals() -> Signals:
            made = Signals(self._rate, x, v, still, activation)
            made.move_foot(foot, foot_velocity, still)
            return made

        total = self._extras.torque(signals)
        return total if self.straps is None else self.straps.at_plate(total)


class _Extras:
    """The torque that the held terms add to the joint's core."""

    def __init__(self, model: Model, rate: float) -> None:
        held = [entry for entry in model.entries if _is_held(entry)]
        reflex = [entry for entry in model.entries if entry.term.name == "reflex"]
        self.any = bool(held)
        self._shaped = bool(_shaped(model)) and bool(reflex)
        self._all = _run([*held, *(reflex if self._shaped else [])], rate)
        self._plain = _run(reflex, rate)
        self._slow = FirstOrder(rate), FirstOrder(rate)
        self._square = self._cross = 0.0

    @property
    def projection(self) -> float:
        """How much of the plain reflex a regression finds in the shaped one [1]; 1 without a shape.

        A reflex that is g times the calibrated one leaves (g - 1) times the shaped reflex beside
        the plain one, and only this share of it shows in the regression.
        """
        if not self._square > 0.0:
            return 1.0
        return max(self._cross / self._square, LEAST_PROJECTION)

    def torque(self, signals: Callable[[], Signals]) -> np.ndarray:
        """Return their torque [N.m], shape (n,).

        Parameters
        ----------
        signals
            Makes the motion of plate and foot; terms change it.
        """
        whole = self._all.torque(signals())
        if not self._shaped:
            return whole
        plain = self._plain.torque(signals())
        shaped = sum(
            (part for name, part in self._all.parts.items() if name in REFLEX_WITH_GAIN),
            np.zeros(len(whole)),
        )
        a = plain - self._slow[0].run(plain, PROJECTION_TIME)
        b = shaped - self._slow[1].run(shaped, PROJECTION_TIME)
        self._square += float(a @ a)
        self._cross += float(a @ b)
        return whole - plain


def _is_held(entry: Entry) -> bool:
    """Whether a term runs beside the regression and its torque is subtracted."""
    return not (
        entry.term.name in SUPPORTED_TERMS
        or entry.term.place in SENSORS
        or isinstance(entry.term, CompliantCoupling)
    )


def _shaped(model: Model) -> list[Entry]:
    """Return terms that change what the reflex answers."""
    places = (Place.REFLEX_INPUT, Place.REFLEX_DYNAMICS)
    return [
        e for e in model.entries if e.term.name not in SUPPORTED_TERMS and e.term.place in places
    ]


def _run(entries: Sequence[Entry], rate: float) -> ModelRun:
    return Model([Entry(e.term, e.values) for e in entries]).start(rate)


_STATED = ("K[N.m/rad]", "G[N.m.s/rad]", "I[kg.m^2]")


class KnownPhysicsStream:
    """Corrects samples, and states what the held terms contribute to the estimates.

    Parameters
    ----------
    known, rate, measured_velocity
        As for `KnownPhysicsRun`.
    """

    def __init__(self, known: KnownPhysics, rate: float, measured_velocity: bool) -> None:
        self._known = known
        self._rate = rate
        self._columns = (1, 3 if measured_velocity else 2)
        rig = known.rig
        self._zeros = (rig.zero_position, rig.zero_torque) if rig is not None else (0.0, 0.0)
        self._run = KnownPhysicsRun(known, rate, measured_velocity)
        self._means = [np.nan, np.nan]
        self._samples = 0
        self._stiffness, self._gain = 0.0, 0.0
        self._stated = False
        self._core_stiffness = np.nan
        self._share = 1.0

    def correct(self, samples: np.ndarray) -> np.ndarray:
        """Correct samples as `KnownPhysicsRun.correct` does; position and torque are averaged on
        the way.
        """
        decay = np.exp(-1.0 / (OPERATING_POINT_TIME * self._rate))
        for k, column in enumerate(self._columns):
            values = samples[np.isfinite(samples[:, column]), column]
            if len(values):
                if not np.isfinite(self._means[k]):
                    self._means[k] = values[0]
                out, _ = signal.lfilter(
                    [1.0 - decay], [1.0, -decay], values, zi=[decay * self._means[k]]
                )
                self._means[k] = float(out[-1])
        self._samples += len(samples)
        return self._run.correct(samples)

    def restate(self) -> None:
        """State the contribution of the held terms at the present operating point, and let the foot
        in its straps follow the stiffness.
        """
        position, torque = (
            mean - zero for mean, zero in zip(self._means, self._zeros, strict=True)
        )
        time = self._samples / self._rate
        if np.isfinite(position + torque):
            stiffness = self._known.added_stiffness(position, torque, time)
            self._stiffness = stiffness
            if not self._stated:
                # The reflex' area is simulated, which takes a few milliseconds: once.
                self._gain = self._known.added_gain(position, torque, time)
                self._stated = True
        self._share = self._run.follow(self._core_stiffness)

    def complete(self, rows: np.ndarray) -> np.ndarray:
        """Return estimates of the whole joint: with the held terms, without the plate.

        The standard errors hold those of the calibrated session, too.
        """
        rows = rows.copy()
        K, G, I = (ESTIMATE_COLUMNS.index(name) for name in _STATED)
        error_K, error_G = (ESTIMATE_COLUMNS.index(f"se_{name}") for name in _STATED[:2])
        if len(rows) and rows[-1, ESTIMATE_COLUMNS.index("valid[1]")] > 0.0:
            self._core_stiffness = float(rows[-1, K])
        rows[:, K] += self._stiffness
        if not self._known.has_straps:
            rows[:, I] -= self._known.plate_inertia
        rows[:, [G, error_G]] /= self._share
        calibrated = self._known.calibrated_gain
        if calibrated > 0.0:
            # The whole reflex changes in proportion, and its core shows a share of the change.
            slope = (calibrated + self._gain) / (calibrated * self._run.projection)
            rows[:, G] = calibrated + self._gain + slope * (rows[:, G] - calibrated)
            rows[:, error_G] *= abs(slope)
        stiffness_error, gain_error = self._known.calibration_errors()
        rows[:, error_K] = np.hypot(rows[:, error_K], stiffness_error)
        rows[:, error_G] = np.hypot(rows[:, error_G], gain_error * rows[:, G])
        return rows
