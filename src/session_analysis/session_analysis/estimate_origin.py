"""What the estimates of a session were made with, and since when: algorithm, settings, model and
rig.

The estimator states it on ``/impedance/provenance``, again each time that it changes. What counts
for a hold is the statement that was in force while it lasted.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import yaml

from ankle_interfaces.topics import IMPEDANCE_PROVENANCE, Topic
from ankle_interfaces.yaml_text import YamlError, parse_yaml
from session_analysis.errors import AnalysisError
from session_analysis.holds import Hold
from session_recorder.bag_reader import BagReader
from session_recorder.message_definitions import typestore

ESTIMATOR_KEYS = ("algorithm", "settings")
"""What has to be the same for all sessions of a comparison."""
CALIBRATION_KEYS = ("model", "rig")
"""What each visit of a subject may have of its own."""
KEYS = (*ESTIMATOR_KEYS, *CALIBRATION_KEYS)
NONE, NOT_STATED = "none", "not stated"
SHOWN_DIGITS = 12
"""So many digits of a SHA-256 are shown: two of a million files share them once in 500 studies."""
RECOMPUTE = "--recompute makes all of them anew with the model and rig of the last hold"


@dataclass(frozen=True)
class Origin:
    """Describes what estimates are made with.

    Attributes
    ----------
    since
        When it came into force [s]; minus infinity for estimates that are made anew as a whole.
    algorithm
        Name of the estimator.
    settings
        Of the estimator, by name.
    model, rig
        Title and SHA-256 of the subject's model and of the rig file; None where there is none.
    """

    since: float
    algorithm: str
    settings: Any
    model: Mapping[str, str] | None
    rig: Mapping[str, str] | None

    @classmethod
    def from_text(cls, text: str, since: float, path: Path) -> Origin:
        """Read a line that `impedance_estimator.provenance` wrote.

        Parameters
        ----------
        text
            The line.
        since
            When it came into force [s].
        path
            The bag, which an error names.

        Raises
        ------
        AnalysisError
            It is no such line.
        """
        try:
            stated = parse_yaml(text)
        except YamlError as error:
            raise AnalysisError(f"{path}: the origin of its estimates is {error}") from None
        if not isinstance(stated, dict):
            raise AnalysisError(f"{path}: the origin of its estimates is no table: {text!r}")
        if missing := [key for key in KEYS if key not in stated]:
            raise AnalysisError(
                f"{path}: the origin of its estimates does not state {', '.join(missing)}: {text!r}"
            )
        for key in CALIBRATION_KEYS:
            value = stated[key]
            if value is not None and not (isinstance(value, dict) and "sha256" in value):
                raise AnalysisError(
                    f"{path}: the origin of its estimates states {key} = {value!r}; allowed: null, "
                    "or a title with its sha256"
                )
        calibration = (_title_and_sum(stated[key]) for key in CALIBRATION_KEYS)
        return cls(since, str(stated["algorithm"]), stated["settings"], *calibration)

    def shown(self, key: str) -> str:
        """Return one of `KEYS` as people read it; ``none`` for a model or rig that is not there."""
        value = getattr(self, key)
        if key in CALIBRATION_KEYS:
            return title_and_sum(value)
        return str(yaml.safe_dump(value, default_flow_style=True, width=10**6)).splitlines()[0]

    def difference(self, other: Origin) -> str:
        """Return the first of `KEYS` in which two differ; empty where they are the same."""
        return next((key for key in KEYS if getattr(self, key) != getattr(other, key)), "")


def recorded_origins(path: Path) -> list[Origin]:
    """Return what the estimates of a bag were made with, in the order of its statements, since
    times of the recorder [s].

    Parameters
    ----------
    path
        Of the bag.

    Raises
    ------
    session_recorder.errors.BagError
        No such bag.
    AnalysisError
        A statement is in no known form.
    """
    stated = recorded_texts(BagReader(path), IMPEDANCE_PROVENANCE)
    return [Origin.from_text(text, time, path) for time, text in stated]


def recorded_texts(bag: BagReader, topic: Topic) -> list[tuple[float, str]]:
    """Return the messages of a topic of texts, each with its time of the recorder [s], in the order
    of time; nothing where the bag does not have the topic.

    Parameters
    ----------
    bag
        The recording.
    topic
        Of `std_msgs/String`.
    """
    if topic.absolute not in bag.topics:
        return []
    store = typestore()
    return [
        (1e-9 * time, store.deserialize_cdr(message, topic.message).data)  # type: ignore[attr-defined]
        for _, time, message in bag.messages([topic.absolute])
    ]


def _title_and_sum(stated: Any) -> Mapping[str, str] | None:
    if stated is None:
        return None
    return {"title": str(stated.get("title", "")), "sha256": str(stated["sha256"])}


def title_and_sum(stated: Mapping[str, str] | None) -> str:
    """Return title and SHA-256 of a model or a rig as people read them.

    Parameters
    ----------
    stated
        Of an `Origin`.
    """
    if stated is None:
        return NONE
    digits = stated["sha256"]
    short = digits if len(digits) <= SHOWN_DIGITS else f"{digits[:SHOWN_DIGITS]}…"
    return f"'{stated['title']}' (SHA-256 {short})"


@dataclass(frozen=True)
class SessionOrigin:
    """Describes how the numbers of one session were made.

    Attributes
    ----------
    path
        The bag.
    subject
        Whose.
    origin
        What the estimates of its holds were made with; None where the bag does not state it.
    made_anew
        Whether its estimates come from the samples and not from the recording.
    lag
        Median time from a command to the plate's movement [s]: windows of EMG start at the
        movement. NaN where it is not known.
    """

    path: Path
    subject: str
    origin: Origin | None
    made_anew: bool = False
    lag: float = math.nan


def in_force(origins: Sequence[Origin], time: float) -> Origin | None:
    """Return what was in force at a time; None where nothing is stated.

    The first statement counts from the beginning: a recorder may get it later than the estimates.

    Parameters
    ----------
    origins
        In the order of time.
    time
        [s].
    """
    before = [origin for origin in origins if origin.since <= time]
    if before:
        return before[-1]
    return origins[0] if origins else None


def origin_of_holds(origins: Sequence[Origin], holds: Sequence[Hold], path: Path) -> Origin | None:
    """Return what the estimates of all these holds were made with.

    Parameters
    ----------
    origins
        What the bag states, in the order of time.
    holds
        Those that are used.
    path
        The bag, which an error names.

    Returns
    -------
    Origin or None
        None where the bag states nothing, or no hold is used.

    Raises
    ------
    AnalysisError
        It changed within a hold, or from one hold to another.
    """
    found: Origin | None = None
    first: Hold | None = None
    for hold in sorted(holds, key=lambda hold: hold.start):
        own = in_force(origins, hold.start)
        if own is None:
            return None
        for later in origins:
            if not hold.start < later.since <= hold.end:
                continue
            if key := own.difference(later):
                raise AnalysisError(
                    f"{path}: {key} changes from {own.shown(key)} to {later.shown(key)} within "
                    f"hold {hold.number}, at t = {later.since:.1f} s, "
                    f"{later.since - hold.start:.1f} s after its start: estimates of different "
                    f"origin are not mixed; {RECOMPUTE}"
                )
        if found is None or first is None:
            found, first = own, hold
        elif key := found.difference(own):
            raise AnalysisError(
                f"{path}: {key} is {found.shown(key)} in hold {first.number} and {own.shown(key)} "
                f"in hold {hold.number}, since t = {own.since:.1f} s: estimates of different "
                f"origin are not mixed; {RECOMPUTE}"
            )
    return found


def require_one_estimator(sessions: Sequence[SessionOrigin]) -> None:
    """Refuse sessions whose estimates are not all made by one estimator with the same settings.

    Parameters
    ----------
    sessions
        Those of which a hold is used; one that states no origin is left out of the comparison.

    Raises
    ------
    AnalysisError
        Algorithm or settings differ.
    """
    stated = [(one.path, one.origin) for one in sessions if one.origin is not None]
    for path, origin in stated[1:]:
        first_path, first = stated[0]
        key = first.difference(origin)
        if key in ESTIMATOR_KEYS:
            raise AnalysisError(
                f"estimates of different origin are not mixed: {key} is {first.shown(key)} in "
                f"{first_path} and {origin.shown(key)} in {path}; --recompute makes all of them "
                "anew"
            )


def changes_between_visits(sessions: Sequence[SessionOrigin]) -> list[str]:
    """Return which subjects have another model or rig from visit to visit, one sentence each.

    Parameters
    ----------
    sessions
        Those of which a hold is used.
    """
    out = []
    for subject in dict.fromkeys(one.subject for one in sessions):
        stated = [
            (one.path, one.origin)
            for one in sessions
            if one.subject == subject and one.origin is not None
        ]
        for key in CALIBRATION_KEYS:
            bags: dict[str, list[str]] = {}
            for path, origin in stated:
                bags.setdefault(origin.shown(key), []).append(str(path))
            if len(bags) > 1:
                which = "; ".join(f"{shown} in {', '.join(own)}" for shown, own in bags.items())
                out.append(
                    f"{subject}: the {key} differs between the recordings: {which}. Differences of "
                    "K and G between them may come from it"
                )
    return out
