"""Known physics of rig and subject, undone before the regression sees the samples.

A rig file says what lies between joint and sensors, a subject's model what the joint has beyond
inertia, viscosity, stiffness and reflex. Sample by sample, through the same term library that
simulates and diagnoses:

1. zeros are subtracted and the delays of torque and velocity are evened out;
2. the lag or mode of the torque sensor is applied to the motion, so that both have it;
3. friction and weight of the plate are subtracted, its inertia from the estimated I;
4. straps: the foot's motion follows from the plate's and the torque that the straps transmit; a
   gap between both: from the plate's alone;
5. the torque of every other term along this motion is subtracted.

What is left is the torque of a joint with K, B, I and a reflex, which the estimator follows. The
stated K and G are again those of the whole joint at its operating point
(`ankle_physics.impedance`): what the held terms add to the tangent and to the reflex' area is
added to the estimate.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from scipy import signal

from ankle_physics.errors import ModelError
from ankle_physics.impedance import OperatingPoint, reflex_gain, tangent
from ankle_physics.linear_dynamics import Delay, FirstOrder
from ankle_physics.model import PAPER_TERMS, Entry, Model, ModelRun
from ankle_physics.rig_file import LONGEST_DELAY, RigFile
from ankle_physics.signals import Signals
from ankle_physics.term import Place
from impedance_estimator.estimator import ESTIMATE_COLUMNS

SUPPORTED_TERMS = (
    *PAPER_TERMS,
    "backlash",
    "channel_skew",
    "fixation_compliance",
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
SMOOTHING_HZ = 150.0
"""The torque from which the foot's velocity in its straps follows is smoothed up to here [Hz].
Above the perturbation's band; torque, motion and reference are delayed alike.
"""
OPERATING_POINT_TIME = 10.0
"""Position and torque are averaged over so long [s]: half the estimator's memory."""
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
        self._strap = (
            model.entry("fixation_compliance") if model.has("fixation_compliance") else None
        )
        self._gap = model.entry("backlash") if model.has("backlash") else None
        self._gap_state = self._gap.term.start(rate) if self._gap is not None else {}
        self._plate_inertia = known.plate_inertia
        self._slope = 0.0
        self._last = np.nan
        self._stretch = FirstOrder(rate)
        self._smooth = signal.butter(2, min(SMOOTHING_HZ, 0.4 * rate), fs=rate, output="sos")
        self._smooth_states = [np.zeros((len(self._smooth), 2)) for _ in range(4)]
        self._activation = FirstOrder(rate)
        self._extras = _extra_runs(model, rate)

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
        v = self._late("velocity", samples[:, 2]) if self._measured else self._differentiate(x)
        x, v, delayed = (self._sense(k, values) for k, values in enumerate((x, v, delayed)))
        foot, foot_velocity = x, v
        if self._strap is not None:
            x, v, torque, delayed = (
                self._smoothed(k, values) for k, values in enumerate((x, v, torque, delayed))
            )
            foot, foot_velocity = self._foot(x, v, torque)
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

    def _differentiate(self, x: np.ndarray) -> np.ndarray:
        first = x[0] if not np.isfinite(self._last) else self._last
        self._last = float(x[-1])
        return np.diff(x, prepend=first) * self._rate

    def _sense(self, channel: int, values: np.ndarray) -> np.ndarray:
        """Return a signal of the motion through the torque sensor's dynamics."""
        for entry, state in self._sensors[channel]:
            signals = Signals(self._rate, values, values, values)
            signals.torque = values
            entry.term.transform(signals, entry.values, state)
            values = signals.torque
        return values

    def _smoothed(self, channel: int, values: np.ndarray) -> np.ndarray:
        out, self._smooth_states[channel] = signal.sosfilt(
            self._smooth, values, zi=self._smooth_states[channel]
        )
        return out

    def _foot(
        self, x: np.ndarray, v: np.ndarray, torque: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return the motion of the foot [rad], [rad/s] behind its straps."""
        assert self._strap is not None
        stiffness, damping = (float(self._strap.values[s]) for s in ("k_s", "b_s"))
        acceleration = np.diff(v, prepend=self._slope) * self._rate
        self._slope = float(v[-1])
        transmitted = torque - self._plate_inertia * acceleration
        stretch = self._stretch.run(transmitted / stiffness, damping / stiffness)
        return x - stretch, v - (transmitted - stiffness * stretch) / damping

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
        if not self._extras:
            return np.zeros(len(x))
        # Everything that is multiplied by an acceleration is estimated or in the plate's inertia.
        still = np.zeros(len(x))
        activation = self._activation.run(torque, ACTIVATION_TIME)
        total = np.zeros(len(x))
        for sign, run in self._extras:
            signals = Signals(self._rate, x, v, still, activation)
            signals.move_foot(foot, foot_velocity, still)
            total += sign * run.torque(signals)
        return total


def _extra_runs(model: Model, rate: float) -> list[tuple[float, ModelRun]]:
    """Return runs whose torques, with their signs, add up to what the held terms add to the
    joint's.
    """
    held = [
        entry
        for entry in model.entries
        if entry.term.name not in SUPPORTED_TERMS and entry.term.place not in SENSORS
    ]
    if not held:
        return []
    shaped = _shaped(model)
    reflex = [entry for entry in model.entries if entry.term.name == "reflex"]
    runs = [(1.0, _run([*held, *(reflex if shaped else [])], rate))]
    if shaped and reflex:
        runs.append((-1.0, _run(reflex, rate)))
    return runs


def _shaped(model: Model) -> list[Entry]:
    """Return terms that change what the reflex answers."""
    places = (Place.REFLEX_INPUT, Place.REFLEX_DYNAMICS)
    return [
        e for e in model.entries if e.term.name not in SUPPORTED_TERMS and e.term.place in places
    ]


def _run(entries: Sequence[Entry], rate: float) -> ModelRun:
    return Model([Entry(e.term, e.values) for e in entries]).start(rate)


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
        """State the contribution of the held terms at the present operating point."""
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

    def complete(self, rows: np.ndarray) -> np.ndarray:
        """Return estimates of the whole joint: with the held terms, without the plate."""
        rows = rows.copy()
        rows[:, ESTIMATE_COLUMNS.index("K[N.m/rad]")] += self._stiffness
        rows[:, ESTIMATE_COLUMNS.index("G[N.m.s/rad]")] += self._gain
        rows[:, ESTIMATE_COLUMNS.index("I[kg.m^2]")] -= self._known.plate_inertia
        return rows
