"""The folder that a diagnosis writes: verdict, models, rig and report."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ankle_interfaces.value_text import with_error, with_unit
from ankle_physics.joint_profile import joint_in_force
from ankle_physics.model import TERMS_OF_GAINS, Model, StatedValue
from ankle_physics.rig_file import RigFile
from model_discrepancy.criticism.stated_fit import stated_fit
from model_discrepancy.fit.standard_errors import with_errors
from model_discrepancy.recording.known_rig import SKEW
from model_discrepancy.report.fitted_model import fitted_model
from model_discrepancy.report.html_report import write_report

if TYPE_CHECKING:
    from model_discrepancy.diagnose import Diagnosis

BASE_FILE, AUGMENTED_FILE = "base.yaml", "model.yaml"
# The calibrated rig that a diagnosis took as known.
RIG_FILE = "rig.yaml"
_ABOUT_ERRORS = """\
# The standard error of a term holds only if the terms below are the right ones: it does not contain
# what the value owes to the choice of terms. Those of the whole joint do, at the recording's mean
# position and torque:
"""


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
        save_stated(
            augmented_model(diagnosis), diagnosis.verdict.parameters, folder / AUGMENTED_FILE
        )
    if rig is not None:
        rig.save(folder / RIG_FILE)
    write_report(diagnosis, folder / "report.html")


def save_stated(model: Model, parameters: Mapping[str, Mapping[str, Any]], path: Path) -> None:
    """Write a fitted model with the standard errors that hold: those of K and G stand under
    ``impedance``, and those of all stated values in a comment.

    A term's own standard errors follow from its fit. They hold if the terms are the right ones, and
    who follows the shape of one term within this model needs them.

    Parameters
    ----------
    model
        With the standard errors of its fit.
    parameters
        Of the verdict.
    path
        The file.
    """
    stated = []
    for key, given in parameters.items():
        value, error = given["augmented"], given["standard_error"]
        symbol = key.split("[")[0]
        if error is not None and symbol in TERMS_OF_GAINS and model.has(TERMS_OF_GAINS[symbol]):
            model.stated[symbol] = StatedValue(float(value), float(error))
        text = with_error((value, math.nan if error is None else error))
        stated.append(f"#   {joint_in_force().in_units(with_unit(key))}: {text}\n")
    model.save(path)
    content = path.read_text(encoding="utf-8")
    path.write_text(f"{_ABOUT_ERRORS}{''.join(stated)}{content}", encoding="utf-8")


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
    for finding in diagnosis.findings:
        if finding.name == SKEW:
            # The search did not see it, but a simulation of the recording does.
            late, error = finding.parameters["skew[s]"]
            late += final.values.get(SKEW, {"skew": 0.0})["skew"]
            values = {**final.values, SKEW: {"skew": late}}
            final = replace(final, values=values, errors={**final.errors, SKEW: {"skew": error}})
    return fitted_model(final, f"{diagnosis.recording.name}: fitted by diagnosis")
