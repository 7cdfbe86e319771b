"""What the nodes of the graph say of themselves on `/diagnostics`: health, recording, why estimates
are not valid or doubtful.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

SILENT_AFTER = 3.0
"""[s] Time after which a node counts as silent: nodes speak once a second; three missed are no
jitter."""
FORGOTTEN_AFTER = 60.0
"""[s] Time after which a silent node is forgotten: one that was stopped on purpose, such as a
recorder, is no longer a fault of the graph."""
LEVELS = ("ok", "warning", "error", "stale")
"""Names of the levels of `diagnostic_msgs/DiagnosticStatus.level`."""
NOT_VALID_WORDS = "not valid: "
"""Words with which the estimator begins its reason, in its message or in a figure."""
DOUBTFUL_WORDS = "estimates are doubtful: "
"""Words with which it begins what it doubts."""
FREE_DISK, MESSAGES, MISSING_SAMPLES, READY = (
    "free disk [MB]",
    "messages",
    "missing samples",
    "ready",
)
"""Figures of the recorder, by which it is recognised whatever its name."""


@dataclass(frozen=True)
class Status:
    """Holds the last status message of a node.

    Attributes
    ----------
    level
        Index into `LEVELS`.
    message
        In words.
    figures
        Its numbers as text.
    heard
        When it came [s], monotonic.
    """

    level: int
    message: str
    figures: Mapping[str, str]
    heard: float


class GraphHealth:
    """Keeps the last status of every node."""

    def __init__(self) -> None:
        self._nodes: dict[str, Status] = {}
        self._faults: list[tuple[str, str]] = []

    def feed(
        self, name: str, level: int, message: str, figures: Mapping[str, str], now: float
    ) -> None:
        """Process one status at a monotonic time `now` [s]."""
        before = self._nodes.get(name)
        if level == 2 and (before is None or before.level != 2):
            self._faults.append((name, message))
        self._nodes[name] = Status(level, message, figures, now)

    def new_faults(self) -> list[tuple[str, str]]:
        """Return the nodes that went into error since the last call, with what they say."""
        faults, self._faults = self._faults, []
        return faults

    def nodes(self, now: float) -> list[dict[str, Any]]:
        """Return every node, the worst first, ready for JSON."""
        shown = []
        for name, status in self._nodes.items():
            if now - status.heard > FORGOTTEN_AFTER:
                continue
            silent = now - status.heard > SILENT_AFTER
            level = "silent" if silent else LEVELS[min(status.level, len(LEVELS) - 1)]
            message = (
                "says nothing any more; its last word was: " + status.message
                if silent
                else status.message
            )
            shown.append({"name": name, "level": level, "message": message[:300]})
        order = {"error": 0, "silent": 1, "stale": 1, "warning": 2, "ok": 3}
        return sorted(shown, key=lambda node: (order[node["level"]], node["name"]))

    def recording(self, now: float) -> dict[str, Any]:
        """Return the recorder's state: ``on``, ``messages``, ``missing``, ``free`` [MB].

        A value that is not known is None.
        """
        for status in self._nodes.values():
            if FREE_DISK in status.figures and MESSAGES in status.figures:
                on = (
                    now - status.heard <= SILENT_AFTER
                    and status.figures.get(READY) == "True"
                    and status.level < 2
                )
                return {
                    "on": on,
                    "messages": _whole(status.figures[MESSAGES]),
                    "missing": _whole(status.figures.get(MISSING_SAMPLES, "")),
                    "free": _whole(status.figures[FREE_DISK]),
                }
        return {"on": False, "messages": None, "missing": None, "free": None}

    def reason(self) -> str:
        """Return why estimates are not valid, in the estimator's words; empty without a reason."""
        return self._said(NOT_VALID_WORDS)

    def doubt(self) -> str:
        """Return why valid estimates are doubtful, in the estimator's words; empty where they are
        not.
        """
        return self._said(DOUBTFUL_WORDS)

    def _said(self, words: str) -> str:
        """Return what a node says behind these words, up to a semicolon; empty where none does."""
        for status in self._nodes.values():
            for text in (status.message, *status.figures.values()):
                said = text.partition(words)[2].partition(";")[0].strip()
                if said:
                    return said
        return ""


def _whole(text: str) -> int | None:
    return int(text) if text.isdigit() else None
