"""What the session reads from the signals: beside the torque at rest, in parts of the largest
contraction.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np

from ankle_interfaces.topics import EMG_RESPONSES
from biofeedback.errors import CommandError
from biofeedback.live_signals import GOOD, Snapshot
from biofeedback.session.conditioning import Conditioning, Response, largest_activity
from biofeedback.session.session_program import Session
from biofeedback.session.target import Reading
from emg_driver.muscles import STRETCHED_BY

Results = Mapping[str, Mapping[str, Any]]
"""Results of the check list, by the name of the check."""


def rest_torque(session: Session, results: Results) -> float:
    """Return the subject's torque at rest [N.m]: of the baseline, or of the check list's zero."""
    if session.baseline is not None:
        return session.baseline.torque
    return float(results.get("zero", {}).get("torque[N.m]", 0.0))


def read(session: Session, results: Results, found: Snapshot, rows: list[np.ndarray]) -> Reading:
    """Return the reading of one moment.

    Parameters
    ----------
    session
        Says what torque at rest and which muscle are meant.
    results
        Of the check list.
    found
        The signals at this moment.
    rows
        Responses since the reading before, rows of the topic ``emg/responses``.
    """
    valid = found.quality == GOOD and found.torque_quality == GOOD
    torque = found.torque - rest_torque(session, results)
    conditioning = session.conditioning
    if conditioning is None:
        return Reading(found.K, found.G, torque, valid)
    return Reading(
        found.K,
        found.G,
        torque if found.torque_quality == GOOD else math.nan,
        valid,
        _activity(conditioning, results, found),
        tuple(_responses(rows, conditioning.course.muscle)),
    )


def _activity(conditioning: Conditioning, results: Results, found: Snapshot) -> float:
    """Return the activity of the course's muscle [MVC]; NaN while it is not known."""
    present = found.emg.get(conditioning.course.muscle, math.nan)
    if found.emg_quality != GOOD:
        return math.nan
    try:
        return present / largest_activity(conditioning.course, results)
    except CommandError:
        return math.nan


def _responses(rows: list[np.ndarray], muscle: str) -> list[Response]:
    """Return the responses of a muscle to stretches that lengthen it, in order of their onsets."""
    size = EMG_RESPONSES.columns.index(f"reflex_{muscle}[V.s]")
    lengthening = STRETCHED_BY[muscle]
    return [Response(float(row[0]), float(row[size])) for row in rows if row[1] == lengthening]
