"""The messages from the node to the pages: one definition for Python and for the browser.

Each message is a dataclass here. `schemas` makes a JSON Schema of each; the node serves them under
`/pages/schemas.json`, and the pages read messages through it (`pages/strict.js`): a page that reads
a field that no message has says so on its console, and the tests of the pages fail.
"""

from __future__ import annotations

import dataclasses
import types
import typing
from typing import Any


@dataclasses.dataclass(frozen=True)
class Frame:
    """Holds the moving part of the pages, sent at the frame rate.

    Attributes
    ----------
    n
        Number of the frame.
    now
        ROS time [s].
    t
        Time of the newest estimate [s].
    x, y
        The cursor: feedback in its unit, torque [N.m].
    quality, torque_quality
        ``waiting``, ``invalid``, ``stale`` or ``valid``.
    age
        Of the newest estimate [s].
    K, G, torque
        Newest valid estimates [N.m/rad], [N.m.s/rad], and the subject's torque [N.m], for the
        operator; None where they are not valid or not fresh.
    in_target
        Whether the cursor is in the target.
    hint
        Key of the direction in which to go, of the message files; empty for none.
    elapsed, remaining
        Of the present step [s].
    clock
        Time since the session's start while it ran [s].
    """

    n: int
    now: float
    t: float | None
    x: float | None
    y: float | None
    quality: str
    torque_quality: str
    age: float | None
    K: float | None
    G: float | None
    torque: float | None
    in_target: bool
    hint: str
    elapsed: float
    remaining: float
    clock: float
    type: str = "frame"


@dataclasses.dataclass(frozen=True)
class SessionState:
    """Holds the state of the session."""

    state: str
    stop_reason: str
    title: str
    kind: str
    block: int
    blocks: int
    hold: int
    holds: int
    duration: float
    hold_share: list[float | None]
    holds_done: int
    hits: int
    instruction: str


@dataclasses.dataclass(frozen=True)
class TrialsState:
    """Holds the trials of a conditioning course.

    Attributes
    ----------
    session, sessions
        Number of the session, and of all.
    done, planned
        Trials of this session.
    kind
        Of the next trial: ``control`` or ``conditioned``.
    success_rate
        Share of successes in this session; None before the first conditioned trial.
    last_success
        Whether the last trial was a success; None for a control trial.
    activity, activity_window
        Of the course's muscle, and the window for it [MVC].
    held
        Whether torque and activity are in their windows.
    waiting
        Whether a perturbation was asked for.
    """

    session: int
    sessions: int
    done: int
    planned: int
    kind: str
    success_rate: float | None
    last_success: bool | None
    activity: float | None
    activity_window: list[float]
    held: bool
    waiting: bool


@dataclasses.dataclass(frozen=True)
class TargetState:
    """Holds the cursor's target: feedback, its unit and region; torque and half width [N.m]."""

    feedback: str
    unit: str
    torque: float
    torque_half_width: float
    lower: float | None
    upper: float | None


@dataclasses.dataclass(frozen=True)
class Axes:
    """Holds the ends of the axes, and which of them the operator has set."""

    x: list[float]
    y: list[float]
    set_by_operator: list[str]


@dataclasses.dataclass(frozen=True)
class BaselineState:
    """Holds the relaxed subject's K [N.m/rad], G [N.m.s/rad] and torque [N.m]."""

    K: float
    G: float
    torque: float


@dataclasses.dataclass(frozen=True)
class RigState:
    """Holds the state of the rig's driver.

    Attributes
    ----------
    name
        None while no driver can be commanded.
    problem
        Why not, or what is wrong.
    state
        A word and its reason.
    stop_unconfirmed
        Drivers that have not confirmed the last stop in time.
    """

    name: str | None
    problem: str
    state: str
    stop_unconfirmed: list[str]


@dataclasses.dataclass(frozen=True)
class SubjectState:
    """Holds the behaviour of the simulated subject."""

    cocontraction: float
    excitability: float
    push: float


