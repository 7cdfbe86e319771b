"""A minute of perturbation gives ``subject.yaml``, the model of this subject in this session."""

from __future__ import annotations

import copy
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ankle_physics.model import PAPER_TERMS, STATED, Model, StatedValue
from ankle_physics.rig_file import RigFile
from ankle_physics.term import Place
from calibration.errors import CalibrationError
from model_discrepancy.diagnose import diagnose
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.known_rig import SKEW
from model_discrepancy.recording.recording import Recording
from model_discrepancy.report.result_folder import AUGMENTED_FILE


@dataclass(frozen=True)
class CalibratedSession:
    """Holds a calibrated session.

    Attributes
    ----------
    model
        What is written to ``subject.yaml``.
    verdict
        Of the diagnosis, as in ``verdict.json``.
    """

    model: Model
    verdict: dict[str, Any]


def calibrate_session(
    source: Recording | Path | str,
    folder: Path | str,
    rig: RigFile | None = None,
    progress: Callable[[str], None] = lambda _: None,
) -> CalibratedSession:
    """Diagnose a recording and make the subject's model of what was found.

    Parameters
    ----------
    source
        A recording or a bag: 60 to 120 s of perturbation on the subject at rest or at a constant
        torque.
    folder
        Receives the diagnosis with its report.
    rig
        The calibrated rig, which is taken as known, so that only what it does not explain is
        diagnosed; None: everything that is found of the rig goes into the subject's model.
    progress
        Called with the present step.

    Raises
    ------
    CalibrationError
        The recording is a bad one; says why.
    session_recorder.errors.BagError
        No such bag or topic.
    """
    out = Path(folder)
    try:
        recording = source if isinstance(source, Recording) else Recording.from_bag(source)
    except DiagnosisError as error:
        raise CalibrationError(f"{source} cannot calibrate a session: {error}") from None
    found = diagnose(recording, out, progress=progress, rig=rig)
    verdict = found.verdict
    if verdict.verdict == "bad_recording" or found.found is None:
        reasons = "; ".join(verdict.reasons) or "bad recording"
        raise CalibrationError(f"{recording.name} cannot calibrate a session: {reasons}")
    model = subject_model(Model.load(out / AUGMENTED_FILE), f"subject of {recording.name}", rig)
    model.stated = stated_values(verdict.parameters)
    return CalibratedSession(model, {"verdict": verdict.verdict, "effects": verdict.effects})


def subject_model(diagnosed: Model, title: str, rig: RigFile | None = None) -> Model:
    """Return the part of a diagnosed model that the estimator has to know beside the rig's file.

    Parameters
    ----------
    diagnosed
        As the diagnosis writes it.
    title
        Free text of the new model.
    rig
        Its terms are left to it; None: what was found of the rig stays in the model, as nothing
        else would undo it.

    Returns
    -------
    Model
        Inertia, viscosity, stiffness and reflex follow the subject from moment to moment and are
        marked as tracked.
    """
    known = set() if rig is None else {SKEW, *(entry.term.name for entry in rig.model.entries)}
    entries = [
        copy.deepcopy(entry)
        for entry in diagnosed.entries
        if entry.term.name not in known and entry.term.place is not Place.ACTIVATION
    ]
    for entry in entries:
        entry.tracked = entry.term.name in PAPER_TERMS
    return Model(entries, title)


def stated_values(parameters: Mapping[str, Mapping[str, float | None]]) -> dict[str, StatedValue]:
    """Return K and G of the whole joint, with standard errors, as a diagnosis states them.

    The errors of single parameters do not say this: those of terms that share a torque are
    correlated, and none holds what the value owes to the choice of terms.

    Parameters
    ----------
    parameters
        The ``parameters`` of the verdict.
    """
    found = {}
    for key, given in parameters.items():
        symbol, error = key.split("[")[0], given.get("standard_error")
        value = given.get("augmented")
        if symbol in STATED and value is not None and error is not None:
            found[symbol] = StatedValue(float(value), float(error))
    return found
