"""A recording is read and checked before anything is fitted to it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from model_discrepancy.errors import DiagnosisError
from model_discrepancy.recording.channel_gains import (
    Finding,
    channel_findings,
    late_finding,
    trusted,
)
from model_discrepancy.recording.known_rig import on_time
from model_discrepancy.recording.motion import motion_step
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import faults
from model_discrepancy.recording.servo import identify_servo

STRANGE_COMMAND_SENTENCE = (
    "the recorded command is not used: the position does not follow it, as if it were that of "
    "another recording"
)


@dataclass(frozen=True)
class Reading:
    """Holds a recording and what its channels show by themselves.

    Attributes
    ----------
    recording
        As it was read.
    faults
        Why it cannot be used, one sentence each; empty for a usable one.
    findings
        What is wrong with a channel of a usable recording.
    trusted
        The recording without what these findings make doubtful.
    """

    recording: Recording
    faults: list[str]
    findings: list[Finding]
    trusted: Recording

    def on_time(self, late: float, error: float) -> Reading:
        """Return the reading with a torque channel that is late put right, and named.

        Parameters
        ----------
        late, error
            By how much it is late, and the standard error [s].
        """
        torque = on_time(self.trusted.torque, self.trusted.rate, late)
        findings = [*self.findings, late_finding(late, error)]
        return replace(self, findings=findings, trusted=replace(self.trusted, torque=torque))


def open_recording(source: Recording | str | Path) -> Recording:
    """Return a recording, or the one in a bag; one that cannot be read says why.

    Raises
    ------
    BagError
        No such bag.
    """
    try:
        return source if isinstance(source, Recording) else Recording.from_bag(source)
    except DiagnosisError as error:
        return Recording.unreadable(str(source), str(error))


def check(recording: Recording) -> Reading:
    """Check the channels of a recording."""
    if reasons := faults(recording):
        return Reading(recording, reasons, [], recording)
    servo = identify_servo(recording, motion_step(recording))
    if servo is None and recording.reference is not None and np.ptp(recording.reference) > 0.0:
        recording = replace(recording, notes=(*recording.notes, STRANGE_COMMAND_SENTENCE))
    findings = channel_findings(recording, servo)
    return Reading(recording, [], findings, trusted(recording, findings))
