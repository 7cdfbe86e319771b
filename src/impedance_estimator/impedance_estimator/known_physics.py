"""Known physics of rig and subject, undone before the regression sees the samples.

A rig file says what lies between joint and sensors, a subject's model what the joint has beyond
inertia, viscosity, stiffness and reflex. Sample by sample, through the same term library that
simulates and diagnoses:

1. zeros are subtracted and the delays of torque and velocity are evened out;
2. the lag or mode of the torque sensor is applied to the motion, so that both have it, and to the
   rectified velocity, as the reflex answers the motion before the sensor;
3. friction and weight of the plate are subtracted, its inertia from the estimated I, behind straps
   from the torque;
4. straps: the foot's motion follows from the plate's (`straps`), and so behind a gap between both;
5. the torque of every other term along this motion is subtracted.

What is left is the torque of a joint with K, B, I and a reflex, which the estimator follows. A
reflex whose shape the calibration tells is a regressor of its own, with all that shapes it. The
stated K and G are again those of the whole joint at its operating point
(`ankle_physics.impedance`): what the held terms add to the tangent and to the reflex' area is
added to the estimate. `known_physics_run` and `known_physics_stream` carry it out.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from ankle_physics.compliant_coupling import CompliantCoupling
from ankle_physics.errors import ModelError
from ankle_physics.impedance import OperatingPoint, reflex_gain, tangent_stiffness
from ankle_physics.model import PAPER_TERMS, Entry, Model
from ankle_physics.rig_file import RigFile
from ankle_physics.term import REFLEX_PLACES, Place
from impedance_estimator.estimator import Expectation, ReflexColumns
from impedance_estimator.simultaneous.doubt import imprecision_doubt
from impedance_estimator.straps import coupling

SUPPORTED_TERMS = (
    *PAPER_TERMS,
    "backlash",
    "channel_skew",
    "cyclic_angle_error",
    "footplate_inertia",
    "lost_motion",
    "recovering_lost_motion",
    "servo_compliance",
    "uneven_angle",
    "voluntary_torque",
)
"""Terms that are not subtracted as a torque: those that are estimated, those that change the motion
or I, the servo's (the reference is the instrument for it), and voluntary torque, which is noise."""
RELATIVE_INERTIA_CHANGE = 0.05
"""The foot may lie otherwise in its straps than during the calibration: 5 % is a centimetre at the
heel."""
SHAPE_CHANGE = np.array([0.05, 0.05, 0.001])
"""ln ω, ln z and the delay [s] of the reflex change by this standard deviation within a session:
muscles slow down with fatigue by a few per cent."""
REFLEX_WITH_GAIN = frozenset({"reflex", "position_reflex_gain", "reflex_stiffening"})
"""The reflex and what changes its gain: they grow and shrink together as the subject changes it."""
LARGEST_GAIN_ERROR = 1.0 / 3.0
"""A reflex gain whose relative standard error [1] is larger says too little about its shape: the
estimator then goes on estimating the shape, too."""
LEAST_STIFFNESS = 1.0
"""[N.m/rad] No ankle is softer; bounds a relative error."""


