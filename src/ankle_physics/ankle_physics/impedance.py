"""K, B, I and G of any model are computed here at an operating point.

K, B and I are tangents of the torque of the joint's own terms without memory, about the mean
angle, against angle, velocity and acceleration. G is the torque impulse of the reflex to stretch
velocity for each radian of stretch, which for a linear reflex is the area of its impulse response.
What belongs to the rig, the coupling's own elasticity and what has memory count in none of them.

`effective_stiffness` is what a reader without a model would call stiffness in the same recording.
"""

from __future__ import annotations

import copy
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.model import Entry, Model
from ankle_physics.quintic import quintic_upsample
from ankle_physics.signals import Signals
from ankle_physics.term import REFLEX_PLACES, Owner, Place, Term

# Finite differences: far below the movements of any recording and far above rounding errors. The
# velocity lies below the threshold where friction or damping saturates.
ANGLE_DIFFERENCE = 1e-5  # rad
VELOCITY_DIFFERENCE = 1e-3  # rad/s
ACCELERATION_DIFFERENCE = 1e-2  # rad/s^2
# Terms that follow the time of the recording know it to a sixteenth of a second.
STATIC_RATE = 16.0  # Hz
# A rate at which the reflex' response and a step of 10 ms are sampled well.
RESPONSE_RATE = 2048.0  # Hz
# To which the torque on the foot is solved along these movements: 1e-7 of the stiffness that is
# stated, in half the rounds that a simulation takes.
RESPONSE_TOLERANCE = 1e-6
# Movements before those that count: depression and other memory of the reflex have settled.
SETTLING_TIME = 4.0  # s
# Movements that count: enough steps for a mean over their random levels and pauses.
TRAIN_TIME = 24.0  # s
# Of a recorded movement that is shorter than these two, the part that settles: as much as of them.
SETTLING_SHARE = 1.0 / 7.0
# After the last step the reflex' torque dies away (delays up to 0.2 s, slow muscles of 5 rad/s).
DECAY_TIME = 1.5  # s
# The band of slow responses below the reflex' and above the drift of voluntary torque.
EFFECTIVE_BAND = (0.5, 5.0)  # Hz
# Pauses of the train, relative to the mean pause: no periodicity that a term could lock to.
PAUSE_RANGE = (0.7, 1.3)
TRAIN_SEED = 2018
# Reflex arcs that answer position, and so count in the effective stiffness.
POSITION_ARCS = frozenset({"position_reflex", "length_threshold_reflex"})
# Reflex arcs that answer something else than the velocity of the calf's stretch.
NON_VELOCITY_ARCS = POSITION_ARCS | {"antagonist_reflex", "acceleration_reflex"}


@dataclass(frozen=True)
class Movement:
    """Holds a recorded movement of the plate, or a part of it.

    Attributes
    ----------
    rate
        [Hz].
    position, velocity, acceleration
        [rad, rad/s, rad/s^2], each of shape (n,).
    begin
        Of the run, when the first sample was taken [s].
    """

    rate: float
    position: np.ndarray
    velocity: np.ndarray
    acceleration: np.ndarray
    begin: float = 0.0


@dataclass(frozen=True)
class OperatingPoint:
    """Describes where the impedance of a model is stated: about one recording or one memory.

    Attributes
    ----------
    position
        Mean angle of the plate [rad].
    torque
        Mean measured torque [N.m]; a compliant fixation turns the foot back by it.
    activation
        Background torque of the muscles [N.m]. None: the level of the model's voluntary torque,
        and where it has none, the mean torque.
    time
        Middle of the recording [s] since its start; terms that drift are stated there.
    step
        Size of the recorded steps [rad].
    rise
        Duration of a step's edge [s].
    pause
        Mean time between edges [s].
    movement
        The recorded one, for which G is stated. None: a train of such steps.
    """

    position: float = 0.0
    torque: float = 0.0
    activation: float | None = None
    time: float = 30.0
    step: float = 0.04
    rise: float = 0.024
    pause: float = 0.35
    movement: Movement | None = None


@dataclass(frozen=True)
class Impedance:
    """Holds the impedance of a joint at an operating point.

    Attributes
    ----------
    K
        Elastic tangent stiffness [N.m/rad].
    B
        Viscosity [N.m.s/rad], mean of both directions.
    I
        Inertia [kg.m^2] of what moves with the foot.
    G
        Reflex gain: area of the impulse response to stretch velocity [N.m.s/rad].
    K_effective
        In-phase stiffness between 0.5 and 5 Hz [N.m/rad], without inertia and velocity reflex.
    """

    K: float
    B: float
    I: float
    G: float
    K_effective: float


