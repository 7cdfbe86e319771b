"""What a restarted node needs to know of a session in order to go on with it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import asdict, dataclass
from typing import Any

from biofeedback.errors import CommandError
from biofeedback.session.axis_calibration import Baseline
from biofeedback.session.protocol import Protocol
from biofeedback.session.target import Target


@dataclass(frozen=True)
class Progress:
    """Holds how far a session has come; the fields are those of `Session`.

    Attributes
    ----------
    protocol
        Digest of the protocol.
    own
        The target that the operator has set; None where it is the plan's.
    """

    protocol: str
    state: str
    index: int
    elapsed: float
    clock: float
    baseline: Baseline | None
    own: Target | None
    holds_done: int
    hits: int

    def content(self) -> dict[str, Any]:
        """Return the progress ready for JSON."""
        return asdict(self)


def progress_from(
    content: Mapping[str, Any], protocol: Protocol, states: Collection[str]
) -> Progress:
    """Return the progress that was kept in a file.

    Parameters
    ----------
    content
        As `Progress.content` gave it; other keys are allowed.
    protocol
        The protocol that the session follows now.
    states
        Names of the session's states.

    Raises
    ------
    CommandError
        It is of another protocol, or damaged.
    """
    if content.get("protocol") != protocol.digest:
        raise CommandError("the saved session followed another protocol")
    try:
        baseline = content["baseline"]
        progress = Progress(
            protocol.digest,
            str(content["state"]),
            int(content["index"]),
            float(content["elapsed"]),
            float(content["clock"]),
            None if baseline is None else Baseline(**{k: float(v) for k, v in baseline.items()}),
            Target(**content["own"]) if content["own"] else None,
            int(content.get("holds_done", 0)),
            int(content.get("hits", 0)),
        )
        if not 0 <= progress.hits <= progress.holds_done:
            raise ValueError(f"{progress.hits} hits of {progress.holds_done} holds")
        if progress.state not in states or not 0 <= progress.index < len(protocol.steps):
            raise ValueError(f"state {progress.state}, step {progress.index}")
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise CommandError(f"the saved session is damaged: {error}") from None
    return progress
