"""Three simulated subjects through the paper's experiment, recorded as bags by the code of a real
session, faster than real time.

Perturbation, rig, estimator and EMG processing are the classes behind the nodes; the bags hold what
the recorder would have recorded. Nothing of what the subjects were told reaches the analysis: it
reads the bags alone.
"""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ankle_interfaces.block import Block
from ankle_interfaces.topics import ANKLE_SAMPLES, PERTURBATION_REFERENCE
from ankle_node.session_event import TOPIC as EVENT_TOPIC
from ankle_physics.actuator import Servo
from ankle_physics.scenario import Scenario
from ankle_physics.sensors import SignalToNoise
from ankle_sim.live_rig import Setup
from ankle_sim.live_subject import LiveSubject, Piece, subject_model
from ankle_sim.procedure import BLOCK, BREAK, PAPER_HOLDS, PlannedHold, plan
from ankle_sim.virtual_subject import draw_subject
from emg_driver.muscles import RESPONSE_COLUMNS, RESPONSE_TOPIC, SAMPLE_COLUMNS, SAMPLES_TOPIC
from emg_driver.offline import MOTION_TOPIC, REFERENCE_TOPIC
from emg_driver.processor import EmgProcessor
from impedance_estimator.algorithms.conceptual_experimental import ConceptualExperimental
from impedance_estimator.estimator import ESTIMATE_COLUMNS, ESTIMATE_TOPIC
from impedance_estimator.stream import EstimateStream
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings as PerturbationSettings
from session_analysis.errors import AnalysisError
from session_analysis.recorded_session import SUBJECT_KEY
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError
from session_recorder.message_definitions import typestore

RATE = 2048.0
"""[Hz] Sampling rate of rig and EMG (paper, section III-B.1)."""
BLOCK_SAMPLES = 32
"""Number of samples of a message, as the nodes send them."""
STEP = 256
"""Number of samples that are simulated at once: the subject's state moves in steps of 1/8 s, short
against the 2 s in which it is reached."""
EPOCH = 1.7e9
"""[s] Arbitrary time of the first sample; a bag's times count from 1970."""
FINAL_PERTURBATION_TIME = 2.0
"""[s] Perturbation after the last hold, so that its last responses are complete."""
REFERENCE_COLUMNS = PERTURBATION_REFERENCE.columns
MOTION_COLUMNS = ANKLE_SAMPLES.columns_of(4)
DESCRIPTION_KEY = "virtual_session"
"""Key in the bag's custom data under which it says how it was made."""


@dataclass(frozen=True)
class VirtualSession:
    """Describes how one bag is made.

    Attributes
    ----------
    subject
        Number of the simulated subject.
    holds
        At each torque target.
    modulates
        Whether the subject can change stiffness and reflex; else both are the same in every hold of
        a target.
    seed
        Of everything random.
    hold, reach
        Length of a hold and of the way to it [s].
    """

    subject: int
    holds: tuple[int, int]
    modulates: bool = True
    seed: int = 1
    hold: float = 60.0
    reach: float = 60.0

    def described(self) -> str:
        """Return one line of JSON that distinguishes this session from others."""
        return json.dumps(vars(self))

    def plan(self) -> list[PlannedHold]:
        """Return the holds in order."""
        return plan(
            self.holds, 1000 * self.seed + self.subject, self.modulates, self.hold, self.reach
        )


def paper_study(modulates: bool = True, seed: int = 1) -> list[VirtualSession]:
    """Return the paper's three subjects with 33 + 22 holds."""
    return [
        VirtualSession(number + 1, holds, modulates, seed)
        for number, holds in enumerate(PAPER_HOLDS)
    ]


def record_study(
    sessions: list[VirtualSession],
    folder: Path,
    progress: Callable[[str, float], None] | None = None,
) -> list[Path]:
    """Record every session into ``folder/subject_N``; one that is there already, made in the same
    way, is kept.

    Raises
    ------
    AnalysisError
        Something else is at that place.
    """
    bags = []
    for session in sessions:
        bag = folder / f"subject_{session.subject}"
        if not _is_there(bag, session):
            what = f"recording subject {session.subject} of {len(sessions)}"
            record_session(
                session,
                bag,
                None if progress is None else lambda share, what=what: progress(what, share),  # type: ignore[misc]
            )  # type: ignore[misc]
        bags.append(bag)
    return bags


