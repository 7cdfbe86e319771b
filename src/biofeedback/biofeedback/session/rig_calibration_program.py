"""The calibration of a rig in the background: ``ankle calibrate rig``, which moves the plate."""

from __future__ import annotations

import os
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from biofeedback.errors import CommandError
from biofeedback.session.calibration_program import CalibrationProgram
from biofeedback.session.devices import CalibrationEnd
from biofeedback.session.protocol import RigMovement

FILE_BEFORE = "before.yaml"
"""The rig file that was replaced, in the folder of the calibration."""


class RigCalibrationProgram(CalibrationProgram):
    """Moves the plate of an armed and started rig, records it and writes the rig file.

    The rig file is replaced only by a calibration that went well. The one before it is kept in the
    folder of the calibration.

    Parameters
    ----------
    model
        The ``rig.yaml`` that it writes; with a spring on the plate the one that it completes.
    movement
        What is asked of the program.
    namespace, program
        As of `CalibrationProgram`.
    """

    what = "rig"
    starts, records = "starting to record; the plate will move", "the plate moves"
    meanwhile = "keep away from it"

    def __init__(
        self,
        model: Path,
        movement: RigMovement,
        namespace: str = "",
        program: tuple[str, ...] | None = None,
    ) -> None:
        super().__init__(model, namespace, program)
        self._movement = movement

    @property
    def recording(self) -> bool:
        """Tell whether the program still needs the rig: a calibration is computed in seconds."""
        return self.running and not self._reason

    def begin(self, seconds: float) -> None:
        """Start the program.

        Parameters
        ----------
        seconds
            For which the plate will move, for the progress.

        Raises
        ------
        CommandError
            It runs already, is not installed, or the file that a spring completes is missing.
        """
        movement = self._movement
        if movement.spring and not self.model.exists():
            raise CommandError(
                f"{self.model} is not there: calibrate the rig with its plate empty first, then "
                f"complete that file with the spring of {movement.spring:g} N.m/rad"
            )
        options = {
            "--out": "rig.yaml",
            "--title": movement.rig or self.model.stem,
            "--amplitude": f"{movement.amplitude:g}",
        }
        if movement.spring:
            options["--spring"] = f"{movement.spring:g}"
            options["--beside"] = str(self.model.absolute())
        self._start(seconds, options)

    def _computes(self, seconds: float) -> str:
        return "ending the movement and computing; keep away from the plate"

    def _end(self, result: Mapping[str, Any]) -> CalibrationEnd:
        made = self._folder / "rig.yaml"
        try:
            if self.model.exists():
                shutil.copy2(self.model, self._folder / FILE_BEFORE)
            complete = self.model.with_name(f".{self.model.name}.new")
            shutil.copyfile(made, complete)
            os.replace(complete, self.model)
        except OSError as error:
            return CalibrationEnd(f"{self.model} cannot be written ({error}); it is in {made}", {})
        figures = {str(name): str(text) for name, text in (result.get("found") or {}).items()}
        if remarks := result.get("remarks"):
            figures["note"] = "; ".join(map(str, remarks))
        return CalibrationEnd("", {**figures, "file": str(self.model.absolute())})
