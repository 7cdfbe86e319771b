"""What the analysis takes from a bag: holds, estimates, EMG responses; computed from the samples
where the bag lacks them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ankle_interfaces.block import Block, unpack
from ankle_interfaces.errors import BlockError
from ankle_interfaces.topics import ANKLE_SAMPLES
from ankle_node.session_event import TOPIC as EVENT_TOPIC
from ankle_node.session_event import SessionEvent, SessionEventError, parse
from emg_driver.muscles import RESPONSE_COLUMNS, RESPONSE_TOPIC
from emg_driver.offline import respond_bag
from impedance_estimator.algorithms import DEFAULT
from impedance_estimator.estimator import ESTIMATE_COLUMNS, ESTIMATE_TOPIC
from impedance_estimator.offline.recorded_estimates import PROVENANCE_TOPIC, estimate_bag
from session_analysis.errors import AnalysisError
from session_analysis.holds import Excluded, Hold, find_holds
from session_recorder.bag_reader import BagReader
from session_recorder.loss import LossAccount, account_of_bag
from session_recorder.message_definitions import typestore
from session_recorder.sample_account import Gap

DOUBT = "doubt[1]"
COMPUTED_COLUMNS = {ESTIMATE_TOPIC: ESTIMATE_COLUMNS, RESPONSE_TOPIC: RESPONSE_COLUMNS}
"""Columns of each topic that is computed from the samples where a bag lacks it."""
SUBJECT_KEY = "subject"
"""Key in a bag's custom data that says whose session it is."""


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
    provenances
        What the estimates are made with, as `impedance_estimator.provenance` states it; more than
        one where it changed during the recording, none where the bag does not say.
    gaps
        Where samples of the ankle are missing.
    """

    path: Path
    subject: str
    holds: list[Hold]
    excluded: list[Excluded]
    estimates: np.ndarray
    responses: np.ndarray
    notes: list[str]
    provenances: tuple[str, ...] = ()
    gaps: tuple[Gap, ...] = ()


def read_session(
    path: Path,
    subject: str = "",
    recompute: bool = False,
    progress: Callable[[float], None] | None = None,
    algorithm: str = DEFAULT,
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

    Raises
    ------
    BagError
        No such bag, or it lacks the samples that are needed.
    AnalysisError
        It holds no events.
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
    content = _content(bag, recorded, progress)
    notes += [f"{bag_name}: {note}" for note in content.notes]
    holds, excluded = find_holds(content.events)
    provenances = content.provenances
    if ESTIMATE_TOPIC in recorded:
        estimates = np.concatenate(content.rows[ESTIMATE_TOPIC])
    else:
        computed = estimate_bag(path, algorithm=algorithm, progress=progress)
        estimates, provenances = computed.rows, [computed.provenance]
        notes += [f"{bag_name}: {note}" for note in computed.notes]
    if RESPONSE_TOPIC in recorded:
        responses = np.concatenate(content.rows[RESPONSE_TOPIC])
    else:
        found = respond_bag(path, progress=progress)
        responses = found.rows
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
        tuple(dict.fromkeys(provenances)),
        _gaps(losses),
    )


@dataclass
class _Content:
    """Holds what was recorded of a session beside its samples."""

    events: list[SessionEvent]
    provenances: list[str]
    rows: dict[str, list[np.ndarray]]
    notes: list[str]


def _holds(bag: BagReader, topic: str) -> bool:
    return topic in bag.topics and bool(bag.topics[topic].count)


def _content(
    bag: BagReader, recorded: list[str], progress: Callable[[float], None] | None
) -> _Content:
    """Read events, and of the recorded topics the rows with what they were made with."""
    content = _Content([], [], {topic: [] for topic in recorded}, [])
    topics = [EVENT_TOPIC, *recorded]
    if ESTIMATE_TOPIC in recorded and PROVENANCE_TOPIC in bag.topics:
        topics.append(PROVENANCE_TOPIC)
    store = typestore()
    for topic, _, message in bag.messages(topics, progress):
        try:
            if topic in recorded:
                content.rows[topic].append(_rows(topic, unpack(message), bag.path))
                continue
            text = store.deserialize_cdr(message, "std_msgs/msg/String").data  # type: ignore[attr-defined]
            if topic == PROVENANCE_TOPIC:
                content.provenances.append(text)
            else:
                content.events.append(parse(text))
        except (SessionEventError, BlockError) as error:
            content.notes.append(f"{topic}: {error}")
    return content


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