def _is_there(bag: Path, session: VirtualSession) -> bool:
    if not bag.exists():
        return False
    try:
        found = BagReader(bag)
    except BagError as error:
        raise AnalysisError(
            f"{bag} is there and is no bag ({error}); nothing is overwritten unasked"
        ) from None
    if not found.complete or found.custom_data.get(DESCRIPTION_KEY) != session.described():
        raise AnalysisError(
            f"{bag} is there and holds another or an incomplete session; nothing is overwritten "
            "unasked"
        )
    return True


def record_session(
    session: VirtualSession, bag: Path, progress: Callable[[float], None] | None = None
) -> None:
    """Simulate and record one session.

    Raises
    ------
    BagError
        Something is at `bag` already.
    """
    subject, holds = draw_subject(session.subject), session.plan()
    seed = 1000 * session.seed + session.subject
    setup = Setup(
        subject_model(subject),
        Servo(),
        SignalToNoise(),
        Scenario([]),
        PerturbationSettings().amplitude,
        seed,
    )
    live = LiveSubject(setup, subject, holds, lambda sentence: None, steady=not session.modulates)
    cycle = round((BLOCK + BREAK) * RATE)
    end = holds[-1].end + FINAL_PERTURBATION_TIME
    with BagWriter(bag) as writer:
        writer.custom_data = {SUBJECT_KEY: subject.name, DESCRIPTION_KEY: session.described()}
        recorder = _Recorder(writer)
        for first in range(0, round(end * RATE), STEP):
            since = np.arange(first, first + STEP) / RATE
            if first % cycle == 0:
                # Ends at rest after a block and stays there through the break, while everything is
                # recorded on.
                signal = PulseStep(
                    PerturbationSettings(
                        rate=RATE, duration=BLOCK, seed=100 * seed + first // cycle
                    )
                )
            reference = signal.next(STEP)
            pieces, events = live.take(EPOCH + since, reference)
            for event in events:
                recorder.event(event.line(), event.time)
            recorder.samples(EPOCH + since, reference, pieces)
            if progress is not None and first % (64 * STEP) == 0:
                progress(since[0] / end)
        recorder.finish()


class _Recorder:
    """Passes samples through estimator and EMG processor, and writes everything into the bag."""

    def __init__(self, writer: BagWriter) -> None:
        self._writer = writer
        self._store = typestore()
        # The paper's, as table III is the paper's.
        self._estimates = EstimateStream(ConceptualExperimental.name)
        self._responses = EmgProcessor()
        for topic in (REFERENCE_TOPIC, MOTION_TOPIC, SAMPLES_TOPIC, ESTIMATE_TOPIC, RESPONSE_TOPIC):
            writer.add_topic(topic)
        writer.add_topic(EVENT_TOPIC, "std_msgs/msg/String")

    def event(self, line: str, time: float) -> None:
        text = self._store.types["std_msgs/msg/String"](data=line)
        self._writer.write(
            EVENT_TOPIC,
            round(time * 1e9),
            bytes(self._store.serialize_cdr(text, "std_msgs/msg/String")),
        )

    def samples(self, time: np.ndarray, reference: np.ndarray, pieces: list[Piece]) -> None:
        self._write(REFERENCE_TOPIC, REFERENCE_COLUMNS, np.column_stack([time, reference]))
        self._estimates.feed_reference(Block(REFERENCE_COLUMNS, np.column_stack([time, reference])))
        self._respond(self._responses.feed_reference(time, reference[:, 0]).rows)
        for piece in pieces:
            motion = np.column_stack([piece.stretch.time, piece.stretch.samples])
            self._write(MOTION_TOPIC, MOTION_COLUMNS, motion)
            self._write(
                SAMPLES_TOPIC, SAMPLE_COLUMNS, np.column_stack([piece.stretch.time, piece.emg])
            )
            velocity = motion[:, MOTION_COLUMNS.index("velocity[rad/s]")]
            self._respond(self._responses.feed_motion(motion[:, 0], velocity).rows)
            self._respond(self._responses.feed_emg(piece.stretch.time, piece.emg).rows)
            rows = self._estimates.feed(Block(MOTION_COLUMNS, motion)).rows
            for row in rows:
                self._writer.write_block(ESTIMATE_TOPIC, Block(ESTIMATE_COLUMNS, row[None]))

    def finish(self) -> None:
        self._respond(self._responses.finish().rows)

    def _write(self, topic: str, columns: tuple[str, ...], data: np.ndarray) -> None:
        for first in range(0, len(data), BLOCK_SAMPLES):
            self._writer.write_block(topic, Block(columns, data[first : first + BLOCK_SAMPLES]))

    def _respond(self, rows: np.ndarray) -> None:
        for row in rows:
            self._writer.write_block(RESPONSE_TOPIC, Block(RESPONSE_COLUMNS, row[None]))