def impedance(
    model: Model, at: OperatingPoint | None = None, effective: float | None = None
) -> Impedance:
    """State K, B, I, G and the effective stiffness of a model.

    Parameters
    ----------
    model
        Any list of terms; a parameter that is an array counts with its mean.
    at
        The operating point; None: the middle of a minute at rest, with the paper's pulses.
    effective
        Effective stiffness [N.m/rad], where a model that differs in no term of
        `shapes_effective_stiffness` has computed it already; None: it is computed here, which takes
        longest.

    Returns
    -------
    Impedance
        The values in SI units.
    """
    at = at or OperatingPoint()
    K, B, I = tangent(model, at)
    effective = effective_stiffness(model, at) if effective is None else effective
    return Impedance(K, B, I, reflex_gain(model, at), effective)


def shapes_effective_stiffness(term: Term) -> bool:
    """Say whether a term counts in the effective stiffness: those of the subject, without the
    reflexes but for one that answers position.
    """
    reflexes = (*REFLEX_PLACES, Place.ACTIVATION)
    return term.belongs_to is Owner.SUBJECT and (
        term.place not in reflexes or term.name in POSITION_ARCS
    )


def tangent(model: Model, at: OperatingPoint) -> tuple[float, float, float]:
    """Return the tangent stiffness [N.m/rad], viscosity [N.m.s/rad] and inertia [kg.m^2] of the
    joint.

    Parameters
    ----------
    model
        Any list of terms.
    at
        The operating point.

    Returns
    -------
    tuple[float, float, float]
        K, B and I by central differences of the elastic, viscous and inertial terms.
    """
    K, B, I = _slopes(model, at, 3)
    return K, B, I


def tangent_stiffness(model: Model, at: OperatingPoint) -> float:
    """Return the tangent stiffness of the joint alone [N.m/rad], as `tangent` states it.

    Parameters
    ----------
    model
        Any list of terms.
    at
        The operating point.
    """
    return _slopes(model, at, 1)[0]


def _slopes(model: Model, at: OperatingPoint, count: int) -> list[float]:
    """Return the first ones of the torque's slopes in position, velocity and acceleration."""
    entries = [
        entry
        for entry in model.entries
        if entry.term.place is Place.INTRINSIC
        and entry.term.belongs_to is Owner.SUBJECT
        and not entry.term.has_memory
    ]
    foot, activation = _foot_position(model, at), _activation(model, at)

    def torque(x: float, v: float, a: float) -> float:
        return _static_torque(entries, foot + x, v, a, activation, at.time)

    slopes = []
    sizes = (ANGLE_DIFFERENCE, VELOCITY_DIFFERENCE, ACCELERATION_DIFFERENCE)
    for axis, size in enumerate(sizes[:count]):
        step = np.zeros(3)
        step[axis] = size
        slopes.append((torque(*step) - torque(*-step)) / (2.0 * size))
    return slopes


def reflex_gain(model: Model, at: OperatingPoint) -> float:
    """Return the area of the reflex' impulse response to stretch velocity [N.m.s/rad].

    Over the recorded movement, or a train of steps of the recorded size: the reflex torque's
    integral over time divided by the angle through which the calf was stretched. For the paper's
    reflex this is G itself. A threshold, a saturation or a depression lowers it as it lowers the
    torque of that recording, and a power of the velocity weighs the velocities that were met.

    Parameters
    ----------
    model
        Any list of terms; 0 where it has no reflex.
    at
        The operating point.
    """
    reflexes = [
        entry
        for entry in model.entries
        if entry.term.place is Place.REFLEX_INPUT
        or (entry.term.place is Place.REFLEX_DYNAMICS and entry.term.name not in NON_VELOCITY_ARCS)
    ]
    if not any(entry.term.place is Place.REFLEX_DYNAMICS for entry in reflexes):
        return 0.0
    moved = at.movement or _train(at)
    rate = moved.rate
    # The plate rests in the end.
    motion = np.zeros((3, len(moved.position) + round(DECAY_TIME * rate)))
    motion[:, : len(moved.position)] = moved.position, moved.velocity, moved.acceleration
    motion[0, len(moved.position) :] = moved.position[-1]
    motion[0] += _foot_position(model, at) - at.position
    # The same movement that ends after settling: what is left of its last responses is taken off.
    first = motion.copy()
    settled = round(min(SETTLING_TIME * rate, SETTLING_SHARE * motion.shape[1]))
    first[0, settled:] = first[0, settled]
    first[1:, settled:] = 0.0
    activation = np.full(motion.shape[1], _activation(model, at))
    impulses = []
    for position, velocity, acceleration in (motion, first):
        signals = Signals(rate, position, velocity, acceleration, activation)
        impulses.append(np.sum(_torque_along(reflexes, signals, moved.begin)))
    stretches = [np.sum(np.maximum(velocity, 0.0)) for _, velocity, _ in (motion, first)]
    return float((impulses[0] - impulses[1]) / (stretches[0] - stretches[1]))


