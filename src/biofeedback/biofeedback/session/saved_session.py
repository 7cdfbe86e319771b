"""The session on disk, so that a restarted node goes on where it was."""

from __future__ import annotations

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from biofeedback.errors import CommandError


def default_path(port: int) -> Path:
    """Where the state of the node that serves a port is kept; two nodes never share a port."""
    base = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")
    return base / "ankle" / f"biofeedback_{port}.json"


def save(path: Path, content: Mapping[str, Any], now: float) -> None:
    """Write a state; a reader sees the old one or the new one, never half of it, also after the
    power went off.

    Parameters
    ----------
    now
        Wall time [s].

    Raises
    ------
    OSError
        The disk refuses.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    beside = path.with_name(path.name + ".new")
    with beside.open("w") as stream:
        json.dump({**content, "saved_at[s]": now}, stream)
        stream.flush()
        os.fsync(stream.fileno())
    beside.replace(path)


def load(path: Path, now: float, longest: float) -> dict[str, Any] | None:
    """The saved state; None where there is none, or it is older than `longest` [s]: then it is of
    an earlier session.

    Raises
    ------
    CommandError
        It cannot be read; says which file.
    """
    try:
        content = json.loads(path.read_text())
        age = now - float(content["saved_at[s]"])
    except FileNotFoundError:
        return None
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise CommandError(
            f"the saved session {path} cannot be read ({type(error).__name__}: {error}); starting "
            "anew"
        ) from None
    return content if 0.0 <= age <= longest else None
