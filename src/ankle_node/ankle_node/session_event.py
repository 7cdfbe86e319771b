"""What ``session/event`` says: one line of YAML with an event, its time and its details.

    {event: hold started, 't[s]': 1760000012.5, hold: 3, 'torque_target[N.m]': -5.0}

A hold is a stretch (60 s in van 't Veld et al. 2018, section III-B.2) in which the subject keeps
one state. `torque_target` is named as in the paper: 0, or -5 for a small plantarflexion torque of
the subject.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import yaml

from ankle_interfaces.errors import UserError
from ankle_interfaces.topics import SESSION_EVENT
from ankle_interfaces.yaml_text import YamlError, parse_yaml

TOPIC = SESSION_EVENT.absolute
"""Name in a bag."""
HOLD_STARTED, HOLD_ENDED = "hold started", "hold ended"
TORQUE_TARGET = "torque_target[N.m]"


class SessionEventError(UserError, ValueError):
    """Reports a line that is no session event."""


@dataclass(frozen=True)
class SessionEvent:
    """Describes an event of a session.

    Attributes
    ----------
    event
        What happened, as ``hold started``.
    time
        When, in ROS time [s].
    details
        Further keys with their units, as ``torque_target[N.m]``.
    """

    event: str
    time: float
    details: dict[str, Any] = field(default_factory=dict)

    def line(self) -> str:
        """Return the text of the message."""
        content = {"event": self.event, "t[s]": self.time, **self.details}
        return yaml.safe_dump(
            content, default_flow_style=True, sort_keys=False, width=10**6
        ).strip()


def parse(line: str) -> SessionEvent:
    """Return the event in a message's text.

    Raises
    ------
    SessionEventError
        Not YAML, not a mapping, or without ``event`` or ``t[s]``; quotes the line.
    """
    try:
        content = parse_yaml(line)
    except YamlError:
        content = None
    if not isinstance(content, dict) or not isinstance(content.get("event"), str):
        raise SessionEventError(
            f"'{line}' is no session event: expected one line of YAML with 'event' and 't[s]'"
        )
    details = dict(content)
    event, time = details.pop("event"), details.pop("t[s]", None)
    if isinstance(time, bool) or not isinstance(time, (int, float)) or not math.isfinite(time):
        raise SessionEventError(f"'{line}': 't[s]' = {time} is no time in seconds")
    return SessionEvent(event, float(time), details)