def effective_stiffness(model: Model, at: OperatingPoint) -> float:
    """Return the in-phase stiffness that steps of the recorded size meet between 0.5 and 5 Hz
    [N.m/rad].

    The torque of all terms of the subject along a train of steps, without the velocity reflex,
    which G states, and without inertia, regressed on the plate's angle within the band.

    Parameters
    ----------
    model
        Any list of terms; a compliant fixation gives way as in the recording.
    at
        The operating point.
    """
    entries = [entry for entry in model.entries if shapes_effective_stiffness(entry.term)]
    train = _train(at)
    position, acceleration = train.position, train.acceleration
    activation = np.full(len(position), _activation(model, at))
    signals = Signals(train.rate, position, train.velocity, acceleration, activation)
    torque = _torque_along(entries, signals, train.begin)
    inertia = sum(_mean(entry.values["I"]) for entry in entries if entry.term.name == "inertia")
    counted = slice(round(SETTLING_TIME * RESPONSE_RATE), None)
    torque = (torque - inertia * acceleration)[counted]
    window = np.hanning(len(torque))
    x = np.fft.rfft(window * (position[counted] - position[counted].mean()))
    t = np.fft.rfft(window * (torque - torque.mean()))
    frequency = np.fft.rfftfreq(len(torque), 1.0 / RESPONSE_RATE)
    band = (frequency >= EFFECTIVE_BAND[0]) & (frequency <= EFFECTIVE_BAND[1])
    return float(np.sum((t * x.conj()).real[band]) / np.sum(np.abs(x[band]) ** 2))


def _static_torque(
    entries: list[Entry], x: float, v: float, a: float, activation: float, time: float
) -> float:
    """Return the torque [N.m] of memoryless terms at a constant state, `time` seconds into the
    run.
    """
    total = 0.0
    for entry in entries:
        held = [np.array([value]) for value in (x, v, a, activation)]
        signals = Signals(STATIC_RATE, held[0], held[1], held[2], held[3])
        state = entry.term.start(STATIC_RATE)
        if "run_time" in state:
            state["run_time"].skip(max(time, 0.0))
        columns = entry.term.torque(signals, _means(entry.values), state)
        total += sum(
            _mean(entry.values[symbol]) * float(column[-1]) for symbol, column in columns.items()
        )
    return total


def _activation(model: Model, at: OperatingPoint) -> float:
    if at.activation is not None:
        return at.activation
    if model.has("voluntary_torque"):
        return _mean(model.entry("voluntary_torque").values["level"])
    return at.torque


def _foot_position(model: Model, at: OperatingPoint) -> float:
    """Return the mean angle of the foot [rad]: the plate's, less what a fixation gives way under
    the load.
    """
    for entry in model.entries:
        if isinstance(entry.term, CompliantCoupling):
            stiffness, _ = entry.term.linearised(_means(entry.values))
            return at.position - at.torque / stiffness
    return at.position


def _train(at: OperatingPoint) -> Movement:
    """Return a movement of steps up and down at random times about the mean angle, with quintic
    edges; the stretch that counts is about `OperatingPoint.time`.
    """
    random = np.random.default_rng(TRAIN_SEED)
    knots = [np.array([at.position - 0.5 * at.step, 0.0, 0.0])]
    parts = []
    rise = max(2, round(at.rise * RESPONSE_RATE))
    length, level = 0, -1.0
    needed = round((SETTLING_TIME + TRAIN_TIME) * RESPONSE_RATE)
    while length < needed:
        pause = max(1, round(at.pause * random.uniform(*PAUSE_RANGE) * RESPONSE_RATE) - rise)
        rest = np.repeat(knots[-1][:, None], pause, axis=1)
        level = -level
        knots.append(np.array([at.position + 0.5 * level * at.step, 0.0, 0.0]))
        edge = quintic_upsample(np.array(knots[-2:]), rise, rise / RESPONSE_RATE)
        parts += [rest, edge]
        length += pause + rise
    parts.append(np.repeat(knots[-1][:, None], round(DECAY_TIME * RESPONSE_RATE), axis=1))
    position, velocity, acceleration = np.concatenate(parts, axis=1)
    begin = at.time - SETTLING_TIME - 0.5 * TRAIN_TIME
    return Movement(RESPONSE_RATE, position, velocity, acceleration, begin)


def _torque_along(entries: list[Entry], signals: Signals, begin: float) -> np.ndarray:
    """Return the torque [N.m] of the terms, shape (n,), of a movement that begins at a time of the
    run [s].
    """
    held = copy.deepcopy(entries)
    for entry in held:
        entry.values = _means(entry.values)
    run = Model(held).start(signals.rate, tolerance=RESPONSE_TOLERANCE)
    run.advance_clock(begin)
    return run.torque(signals)


def _means(values: Mapping[str, Any]) -> dict[str, Any]:
    return {symbol: _mean(value) for symbol, value in values.items()}


def _mean(value: Any) -> float:
    return value if isinstance(value, float) else float(np.mean(value))
