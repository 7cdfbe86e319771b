"""A calibration in the background: the program ``ankle calibrate``, started by the step of a
protocol or from the operator's page, watched, and ended with the perturbation.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from abc import ABC, abstractmethod
from collections.abc import Mapping
from pathlib import Path
from signal import SIGTERM
from typing import Any, ClassVar

from ankle_node.parent_process import end_with_parent
from ankle_node.real_time import leave_priority
from biofeedback.errors import CommandError
from biofeedback.session.devices import CalibrationEnd

END_PATIENCE = 3.0
"""[s] Time for the program to close its recording after it was asked to end."""


def _begin() -> None:
    """Prepare the program's process: it ends with the pages, and computes behind the rig."""
    end_with_parent(SIGTERM)
    leave_priority()


class CalibrationProgram(ABC):
    """Starts the program, follows it and reads its result; nothing here waits.

    What is calibrated, a rig or a session, its subclasses say.

    Parameters
    ----------
    model
        The file that is calibrated; recordings and reports stand in folders beside it.
    namespace
        Of the laboratory that is recorded.
    program
        The command and its first arguments; None finds ``ankle`` beside this Python or on the path.
    """

    what: ClassVar[str]
    """What is calibrated: the word behind ``ankle calibrate``."""
    starts: ClassVar[str]
    records: ClassVar[str]
    meanwhile: ClassVar[str]
    """What it does before and while it records, and what people do then."""

    def __init__(
        self, model: Path, namespace: str = "", program: tuple[str, ...] | None = None
    ) -> None:
        self.model, self._namespace = model, namespace.strip("/")
        self._program = program
        self._process: subprocess.Popen[bytes] | None = None
        self._folder = Path()
        self._began: float | None = None
        self._seconds = 0.0
        self._cancelled_at = 0.0
        self._reason = ""

    @property
    def running(self) -> bool:
        """Tell whether the program was started and `ended` has not reported its end yet."""
        return self._process is not None

    @property
    @abstractmethod
    def recording(self) -> bool:
        """Tell whether the program still needs the moving plate."""

    @abstractmethod
    def begin(self, seconds: float) -> None:
        """Start the program, for so many seconds of the moving plate; raises `CommandError`."""

    def progress(self) -> str:
        """Return what the program does now, for the operator."""
        if self._reason:
            return f"ending: {self._reason}"
        passed = self._recorded
        if self._began is None:
            return f"{self.starts}; {self.meanwhile}"
        if passed < self._seconds:
            return f"{self.records}, {passed:.0f} of {self._seconds:.0f} s; {self.meanwhile}"
        return self._computes(passed - self._seconds)

    @abstractmethod
    def _computes(self, seconds: float) -> str:
        """Return what the program does so long [s] after the recording."""

    @property
    def _bag(self) -> Path:
        return self._folder / "recording"

    @property
    def _recorded(self) -> float:
        """Return the time since the recorder was ready [s]; 0 before."""
        if self._began is None and self._bag.exists():
            self._began = time.monotonic()
        return 0.0 if self._began is None else time.monotonic() - self._began

    def _start(self, seconds: float, options: Mapping[str, str], *switches: str) -> None:
        """Start the program in a new folder, beside the options that both calibrations have.

        Parameters
        ----------
        seconds
            For which it records.
        options
            Value of each option; those with an empty value are left out.
        switches
            Options without a value.

        Raises
        ------
        CommandError
            It runs already, or is not installed.
        """
        if self.running:
            raise CommandError(f"the {self.what} is being calibrated already")
        program = self._program or _installed_program()
        self._folder = self._new_folder()
        options = {"--bag": str(self._bag), "--namespace": self._namespace, **options}
        words = [word for option in options.items() if option[1] for word in option]
        with self._output.open("wb") as stream:
            self._process = subprocess.Popen(
                [*program, "calibrate", self.what, "--json", "--overwrite", *switches, *words],
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                cwd=self._folder,
                start_new_session=True,
                preexec_fn=_begin,
            )
        self._began, self._seconds, self._reason = None, seconds, ""

    def _new_folder(self) -> Path:
        self.model.parent.mkdir(parents=True, exist_ok=True)
        prefix = f"{self.model.stem}_calibration_"
        return Path(tempfile.mkdtemp(prefix=prefix, dir=self.model.parent)).resolve()

    @property
    def _output(self) -> Path:
        return self._folder / "output.txt"

    def cancel(self, reason: str) -> None:
        """Ask the program to end; `ended` then gives the reason."""
        if self._process is not None and not self._reason:
            self._reason, self._cancelled_at = reason, time.monotonic()
            self._process.send_signal(SIGTERM)

    def ended(self) -> CalibrationEnd | None:
        """Return how the calibration ended, once; None before."""
        process = self._process
        if process is None:
            return None
        if process.poll() is None:
            if self._reason and time.monotonic() - self._cancelled_at > END_PATIENCE:
                process.kill()
            return None
        self._process = None
        said = self._output.read_text(encoding="utf-8", errors="replace")
        if self._reason:
            return CalibrationEnd(self._reason, {})
        if process.returncode != 0:
            lines = said.strip().splitlines() or [f"it ended with code {process.returncode}"]
            return CalibrationEnd(f"{lines[-1]} (all of it: {self._output})", {})
        return self._end(_result(said))

    @abstractmethod
    def _end(self, result: Mapping[str, Any]) -> CalibrationEnd:
        """Return the end of a calibration that went well, from what the program printed."""

    def close(self) -> None:
        """End the program and wait for it."""
        self.cancel("the screens were ended")
        deadline = time.monotonic() + 2.0 * END_PATIENCE
        while self.running and time.monotonic() < deadline:
            self.ended()
            time.sleep(0.02)


def _installed_program() -> tuple[str, ...]:
    beside = Path(sys.executable).with_name("ankle")
    found = str(beside) if beside.exists() else shutil.which("ankle")
    if found is None:
        raise CommandError("the command 'ankle' is not installed on this computer")
    return (found,)


def _result(said: str) -> dict[str, Any]:
    """Return what the program printed as JSON; empty where it printed none."""
    try:
        found = json.loads(said[said.index("{") :])
    except ValueError:
        return {}
    return found if isinstance(found, dict) else {}
