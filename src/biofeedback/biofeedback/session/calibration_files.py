"""The check list's entries that files answer: is the rig's calibration in date, was this session
calibrated.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from datetime import datetime, timezone
from pathlib import Path
from typing import Any

from ankle_physics.errors import ModelError
from biofeedback.errors import CommandError
from biofeedback.session.check_list import SESSION_CALIBRATION

SESSION_CALIBRATION_HOURS = 12.0
"""[h] Age up to which a subject's model counts as one of this visit: electrodes, straps and posture
are new on every day."""
FileCheck = Callable[[], Mapping[str, Any]]


def file_checks(rig_file: str, valid_days: float, subject_file: str) -> dict[str, FileCheck]:
    """Return what answers the entries ``rig_calibration`` and ``session_calibration``.

    Parameters
    ----------
    rig_file
        Path of ``rig.yaml``; may be empty.
    valid_days
        For how long a rig's calibration holds [d].
    subject_file
        Path of ``subject.yaml``; may be empty.
    """
    return {
        "rig_calibration": lambda: rig_calibration(rig_file, valid_days),
        SESSION_CALIBRATION: lambda: session_calibration(subject_file),
    }


def rig_calibration(path: str, valid_days: float, now: datetime | None = None) -> dict[str, Any]:
    """Return rig, date and age of a calibration that is in date.

    Raises
    ------
    CommandError
        There is none, it cannot be read, or it is too old; says what to do.
    """
    again = "calibrate with 'ankle calibrate rig --out rig.yaml' and set the parameter rig_file"
    if not path:
        raise CommandError(f"no rig file is named; {again}")
    # The physics brings a compiler that takes half a second to load: only where there is a file.
    from ankle_physics.rig_file import RigFile

    try:
        rig = RigFile.load(path)
    except (ModelError, OSError) as error:
        raise CommandError(f"{error}; {again}") from None
    age = rig.age(now or datetime.now(timezone.utc))
    if not 0.0 <= age <= valid_days:
        raise CommandError(
            f"the rig was calibrated {age:.0f} days ago ({rig.calibrated:%Y-%m-%d}); allowed: 0 to "
            f"{valid_days:g} days; calibrate again with 'ankle calibrate rig'"
        )
    return {"calibrated": f"{rig.calibrated:%Y-%m-%d}", "age[d]": round(age, 1)}


def session_calibration(path: str, now: float | None = None) -> dict[str, Any]:
    """Return the terms of the subject's model of this visit.

    Raises
    ------
    CommandError
        There is none, it cannot be read, or it is of another day; says what to do.
    """
    again = (
        "a protocol with 'calibration[s]' makes it, or 'ankle calibrate session --seconds 90 --out "
        "subject.yaml' with the subject at rest"
    )
    if not path:
        raise CommandError(f"no subject file is named (parameter subject_file); {again}")
    from ankle_physics.model import Model

    try:
        model = Model.load(path)
        hours = ((time.time() if now is None else now) - Path(path).stat().st_mtime) / 3600.0
    except FileNotFoundError:
        raise CommandError(f"{path} is not there; {again}") from None
    except (ModelError, OSError) as error:
        raise CommandError(f"{error}; {again}") from None
    if hours > SESSION_CALIBRATION_HOURS:
        raise CommandError(
            f"{path} is {hours:.0f} h old; allowed: up to {SESSION_CALIBRATION_HOURS:g} h; {again}"
        )
    return {"terms": ", ".join(entry.term.name for entry in model.entries)}


def subject_file_of(named: str, subject: str, visit: int, folder: Path, now: float) -> Path:
    """Return where the subject's model of this visit is.

    Parameters
    ----------
    named
        The path that was asked for; empty for one in `folder`.
    subject
        Pseudonym; empty where it is not stated, and the model is then that of this start alone.
    visit
        Counted from 1; 0 where it is not stated.
    folder
        For models whose place is not named.
    now
        Wall time [s].
    """
    if named:
        return Path(named)
    stated = f"{subject}_visit_{visit}" if subject and visit else f"{round(now)}"
    return folder / f"subject_{stated}.yaml"
