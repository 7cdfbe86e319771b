"""The calibration of a session in the background: ``ankle calibrate session``."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from biofeedback.session.calibration_program import CalibrationProgram
from biofeedback.session.devices import CalibrationEnd


class SessionCalibrationProgram(CalibrationProgram):
    """Records the running perturbation and diagnoses it.

    Parameters
    ----------
    model
        The ``subject.yaml`` that it writes. Whoever runs the program hands it to the estimator.
    rig_file
        The calibrated rig, undone before the diagnosis; empty for none.
    namespace, program
        As of `CalibrationProgram`.
    at_most
        Time after which the diagnosis adds no further terms [min]; None for no limit.
    """

    what = "session"
    starts, records, meanwhile = "starting to record", "recording", "the subject relaxes"

    def __init__(
        self,
        model: Path,
        rig_file: str = "",
        namespace: str = "",
        program: tuple[str, ...] | None = None,
        at_most: float | None = None,
    ) -> None:
        super().__init__(model, namespace, program)
        self._at_most = at_most
        self._rig_file = str(Path(rig_file).resolve()) if rig_file else ""

    @property
    def recording(self) -> bool:
        """Tell whether the program still needs the perturbation."""
        return self.running and not self._reason and self._recorded < self._seconds

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
        options = {
            "--seconds": f"{seconds:g}",
            "--out": str(self.model.absolute()),
            "--report": "diagnosis",
            "--rig": self._rig_file,
            "--at-most": "" if self._at_most is None else f"{self._at_most:g}",
        }
        self._start(seconds, options, "--no-hand-over")

    def _computes(self, seconds: float) -> str:
        # As measured: a simulated subject takes one to three minutes, a person up to ten. What
        # was found at the limit is still weighed.
        usual = "up to ten minutes are usual"
        if self._at_most is not None:
            usual = f"nothing is added after {self._at_most:g} min"
        return f"diagnosing, {seconds:.0f} s so far; {usual}"

    def _end(self, result: Mapping[str, Any]) -> CalibrationEnd:
        effects = [str(effect["name"]).replace("_", " ") for effect in result.get("effects", [])]
        figures = {"found": ", ".join(effects) or "nothing beyond the basic model"}
        if warnings := result.get("warnings"):
            figures["warning"] = "; ".join(map(str, warnings))
        return CalibrationEnd("", figures)