@dataclass(frozen=True)
class KnownPhysics:
    """Holds a rig and a subject's model.

    Attributes
    ----------
    rig
        None: nothing is known of the rig.
    subject
        None: nothing is known of the subject.
    model
        Of both, without terms that follow the time of the recording that calibrated them, or the
        torque that the muscles hold.

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
            if entry.tracked and not _can_be_tracked(entry):
                raise ModelError(
                    f"term '{entry.term.name}' is marked as tracked; the estimator tracks "
                    f"{', '.join(PAPER_TERMS)}, and terms whose torque is subtracted, "
                    "proportional to a value above 0, and follows neither time nor the torque of "
                    "the muscles"
                )
        # What followed the time of the calibrating recording has another course now; K and G follow
        # it themselves. A reflex that went on weakening at its rate would vanish within minutes.
        # K and G follow the torque of the muscles, too: in the last second, which is all that an
        # estimate knows, the movement makes more of the torque than the muscles do.
        lasting = [e for e in model.entries if not (e.term.follows_time or e.term.follows_torque)]
        if len(lasting) < len(model.entries):
            model = Model(lasting)
        object.__setattr__(self, "model", model)

    @property
    def plate_inertia(self) -> float:
        """Return the inertia of the plate, which is in the measured torque and not in the joint
        [kg.m²].
        """
        return self._value("footplate_inertia", "Ip")

    @property
    def models_reflex(self) -> bool:
        """Tell whether the calibrated session tells the shape of the reflex, so that only its size
        has to be followed.
        """
        if not self.model.has("reflex"):
            return False
        return any(
            entry.values[p.symbol] > 0.0
            and entry.standard_errors.get(p.symbol, 0.0)
            <= LARGEST_GAIN_ERROR * float(entry.values[p.symbol])
            for entry in self.model.entries
            if entry.term.name in REFLEX_WITH_GAIN
            for p in entry.term.parameters
            if p.linear
        )

    @property
    def tracked(self) -> list[Entry]:
        """Return the terms beside the core whose size is estimated and not held."""
        return [e for e in self.model.entries if e.tracked and e.term.name not in PAPER_TERMS]

    @property
    def has_straps(self) -> bool:
        """Tell whether the foot moves otherwise than the plate."""
        return coupling(self.model) is not None

    @property
    def torque_sensors(self) -> list[Entry]:
        """Return the terms that filter the joint's torque at the sensor."""
        return [
            entry
            for entry in self.model.entries
            if entry.term.place is Place.TORQUE_SENSOR and entry.term.name != "channel_skew"
        ]

    @property
    def reflex_columns(self) -> ReflexColumns:
        """Return what the corrected samples can carry of the reflex."""
        if self.models_reflex:
            return ReflexColumns.TORQUE
        if self.torque_sensors:
            return ReflexColumns.STRETCH
        return ReflexColumns.NONE

    @property
    def calibrated_gain(self) -> float:
        """Return G of the reflex' core in the calibrated session [N.m.s/rad]; 0 where none is
        known.
        """
        return self._value("reflex", "G")

    def added_stiffness(self, position: float, torque: float, time: float) -> float:
        """Return the stiffness that the held terms add to the estimate [N.m/rad].

        Where the calibrated session states K, it is that at its own operating point, and another
        one changes it as it changes the tangent. A missing block may take a part of a stiffness
        that belongs to the joint.

        Parameters
        ----------
        position, torque
            Means of the memory [rad], [N.m].
        time
            Since the start [s].
        """
        at = OperatingPoint(position=position, torque=torque, time=time)
        stiffness = tangent_stiffness(self.model, at) + self._stiffness_beyond_model
        return stiffness - self._value("stiffness", "K")

    def added_gain(self, position: float, torque: float, time: float) -> float:
        """Return the reflex gain that the held terms add to the estimate [N.m.s/rad]; arguments as
        above.

        Where the calibrated session states G, it is that of its own movement, and the operating
        point changes it as it changes the response to the usual steps.
        """
        if not self.model.has("reflex") or not shaping_terms(self.model):
            return 0.0
        gain = reflex_gain(self.model, OperatingPoint(position, torque, time=time))
        return gain + self._gain_beyond_model - self._value("reflex", "G")

    @cached_property
    def _stiffness_beyond_model(self) -> float:
        return self._stated_beyond("K", tangent_stiffness)

    @cached_property
    def _gain_beyond_model(self) -> float:
        return self._stated_beyond("G", reflex_gain)

    def _stated_beyond(self, symbol: str, value: Callable[[Model, OperatingPoint], float]) -> float:
        """Return by how much K or G as the calibrated session states it is above that of the
        model there; 0 where the session states none.
        """
        subject = self.subject
        if subject is None or subject.stated_at is None or symbol not in subject.stated:
            return 0.0
        where = subject.stated_at
        there = OperatingPoint(where.position, where.torque, time=where.time)
        return float(subject.stated[symbol].value) - value(self.model, there)

    def expectation(self) -> Expectation:
        """Return what the calibrated session says about the joint's core before the first sample.

        Inertia is that of rigid bodies and the shape of the reflex that of a muscle: both change
        little within a session. K, B and G are what the subject changes.
        """
        mean, deviation = np.zeros(7), np.full(7, np.inf)
        if self.subject is None:
            return Expectation(mean, deviation, self.reflex_columns)
        if self.model.has("inertia"):
            # Without straps the plate moves with the foot, and its inertia is estimated with it.
            plate = 0.0 if self.has_straps else self.plate_inertia
            mean[2] = self._value("inertia", "I") + plate
            # A part that swings on the plate and the joint are told apart by its resonance alone.
            moved = mean[2] + self._value("plate_appendage", "Ia")
            deviation[2] = RELATIVE_INERTIA_CHANGE * moved
        if self.model.has("reflex"):
            mean[4] = np.log(self._value("reflex", "omega"))
            mean[5] = np.log(self._value("reflex", "z"))
            mean[6] = self._value("reflex", "delay")
            deviation[4:] = SHAPE_CHANGE
        return Expectation(mean, deviation, self.reflex_columns)

    def calibration_errors(self) -> tuple[float, float]:
        """Return the standard error of K [N.m/rad] and the relative one of G [1] in the calibrated
        session, which no later data take away: the held terms are as uncertain.

        The errors that the file states of the whole joint count where it does; else those of the
        core.
        """
        stated = self.subject.stated if self.subject is not None else {}
        stiffness = self._error("stiffness", "K")
        gain, error = self._value("reflex", "G"), self._error("reflex", "G")
        if "K" in stated:
            stiffness = stated["K"].standard_error
        if "G" in stated:
            gain, error = stated["G"]
        return stiffness, error / abs(gain) if gain != 0.0 else 0.0

    @property
    def calibration_doubt(self) -> float:
        """Return the doubt, 0 to 1, that the calibrated session leaves in every later estimate."""
        if self.subject is None or "K" not in self.subject.stated:
            return 0.0
        stiffness, gain = self.calibration_errors()
        return imprecision_doubt(
            stiffness / max(abs(self.subject.stated["K"].value), LEAST_STIFFNESS), gain
        )

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


