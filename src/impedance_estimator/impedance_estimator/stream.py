"""Blocks of samples become estimates on one path that node, replay and file share.

The sampling rate is taken from the first 256 samples; samples are judged by their own time, never
by when their block came. So the result is a function of the samples alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ankle_interfaces.block import Block, require_columns
from ankle_interfaces.continuity import sampling_rate
from ankle_interfaces.topics import ANKLE_SAMPLES, PERTURBATION_REFERENCE
from ankle_interfaces.units import split_column
from impedance_estimator.algorithms import ALGORITHMS, DEFAULT, make_estimator
from impedance_estimator.estimator import ESTIMATE_COLUMNS, TORQUE_COLUMNS, Estimator
from impedance_estimator.judgements import Judgement
from impedance_estimator.known_physics import KnownPhysics, tracked_columns
from impedance_estimator.known_physics_stream import KnownPhysicsStream
from impedance_estimator.reference_track import ReferenceTrack
from impedance_estimator.rig_watch import RigWatch
from impedance_estimator.settings import EstimatorSettings
from impedance_estimator.simultaneous.doubt import DOUBT_THRESHOLD
from impedance_estimator.validity import RATE_WINDOW
from impedance_estimator.velocity_watch import VelocityWatch

TOPIC, REFERENCE_TOPIC = ANKLE_SAMPLES.absolute, PERTURBATION_REFERENCE.absolute
POSITION, VELOCITY, TORQUE = "position[rad]", "velocity[rad/s]", "torque[N.m]"
RIG_RATE = 2048.0
"""The rig of van 't Veld et al. 2018, section III-B.1, samples at this rate [Hz]."""
COMPILATION_DURATION = 2.0
"""So many seconds of samples go through everything once: a block of the simultaneous estimator is
complete after half a second.
"""
UNCERTAIN_CALIBRATION = (
    "the calibrated session knows K no better than to 14 % or G no better than to 12 %"
)
RESPONSE_RATE = 2.0
"""So many reflex impulse responses are sent per second [Hz]."""


@dataclass
class Estimates:
    """Holds the rows and responses that became due.

    Attributes
    ----------
    rows
        Shape (k, 13), columns `ESTIMATE_COLUMNS`.
    responses
        (t [s], shape (L, 3) with columns `REFLEX_COLUMNS`) for each reflex impulse response.
    torques
        Shape (j, 4), columns `TORQUE_COLUMNS`.
    notes
        What happened to the stream, one sentence each.
    judgements
        Why estimates were not valid or doubted, as often as the impulse responses.
    tracked
        Time [s], and each gain that the model marks as tracked with its standard error, as often as
        the impulse responses; shape (k, 1 + m), columns `EstimateStream.tracked_columns`.
    """

    rows: np.ndarray
    responses: list[tuple[float, np.ndarray]]
    torques: np.ndarray
    notes: list[str]
    judgements: list[Judgement] = field(default_factory=list)
    tracked: np.ndarray = field(default_factory=lambda: np.empty((0, 1)))


@dataclass
class _Parts:
    rows: list[np.ndarray] = field(default_factory=list)
    responses: list[tuple[float, np.ndarray]] = field(default_factory=list)
    torques: list[np.ndarray] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    judgements: list[Judgement] = field(default_factory=list)
    tracked: list[np.ndarray] = field(default_factory=list)

    def joined(self, tracked_columns: int) -> Estimates:
        rows = np.concatenate(self.rows) if self.rows else np.empty((0, len(ESTIMATE_COLUMNS)))
        torques = (
            np.concatenate(self.torques) if self.torques else np.empty((0, len(TORQUE_COLUMNS)))
        )
        tracked = np.array(self.tracked).reshape(-1, 1 + tracked_columns)
        return Estimates(rows, self.responses, torques, self.notes, self.judgements, tracked)


