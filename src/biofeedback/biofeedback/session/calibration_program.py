"""The calibration of a session in the background: the program ``ankle calibrate session``, started
from the operator's page or by the protocol's step, watched, and ended with the perturbation.
"""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from signal import SIGTERM
from typing import Any

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


class CalibrationProgram:
    """Starts the program, follows it and reads its result; nothing here waits.

    Parameters
    ----------
    model
        The ``subject.yaml`` that it writes; the recording and the report stand beside it. Whoever
        runs the program hands it to the estimator.
    rig_file
        The calibrated rig, undone before the diagnosis; empty for none.
    namespace
        Of the laboratory that is recorded.
    program
        The command and its first arguments; None finds ``ankle`` beside this Python or on the path.
    """

    def __init__(
        self,
        model: Path,
        rig_file: str = "",
        namespace: str = "",
        program: tuple[str, ...] | None = None,
    ) -> None:
        self.model, self._rig_file, self._namespace = model, rig_file, namespace.strip("/")
        self._program = program
        self._process: subprocess.Popen[bytes] | None = None
        self._output = Path()
        self._bag = Path()
        self._began: float | None = None
        self._seconds = self._cancelled_at = 0.0
        self._reason = ""

    @property
    def running(self) -> bool:
        """Tell whether the program was started and `ended` has not reported its end yet."""
        return self._process is not None

    @property
    def recording(self) -> bool:
        """Tell whether the program still needs the perturbation."""
        return self.running and not self._reason and self._recorded < self._seconds

    @property
    def _recorded(self) -> float:
        """Return the time since the recorder was ready [s]; 0 before."""
        if self._began is None and self._bag.exists():
            self._began = time.monotonic()
        return 0.0 if self._began is None else time.monotonic() - self._began

    def begin(self, seconds: float) -> None:
        """Start the program.

        Parameters
        ----------
        seconds
            Of the running perturbation to record.

        Raises
        ------
        CommandError
            It runs already, or is not installed.
        """
        if self.running:
            raise CommandError("the session is being calibrated already")
        program = self._program or _installed_program()
        self.model.parent.mkdir(parents=True, exist_ok=True)
        prefix = f"{self.model.stem}_calibration_"
        folder = Path(tempfile.mkdtemp(prefix=prefix, dir=self.model.parent))
        self._bag = folder / "recording"
        options = {
            "--seconds": f"{seconds:g}",
            "--out": str(self.model),
            "--bag": str(self._bag),
            "--report": str(folder / "diagnosis"),
            "--rig": self._rig_file,
            "--namespace": self._namespace,
        }
        words = [word for option in options.items() if option[1] for word in option]
        self._output = folder / "output.txt"
        with self._output.open("wb") as stream:
            self._process = subprocess.Popen(
                [
                    *program,
                    "calibrate",
                    "session",
                    "--json",
                    "--overwrite",
                    "--no-hand-over",
                    *words,
                ],
                stdin=subprocess.DEVNULL,
                stdout=stream,
                stderr=subprocess.STDOUT,
                start_new_session=True,
                preexec_fn=_begin,
            )
        self._began, self._seconds, self._reason = None, seconds, ""

    def progress(self) -> str:
        """Return what the program does now, for the operator."""
        if self._reason:
            return f"ending: {self._reason}"
        passed = self._recorded
        if self._began is None:
            return "starting to record; the subject relaxes"
        if passed < self._seconds:
            return f"recording, {passed:.0f} of {self._seconds:.0f} s; the subject relaxes"
        return f"diagnosing, {passed - self._seconds:.0f} s so far; one to three minutes are usual"

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
        return CalibrationEnd("", _figures(said))

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


def _figures(said: str) -> dict[str, Any]:
    """Return what the program printed as JSON, as the check list shows it."""
    try:
        found = json.loads(said[said.index("{") :])
    except ValueError:
        return {}
    effects = [str(effect["name"]).replace("_", " ") for effect in found.get("effects", [])]
    return {"found": ", ".join(effects) or "nothing beyond the basic model"}