def _can_be_tracked(entry: Entry) -> bool:
    """Return whether the size of a term is one more unknown of a linear regression."""
    term = entry.term
    if term.name in PAPER_TERMS:
        return True
    if term.follows_time or term.follows_torque:
        return False
    if term.name in SUPPORTED_TERMS or term.name in REFLEX_WITH_GAIN:
        return False
    if isinstance(term, CompliantCoupling) or term.place is Place.TORQUE_SENSOR:
        return False
    return bool(gains_of(entry, entry.values))


def gains_of(entry: Entry, values: Mapping[str, Any]) -> list[str]:
    """Return the symbols of the gains above 0 of a term: its torque is proportional to them.

    Parameters
    ----------
    entry
        The term in its model.
    values
        Of its parameters, by symbol.
    """
    return [p.symbol for p in entry.term.parameters if p.linear and float(values[p.symbol]) > 0.0]


def tracked_columns(known: KnownPhysics) -> tuple[str, ...]:
    """Return one column for each tracked gain and one for its standard error, as
    ``maxwell_relaxation.k[N.m/rad]`` and ``se_maxwell_relaxation.k[N.m/rad]``.

    Parameters
    ----------
    known
        Rig and subject.
    """
    return tuple(
        f"{prefix}{entry.term.name}.{entry.term.parameter(symbol).key}"
        for entry in known.tracked
        for symbol in gains_of(entry, entry.values)
        for prefix in ("", "se_")
    )


def shaping_terms(model: Model) -> list[Entry]:
    """Return terms that change what the reflex answers."""
    return [
        e
        for e in model.entries
        if e.term.name not in SUPPORTED_TERMS and e.term.place in REFLEX_PLACES
    ]


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