class EstimateStream:
    """Estimates from one stream of samples.

    Parameters
    ----------
    algorithm
        A name in `algorithms.ALGORITHMS`.
    settings
        Settings of the algorithm; None stands for the defaults.
    known
        Physics of rig and subject that is known beforehand; None: nothing is.

    Raises
    ------
    ValueError
        An unknown algorithm, or settings of another one.
    """

    def __init__(
        self,
        algorithm: str = DEFAULT,
        settings: EstimatorSettings | None = None,
        known: KnownPhysics | None = None,
    ) -> None:
        self.algorithm = algorithm
        self.known = known
        self._tracked_columns = () if known is None else tracked_columns(known)
        self._physics: KnownPhysicsStream | None = None
        self._rig_watch: RigWatch | None = None
        self._velocity_watch: VelocityWatch | None = None
        self._complaint = ""
        self.settings = make_estimator(algorithm, 1000.0, True, settings).settings
        self.estimator: Estimator | None = None
        self._waiting: list[np.ndarray] = []
        self._measured_velocity: bool | None = None
        self._samples = 0
        self._reference = ReferenceTrack() if ALGORITHMS[algorithm].uses_reference else None

    @property
    def doubts(self) -> str:
        """Return why the newest estimate is doubted; empty where it is not."""
        if self.estimator is None:
            return ""
        reasons = [self.estimator.doubts]
        if self.known is not None and self.known.calibration_doubt >= DOUBT_THRESHOLD:
            reasons.append(UNCERTAIN_CALIBRATION)
        reasons.append(self._complaint)
        return "; ".join(reason for reason in reasons if reason)

    @property
    def tracked_columns(self) -> tuple[str, ...]:
        """Return the columns of `Estimates.tracked` behind the time."""
        return self._tracked_columns

    @property
    def instrument(self) -> str:
        """Return how the estimator deals with torque that moves the plate, or an empty text."""
        return self.estimator.instrument if self.estimator else ""

    @property
    def reflex_deviation(self) -> str:
        """Return the gain beyond G that a free reflex response finds, or an empty text."""
        area, error = self.estimator.reflex_deviation if self.estimator else (np.nan, np.nan)
        return f"{area:+.2f} ± {error:.2f} N.m.s/rad beside G" if np.isfinite(area) else ""

    @property
    def rig_warnings(self) -> list[str]:
        """Return how the rig file is old or contradicts the samples, one sentence each."""
        return self._rig_watch.warnings if self._rig_watch is not None else []

    @property
    def reason(self) -> str:
        """Return why the newest estimate is not valid; empty where it is."""
        return (
            self.estimator.reason
            if self.estimator
            else "waiting for samples that tell the sampling rate"
        )

    def feed(self, block: Block) -> Estimates:
        """Take in one block of ``/ankle/samples``; velocity is optional, other columns are left
        out.

        Raises
        ------
        BlockError, UnitError
            A column is missing or in a unit of another dimension.
        SamplingError
            A sampling rate that the estimator refuses.
        """
        velocity = any(split_column(name)[0] == "velocity" for name in block.columns)
        required = (POSITION, VELOCITY, TORQUE) if velocity else (POSITION, TORQUE)
        samples = require_columns(block, required, TOPIC).data
        if self._reference is None:
            return self._feed(samples, velocity)
        return self._feed(self._reference.join(samples), velocity)

    def feed_reference(self, block: Block) -> None:
        """Take in one block of ``/perturbation/reference``; estimators that use none ignore it.

        Raises
        ------
        BlockError, UnitError
            A column is missing or in a unit of another dimension.
        """
        if self._reference is not None:
            columns = require_columns(block, (POSITION,), REFERENCE_TOPIC).data
            self._reference.feed_reference(columns[:, 0], columns[:, 1])

    def release(self) -> Estimates:
        """Return what becomes due of samples that waited for their reference, after a block of it.

        The last samples of a stream have no later ones that would bring it to light.
        """
        if self._reference is None or self._measured_velocity is None:
            return _Parts().joined(len(self.tracked_columns))
        return self._feed(self._reference.release(), self._measured_velocity)

    def feed_samples(
        self, samples: np.ndarray, measured_velocity: bool, reference: np.ndarray | None = None
    ) -> Estimates:
        """Take in samples of shape (n, 4), or (n, 3) without velocity, in SI, and the reference's
        position [rad] at their times, shape (n,), where there is one.

        Raises
        ------
        ValueError
            A sampling rate that the estimator refuses.
        """
        if self._reference is not None:
            known = np.full(len(samples), np.nan) if reference is None else reference
            samples = np.column_stack([samples, known])
        return self._feed(samples, measured_velocity)

    def _feed(self, samples: np.ndarray, measured_velocity: bool) -> Estimates:
        parts = _Parts()
        if self._measured_velocity not in (None, measured_velocity):
            parts.notes.append(
                f"velocity is {'there' if measured_velocity else 'gone'} from now on: the "
                "estimator starts anew"
            )
            self.estimator = None
            self._waiting = []
        self._measured_velocity = measured_velocity
        while len(samples):
            if self.estimator is None:
                self._waiting.append(np.array(samples))
                samples = self._start(parts)
                if self.estimator is None:
                    break
            samples = self._advance(self.estimator, samples, parts)
        return parts.joined(len(self.tracked_columns))

    def _start(self, parts: _Parts) -> np.ndarray:
        """Make an estimator when enough samples are there; returns the samples that it is to begin
        with.
        """
        samples = np.concatenate(self._waiting)
        times = samples[np.isfinite(samples[:, 0]), 0]
        if len(times) < RATE_WINDOW:
            return samples[:0]
        self._waiting = []
        rate = sampling_rate(times[:RATE_WINDOW])
        self.estimator = make_estimator(
            self.algorithm, rate, bool(self._measured_velocity), self.settings
        )
        self._samples = 0
        self._complaint = ""
        self._velocity_watch = VelocityWatch(rate) if self._measured_velocity else None
        parts.notes.append(
            f"{self.algorithm} at {rate:g} Hz, velocity "
            f"{'measured' if self._measured_velocity else 'from position'}"
        )
        if self.known is not None:
            self.estimator.expect(self.known.expectation())
            self._physics = KnownPhysicsStream(self.known, self.estimator.layout)
            if self.known.rig is not None:
                self._rig_watch = RigWatch(self.known.rig, rate, bool(self._measured_velocity))
            parts.notes.append(f"known physics: {self.known.describe()}")
        return samples

    def _advance(self, estimator: Estimator, samples: np.ndarray, parts: _Parts) -> np.ndarray:
        """Process samples up to the next reflex response; return the rest."""
        every = max(round(self.settings.estimate_rate / RESPONSE_RATE), 1) * max(
            round(estimator.rate / self.settings.estimate_rate), 1
        )
        piece = samples[: every - self._samples % every]
        if self._rig_watch is not None:
            parts.notes += self._rig_watch.add(piece)
        physics = self._physics
        rows = estimator.process(piece if physics is None else physics.correct(piece))
        rows = rows if physics is None else physics.complete(rows)
        if self._complaint:
            rows[:, ESTIMATE_COLUMNS.index("doubt[1]")] = 1.0
        parts.rows.append(rows)
        parts.torques.append(estimator.torques)
        used = estimator.consumed
        self._samples += used
        if self._velocity_watch is not None:
            self._velocity_watch.add(piece[:used])
        if estimator.rate_lost:
            parts.notes.append(
                f"the sampling rate is no longer {estimator.rate:g} Hz: the estimator starts anew"
            )
            self.estimator = None
        elif self._samples % every == 0:
            if physics is not None:
                physics.restate()
                parts.tracked.append(physics.tracked_row(float(parts.rows[-1][-1, 0])))
            if self._velocity_watch is not None:
                # Looked at when it is due by the samples' count, however the blocks are cut.
                self._complaint = self._velocity_watch.complaint
            newest = float(parts.rows[-1][-1, 0])
            parts.responses.append((newest, estimator.reflex_response))
            reason = self.reason
            parts.judgements.append(Judgement(newest, reason, "" if reason else self.doubts))
        return samples[used:]


def compile_estimator(algorithm: str) -> None:
    """Compile, or load from the cache on disk, everything that an algorithm needs, for samples with
    and without velocity.
    """
    # At the rig's rate: tables that depend on it are then ready, too.
    time = np.arange(0.0, COMPILATION_DURATION, 1.0 / RIG_RATE)
    # Moving, as what still samples leave out would be compiled while a subject waits.
    position = 0.02 * np.sin(2.0 * np.pi * time)
    velocity = np.gradient(position, time)
    for columns in (
        [time, position, velocity, 100.0 * position],
        [time, position, 100.0 * position],
    ):
        EstimateStream(algorithm).feed_samples(
            np.column_stack(columns), len(columns) == 4, position
        )
