"""What the analysis takes from a bag: holds, estimates, EMG responses; computed from the samples
where the bag lacks them.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ankle_interfaces.block import Block, unpack
from ankle_interfaces.errors import BlockError
from ankle_interfaces.topics import ANKLE_SAMPLES, DIAGNOSTICS
from ankle_node.session_event import TOPIC as EVENT_TOPIC
from ankle_node.session_event import SessionEvent, SessionEventError, parse
from emg_driver.muscles import RESPONSE_COLUMNS, RESPONSE_TOPIC
from emg_driver.offline import respond_bag
from impedance_estimator.algorithms import DEFAULT
from impedance_estimator.estimator import ESTIMATE_COLUMNS, ESTIMATE_TOPIC
from impedance_estimator.offline.recorded_estimates import PROVENANCE_TOPIC, estimate_bag
from session_analysis.errors import AnalysisError
from session_analysis.estimate_origin import KEYS, Origin, in_force
from session_analysis.holds import Excluded, Hold, find_holds
from session_analysis.known_of_session import (
    NOTHING_GIVEN,
    GivenPhysics,
    differences,
    known_of_session,
)
from session_recorder.bag_reader import BagReader
from session_recorder.loss import LossAccount, account_of_bag
from session_recorder.message_definitions import typestore
from session_recorder.sample_account import Gap

DOUBT = "doubt[1]"
COMPUTED_COLUMNS = {ESTIMATE_TOPIC: ESTIMATE_COLUMNS, RESPONSE_TOPIC: RESPONSE_COLUMNS}
"""Columns of each topic that is computed from the samples where a bag lacks it."""
SUBJECT_KEY = "subject"
"""Key in a bag's custom data that says whose session it is."""
LAG_KEY = "lag of the plate behind its command [ms]"
"""Under this key of ``/diagnostics`` the EMG processing says what its windows reckon with."""


def _with_doubt(block: Block) -> Block:
    """Return estimates that were recorded before they stated a doubt, with a doubt that is not
    known.
    """
    at = ESTIMATE_COLUMNS.index(DOUBT)
    if block.columns != ESTIMATE_COLUMNS[:at] + ESTIMATE_COLUMNS[at + 1 :]:
        return block
    return Block(ESTIMATE_COLUMNS, np.insert(block.data, at, np.nan, axis=1))


@dataclass(frozen=True)
class RecordedSession:
    """Holds the analysed data of one bag.

    Attributes
    ----------
    path
        The bag.
    subject
        Whose.
    holds
        Complete holds.
    excluded
        Holds that are left out.
    estimates
        Shape (n, 13), columns `ESTIMATE_COLUMNS`.
    responses
        Shape (k, 10), columns `RESPONSE_COLUMNS`.
    notes
        What a reader should know, one sentence each.
    origins
        What the estimates are made with, in the order of time; more than one where it changed
        during the recording, none where the bag does not say.
    gaps
        Where samples of the ankle are missing.
    made_anew
        Whether the estimates come from the samples and not from the recording.
    origin_notes
        In what estimates that are made anew differ from the recorded ones, one sentence each.
    lag
        Median time from a command to the plate's movement, at which the windows of the EMG start
        [s]; NaN where it is not known.
    """

    path: Path
    subject: str
    holds: list[Hold]
    excluded: list[Excluded]
    estimates: np.ndarray
    responses: np.ndarray
    notes: list[str]
    origins: tuple[Origin, ...] = ()
    gaps: tuple[Gap, ...] = ()
    made_anew: bool = False
    origin_notes: tuple[str, ...] = ()
    lag: float = math.nan

    @property
    def provenances(self) -> tuple[str, ...]:
        """Return what the estimates are made with, as text, each statement once."""
        return tuple(
            dict.fromkeys(
                "; ".join(f"{key}: {origin.shown(key)}" for key in KEYS) for origin in self.origins
            )
        )


