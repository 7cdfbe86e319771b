"""The folder that a diagnosis writes: verdict, models, rig and report."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from model_discrepancy.criticism.stated_fit import stated_fit
from model_discrepancy.fit.standard_errors import with_errors
from model_discrepancy.report.fitted_model import fitted_model
from model_discrepancy.report.html_report import write_report

if TYPE_CHECKING:
    from model_discrepancy.diagnose import Diagnosis

BASE_FILE, AUGMENTED_FILE = "base.yaml", "model.yaml"
# The calibrated rig that a diagnosis took as known.
RIG_FILE = "rig.yaml"


def write_results(diagnosis: Diagnosis, rig: RigFile | None, folder: Path) -> None:
    """Write everything that a diagnosis found.

    Parameters
    ----------
    diagnosis
        Of a recording, usable or not.
    rig
        That was taken as known; None for none.
    folder
        It is made where there is none.
    """
    folder.mkdir(parents=True, exist_ok=True)
    diagnosis.verdict.save(folder / "verdict.json")
    if diagnosis.found is not None:
        title = f"{diagnosis.recording.name}: base model, fitted by diagnosis"
        fitted_model(diagnosis.found.base, title).save(folder / BASE_FILE)
        augmented_model(diagnosis).save(folder / AUGMENTED_FILE)
    if rig is not None:
        rig.save(folder / RIG_FILE)
    write_report(diagnosis, folder / "report.html")


def augmented_model(diagnosis: Diagnosis) -> Model:
    """Return the fitted model, with the missing block as a term where the recording is unexplained.

    Parameters
    ----------
    diagnosis
        Of a usable recording.
    """
    assert diagnosis.problem is not None
    assert diagnosis.found is not None
    assert diagnosis.criticism is not None
    final = diagnosis.criticism.stated
    block = diagnosis.criticism.block
    if block is not None:
        # What the block and the other terms share is divided anew.
        fitter = diagnosis.problem.fitter
        missing = block.term_values(fitter.columns.mean_angle)
        values = {**final.values, "missing_block": missing}
        together = with_errors(fitter, fitter.fit(list(values), values, evaluations=10))
        final = stated_fit(fitter, together, diagnosis.criticism.after)
    return fitted_model(final, f"{diagnosis.recording.name}: fitted by diagnosis")
