"""The session's progress on disk, so that a restarted node continues where it was."""

from __future__ import annotations

import json
import os
import threading
import time
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from biofeedback.errors import CommandError
from biofeedback.session.durable_file import replace_file


def state_folder() -> Path:
    """Return the folder for what outlives a process on this computer."""
    base = Path(os.environ.get("XDG_STATE_HOME") or Path.home() / ".local" / "state")
    return base / "ankle"


def default_path(port: int, subject: str = "", visit: int = 0) -> Path:
    """Return where the state of the node at a port is kept; two nodes never share a port.

    Parameters
    ----------
    port
        Of the pages.
    subject, visit
        Pseudonym and number of the visit, where they are known: what was measured of one subject
        is never continued with another.
    """
    named = f"_{subject}_{visit}" if subject else ""
    return state_folder() / f"biofeedback_{port}{named}.json"


def save(path: Path, content: Mapping[str, Any], now: float) -> None:
    """Write a state so that after a crash the file holds the old or the new one.

    Parameters
    ----------
    path
        File to write.
    content
        What is written, as YAML knows it.
    now
        Wall time [s].

    Raises
    ------
    OSError
        The disk refuses.
    """
    replace_file(path, json.dumps({**content, "saved_at[s]": now}))


def load(path: Path, now: float, longest: float) -> dict[str, Any] | None:
    """Return the saved state; None where there is none, or it is older than `longest` [s].

    An older one belongs to an earlier session.

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


def write_private(path: Path, text: str) -> None:
    """Write a file that only its owner may read, whatever it was before.

    Raises
    ------
    OSError
        The disk refuses.
    """
    path.parent.mkdir(parents=True, exist_ok=True)
    path.unlink(missing_ok=True)
    descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o600)
    with os.fdopen(descriptor, "w") as stream:
        stream.write(text)


SAVE_PERIOD = 1.0
"""[s] What a crash may cost of a step's clock."""


class ProgressKeeper:
    """Keeps progress on disk: at each step, and once in `SAVE_PERIOD` while the clock runs.

    Parameters
    ----------
    path
        Path of the file.
    present
        Progress at the start, which needs not be written.
    on_failure
        Called with the reason where the disk refuses.
    clock
        Gives monotonic time [s].
    """

    def __init__(
        self,
        path: Path,
        present: dict[str, Any],
        on_failure: Callable[[str], None],
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._writer = ProgressWriter(path, on_failure)
        self._clock = clock
        self._saved, self._saved_at = present, clock()

    def keep(self, present: dict[str, Any]) -> None:
        """Write the progress where it is due; this returns at once."""
        timeless = {"elapsed": 0.0, "clock": 0.0}
        stepped = {**present, **timeless} != {**self._saved, **timeless}
        early = self._clock() - self._saved_at < SAVE_PERIOD
        if not stepped and (present == self._saved or early):
            return
        self._saved, self._saved_at = present, self._clock()
        self._writer.keep(present)

    def close(self) -> None:
        """Write what is left."""
        self._writer.close()


def worth_resuming(found: Mapping[str, Any] | None) -> bool:
    """Return whether a saved session has got anywhere."""
    return found is not None and bool(
        found.get("state") not in ("idle", "finished") or found.get("index") or found.get("checks")
    )


class ProgressWriter:
    """Writes the newest progress in a thread of its own: a slow disk delays nothing but the file.

    Parameters
    ----------
    path
        Path of the file.
    on_failure
        Called with the reason where the disk refuses.
    write
        Writes a content to a path so that a crash leaves the old or the new one.
    """

    def __init__(
        self,
        path: Path,
        on_failure: Callable[[str], None],
        write: Callable[[Path, Mapping[str, Any]], None] | None = None,
    ) -> None:
        self._path = path
        self._on_failure = on_failure
        self._write_content = write or (lambda path, content: save(path, content, time.time()))
        self._newest: Mapping[str, Any] | None = None
        self._wake = threading.Event()
        self._closing = False
        self._thread = threading.Thread(target=self._write, name="progress", daemon=True)
        self._thread.start()

    def keep(self, content: Mapping[str, Any]) -> None:
        """Hand over the progress to be written as soon as the disk can; this returns at once."""
        self._newest = content
        self._wake.set()

    def _write(self) -> None:
        while not self._closing or self._newest is not None:
            self._wake.wait()
            self._wake.clear()
            content, self._newest = self._newest, None
            if content is None:
                continue
            try:
                self._write_content(self._path, content)
            except OSError as error:
                self._on_failure(f"progress is not kept: {error}")

    def close(self, patience: float = 3.0) -> None:
        """Write what is left, for at most `patience` [s], and end the thread."""
        self._closing = True
        self._wake.set()
        self._thread.join(timeout=patience)
