"""A minute of perturbation gives ``subject.yaml``, the model of this subject in this session."""

from __future__ import annotations

import copy
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ankle_physics.model import Model
from ankle_physics.term import Owner, Place
from calibration.errors import CalibrationError
from model_discrepancy.diagnose import AUGMENTED_FILE, diagnose

TRACKED_TERMS = ("inertia", "viscosity", "stiffness")
"""Intrinsic terms that follow the subject from moment to moment; reflex arcs do as well."""


@dataclass(frozen=True)
class CalibratedSession:
    """A calibrated session.

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
    bag: Path | str, folder: Path | str, progress: Callable[[str], None] = lambda _: None
) -> CalibratedSession:
    """Diagnose a recording and make the subject's model of what was found.

    Parameters
    ----------
    bag
        60 to 120 s of perturbation on the subject at rest or at a constant torque.
    folder
        Receives the diagnosis with its report.
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
    found = diagnose(bag, out, progress=progress)
    verdict = found.verdict
    if verdict.verdict == "bad_recording" or found.found is None:
        raise CalibrationError(
            f"{bag} cannot calibrate a session: {'; '.join(verdict.reasons) or 'bad recording'}"
        )
    model = subject_model(Model.load(out / AUGMENTED_FILE), f"subject of {Path(bag).name}")
    return CalibratedSession(model, {"verdict": verdict.verdict, "effects": verdict.effects})


def subject_model(diagnosed: Model, title: str) -> Model:
    """Return the subject's part of a diagnosed model, with what follows the subject marked as
    tracked.

    Parameters
    ----------
    diagnosed
        As the diagnosis writes it.
    title
        Free text of the new model.
    """
    entries = [
        copy.deepcopy(entry)
        for entry in diagnosed.entries
        if entry.term.belongs_to is Owner.SUBJECT and entry.term.place is not Place.ACTIVATION
    ]
    for entry in entries:
        entry.tracked = (
            entry.term.name in TRACKED_TERMS or entry.term.place is Place.REFLEX_DYNAMICS
        )
    return Model(entries, title)