@dataclasses.dataclass(frozen=True)
class NodeState:
    """Holds the health of one node."""

    name: str
    level: str
    message: str


@dataclasses.dataclass(frozen=True)
class Recording:
    """Holds the recorder's messages, missing samples and free disk [MB]; None for what is not
    known.
    """

    on: bool
    messages: int | None
    missing: int | None
    free: int | None


@dataclasses.dataclass(frozen=True)
class LogEntry:
    """Holds a session event: its time [s], name and details."""

    t: float
    event: str
    details: dict[str, Any]


@dataclasses.dataclass(frozen=True)
class CheckState:
    """Holds an entry of the check list: its words, whether it is measured, cannot be skipped, is
    answered by a file, or needs the running perturbation, and what came of it.
    """

    name: str
    title: str
    instruction: str
    measured: bool
    required: bool
    from_file: bool
    in_motion: bool
    state: str
    result: dict[str, Any]


@dataclasses.dataclass(frozen=True)
class Pages:
    """Holds the open pages by role, and whether one of them is in command."""

    subject: int
    operator: int
    in_command: bool


@dataclasses.dataclass(frozen=True)
class State:
    """Holds all values that do not change with every frame; sent when it changes.

    The reason says why estimates are not valid, the doubt why valid ones are doubtful. The body
    mass [kg] is None where it is not stated.
    """

    version: int
    session: SessionState
    target: TargetState
    axes: Axes
    baseline: BaselineState | None
    rig: RigState
    subject: SubjectState | None
    log: list[LogEntry]
    nodes: list[NodeState]
    recording: Recording
    reason: str
    doubt: str
    pages: Pages
    language: str
    checks: list[CheckState]
    trials: TrialsState | None
    visit: str
    body_mass: float | None
    type: str = "state"


@dataclasses.dataclass(frozen=True)
class Bins:
    """Holds new bins of a group of traces: number of the first, least and largest values by
    channel.
    """

    first: int
    low: dict[str, list[float | None]]
    high: dict[str, list[float | None]]


@dataclasses.dataclass(frozen=True)
class TracesMessage:
    """Holds new bins by group, and the width of a bin [s]; to operators."""

    groups: dict[str, Bins]
    widths: dict[str, float]
    type: str = "traces"


@dataclasses.dataclass(frozen=True)
class Answer:
    """Answers one page about its command."""

    id: int
    ok: bool
    error: str = ""
    type: str = "answer"


@dataclasses.dataclass(frozen=True)
class Command:
    """Tells one page whether it may command."""

    yours: bool
    type: str = "command"


MESSAGES = (Frame, State, TracesMessage, Answer, Command)


def schemas() -> dict[str, Any]:
    """Return the JSON Schema of every message, by its ``type``."""
    return {
        str(next(f.default for f in dataclasses.fields(kind) if f.name == "type")): _schema(kind)
        for kind in MESSAGES
    }


_SIMPLE_TYPES = {float: "number", int: "integer", str: "string", bool: "boolean"}


def _schema(kind: Any) -> dict[str, Any]:
    if kind in _SIMPLE_TYPES:
        return {"type": _SIMPLE_TYPES[kind]}
    if kind is Any:
        return {}
    origin, arguments = typing.get_origin(kind), typing.get_args(kind)
    if origin in (typing.Union, types.UnionType):
        known = [_schema(one) for one in arguments if one is not type(None)]
        return {"anyOf": [*known, {"type": "null"}]}
    if origin is list:
        return {"type": "array", "items": _schema(arguments[0])}
    if origin is dict:
        return {"type": "object", "additionalProperties": _schema(arguments[1])}
    if not (isinstance(kind, type) and dataclasses.is_dataclass(kind)):
        raise TypeError(f"a message cannot hold {kind}")
    hints = typing.get_type_hints(kind)
    names = [field.name for field in dataclasses.fields(kind)]
    return {
        "title": kind.__name__,
        "type": "object",
        "properties": {name: _schema(hints[name]) for name in names},
        "required": names,
        "additionalProperties": False,
    }
