"""What an operator's page may command, checked before anything acts on it.

A message is one JSON object: ``{"id": 7, "command": "set_target", "torque[N.m]": -5}``. Two kinds
of mistakes: what none of our pages ever sends (`MalformedMessageError`: the sender is
disconnected), and values or moments that are refused (`CommandError`: the sender gets the reason).
"""

from __future__ import annotations

import json
import math
from dataclasses import dataclass
from typing import Any

from biofeedback.errors import CommandError, MalformedMessageError
from biofeedback.session.check_list import CHECKS

LONGEST_MESSAGE = 4096
"""[bytes] Longest message that is read; the longest of the pages' own, a note, has 300."""
LONGEST_NOTE = 200
"""Largest number of characters of a note."""
RATE, BURST = 20.0, 40.0
"""Messages per second that a page may send for long, and at once: a slider that is dragged sends 10
a second.
"""


@dataclass(frozen=True)
class Number:
    """Describes a field with a number within limits [unit of the key].

    An optional one may be null, which withdraws a setting.
    """

    lower: float
    upper: float
    nullable: bool = False


@dataclass(frozen=True)
class Choice:
    """Describes a field with one of a few words."""

    words: tuple[str, ...]


@dataclass(frozen=True)
class Text:
    """Describes a field with printable text."""

    longest: int


Field = Number | Choice | Text

COMMANDS: dict[str, dict[str, Field]] = {
    "arm": {},
    "start": {},
    "pause": {},
    "stop": {},
    "claim": {},
    "reset_fault": {},
    "next": {},
    "start_hold": {},
    "end_hold": {},
    "restart": {},
    "check": {"check": Choice(tuple(CHECKS)), "act": Choice(("begin", "skip"))},
    "note": {"text": Text(LONGEST_NOTE)},
    "set_target": {
        "feedback": Choice(("K", "G")),
        "torque[N.m]": Number(-30.0, 30.0),
        "torque_half_width[N.m]": Number(0.05, 20.0),
        "lower": Number(0.0, 2000.0, nullable=True),
        "upper": Number(0.0, 2000.0, nullable=True),
    },
    "set_axis": {
        "x_upper": Number(0.5, 4000.0, nullable=True),
        "y_lower[N.m]": Number(-60.0, 60.0, nullable=True),
        "y_upper[N.m]": Number(-60.0, 60.0, nullable=True),
    },
    "subject": {
        "cocontraction": Number(0.0, 1.0),
        "excitability": Number(0.0, 1.0),
        "push": Number(-20.0, 20.0),
    },
}
"""Every command with its fields. A command without the field leaves what it would set.

K in N.m/rad, G in N.m.s/rad.
"""
FREE_COMMANDS = ("stop", "note", "subject")
"""Commands of any operator's page, also of one that is not in command."""
_COMMANDS_WITH_ALL_FIELDS = ("note", "check")


@dataclass(frozen=True)
class Command:
    """Describes a command that may be carried out.

    Attributes
    ----------
    number
        The page's own number for it, repeated in the answer.
    name
        A key of `COMMANDS`.
    values
        Checked fields.
    """

    number: int
    name: str
    values: dict[str, Any]


def parse(text: str) -> Command:
    """Return the command in a message.

    Raises
    ------
    MalformedMessageError
        Too long, not JSON, not an object, an unknown command or field, a field of another type.
    CommandError
        A number out of range, an unknown word, a text that is too long; the message carries
        ``number``.
    """
    if len(text.encode("utf-8", "surrogatepass")) > LONGEST_MESSAGE:
        raise MalformedMessageError(f"a message of more than {LONGEST_MESSAGE} bytes")
    try:
        content = json.loads(text)
    except (ValueError, RecursionError):
        raise MalformedMessageError("not JSON") from None
    if not isinstance(content, dict):
        raise MalformedMessageError("not a JSON object")
    number, name = content.pop("id", None), content.pop("command", None)
    if not isinstance(number, int) or isinstance(number, bool) or not 0 <= number < 2**53:
        raise MalformedMessageError("'id' is no whole number")
    if not isinstance(name, str) or name not in COMMANDS:
        raise MalformedMessageError("no such command")
    fields = COMMANDS[name]
    if set(content) - set(fields) or (
        name in _COMMANDS_WITH_ALL_FIELDS and set(content) != set(fields)
    ):
        raise MalformedMessageError(f"'{name}' takes {', '.join(fields) or 'no fields'}")
    try:
        return Command(
            number, name, {key: _checked(key, value, fields[key]) for key, value in content.items()}
        )
    except CommandError as error:
        raise RefusedCommandError(number, str(error)) from None


class RefusedCommandError(CommandError):
    """Reports a refused command whose number is known."""

    def __init__(self, number: int, reason: str) -> None:
        super().__init__(reason)
        self.number = number


def _checked(key: str, value: Any, field: Field) -> Any:
    if isinstance(field, Number):
        if value is None and field.nullable:
            return None
        if isinstance(value, bool) or not isinstance(value, (int, float)):
            raise MalformedMessageError(f"'{key}' is no number")
        if not math.isfinite(value) or not field.lower <= value <= field.upper:
            raise CommandError(
                f"{key} = {value:g} is refused; allowed: {field.lower:g} to {field.upper:g}"
            )
        return float(value)
    if not isinstance(value, str):
        raise MalformedMessageError(f"'{key}' is no text")
    if isinstance(field, Choice):
        if value not in field.words:
            raise CommandError(f"{key} is refused; allowed: {', '.join(field.words)}")
        return value
    if not value.strip() or len(value) > field.longest or not value.isprintable():
        raise CommandError(f"{key} must be 1 to {field.longest} printable characters")
    return value


class RateLimit:
    """Limits messages by a bucket of `BURST` messages that fills at `RATE` a second."""

    def __init__(self, now: float) -> None:
        self._left, self._last = BURST, now

    def allows(self, now: float) -> bool:
        """Return whether one more message at time `now` [s] is within the rate."""
        self._left = min(BURST, self._left + RATE * (now - self._last))
        self._last = now
        if self._left < 1.0:
            return False
        self._left -= 1.0
        return True