def read_session(
    path: Path,
    subject: str = "",
    recompute: bool = False,
    progress: Callable[[float], None] | None = None,
    algorithm: str = DEFAULT,
    given: GivenPhysics = NOTHING_GIVEN,
) -> RecordedSession:
    """Read a bag.

    Parameters
    ----------
    path
        Path of the bag.
    subject
        Whose; else what the bag's custom data say, else the bag's name.
    recompute
        Estimates and responses from the samples, also where they were recorded.
    progress
        Called with the fraction done.
    algorithm
        Of estimates that come from the samples.
    given
        Model and rig of estimates that come from the samples.

    Raises
    ------
    BagError
        No such bag, or it lacks the samples that are needed.
    AnalysisError
        It holds no events; or a model or rig is given and its estimates are used as recorded.
    """
    bag = BagReader(path)
    if not _holds(bag, EVENT_TOPIC):
        raise AnalysisError(
            f"{path} has no {EVENT_TOPIC}: nothing says when the subject held a state"
        )
    losses = account_of_bag(bag)
    bag_name = Path(path).resolve().name
    notes = [f"{bag_name}: {sentence.removeprefix(f'{path}: ')}" for sentence in losses.sentences()]
    recorded = [] if recompute else [topic for topic in COMPUTED_COLUMNS if _holds(bag, topic)]
    if ESTIMATE_TOPIC in recorded and not given.is_empty:
        raise AnalysisError(
            f"{path}: its estimates are used as recorded, and --model and --rig would change "
            "nothing; --recompute makes them anew"
        )
    content = _content(bag, recorded, progress)
    notes += [f"{bag_name}: {note}" for note in content.notes]
    holds, excluded = find_holds(content.events)
    origins, origin_notes = _origins(content, bag.path), list[str]()
    if ESTIMATE_TOPIC in recorded:
        estimates = np.concatenate(content.rows[ESTIMATE_TOPIC])
    else:
        stated = in_force(origins, max((hold.end for hold in holds), default=math.inf))
        known = known_of_session(bag, stated, given)
        computed = estimate_bag(path, algorithm=algorithm, known=known, progress=progress)
        estimates = computed.rows
        origins = [Origin.from_text(computed.provenance, -math.inf, bag.path)]
        notes += [f"{bag_name}: {note}" for note in computed.notes]
        if stated is not None:
            about = differences(stated, origins[0], bag, given)
            origin_notes = [f"{bag_name}: {note}" for note in about]
    if RESPONSE_TOPIC in recorded:
        responses = np.concatenate(content.rows[RESPONSE_TOPIC])
        lag = _median_lag(content, holds)
    else:
        found = respond_bag(path, progress=progress)
        responses, lag = found.rows, found.lag
        notes += [f"{bag_name}: {note}" for note in found.notes]
    name = subject or bag.custom_data.get(SUBJECT_KEY, "") or bag_name
    return RecordedSession(
        Path(path),
        name,
        holds,
        excluded,
        estimates,
        responses,
        notes,
        tuple(origins),
        _gaps(losses),
        ESTIMATE_TOPIC not in recorded,
        tuple(origin_notes),
        lag,
    )


@dataclass
class _Content:
    """Holds what was recorded of a session beside its samples.

    `provenances` and `lags` [s] have the time [s] at which they were recorded, `delays` [s] are
    from the time that an event states to that of its recording.
    """

    rows: dict[str, list[np.ndarray]]
    events: list[SessionEvent] = field(default_factory=list)
    provenances: list[tuple[float, str]] = field(default_factory=list)
    lags: list[tuple[float, float]] = field(default_factory=list)
    delays: list[float] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)

    @property
    def delay(self) -> float:
        """Return how much later than its own time the session was recorded [s]: next to nothing,
        or the age of a session whose replay was recorded.
        """
        return float(np.median(self.delays)) if self.delays else 0.0


def _holds(bag: BagReader, topic: str) -> bool:
    return topic in bag.topics and bool(bag.topics[topic].count)


def _content(
    bag: BagReader, recorded: list[str], progress: Callable[[float], None] | None
) -> _Content:
    """Read events, what estimates were made with, and of the recorded topics the rows."""
    content = _Content({topic: [] for topic in recorded})
    further = [PROVENANCE_TOPIC, *([DIAGNOSTICS.name] if RESPONSE_TOPIC in recorded else [])]
    topics = [EVENT_TOPIC, *recorded, *(topic for topic in further if topic in bag.topics)]
    store = typestore()
    for topic, log_time, message in bag.messages(topics, progress):
        try:
            if topic in recorded:
                content.rows[topic].append(_rows(topic, unpack(message), bag.path))
                continue
            if topic == DIAGNOSTICS.name:
                content.lags += [(1e-9 * log_time, lag) for lag in _lags(message)]
                continue
            text = store.deserialize_cdr(message, "std_msgs/msg/String").data  # type: ignore[attr-defined]
            if topic == PROVENANCE_TOPIC:
                content.provenances.append((1e-9 * log_time, text))
            else:
                content.events.append(parse(text))
                content.delays.append(1e-9 * log_time - content.events[-1].time)
        except (SessionEventError, BlockError) as error:
            content.notes.append(f"{topic}: {error}")
    return content


def _lags(message: bytes) -> list[float]:
    """Return what a message of ``/diagnostics`` says of the lag of the plate [s]."""
    if LAG_KEY.encode() not in message:
        return []
    array: Any = typestore().deserialize_cdr(message, DIAGNOSTICS.message)
    texts = [pair.value for one in array.status for pair in one.values if pair.key == LAG_KEY]
    return [1e-3 * float(text) for text in texts]


def _origins(content: _Content, path: Path) -> list[Origin]:
    """Return what the estimates were made with, since times of the session's own clock."""
    return [
        Origin.from_text(text, time - content.delay, path) for time, text in content.provenances
    ]


def _median_lag(content: _Content, holds: Sequence[Hold]) -> float:
    """Return the median of the lags [s] that were stated during holds; NaN where none was."""
    lags = [(time - content.delay, lag) for time, lag in content.lags]
    during = [lag for time, lag in lags if any(hold.start <= time <= hold.end for hold in holds)]
    return float(np.median(during)) if during else math.nan


def _rows(topic: str, block: Block, path: Path) -> np.ndarray:
    if topic == ESTIMATE_TOPIC:
        block = _with_doubt(block)
    if block.columns != COMPUTED_COLUMNS[topic]:
        raise AnalysisError(
            f"{path}: {topic} has the columns {', '.join(block.columns)}; expected "
            f"{', '.join(COMPUTED_COLUMNS[topic])}"
        )
    return block.data


def _gaps(losses: LossAccount) -> tuple[Gap, ...]:
    account = losses.topics.get(ANKLE_SAMPLES.absolute)
    return () if account is None else tuple(account.gaps)
