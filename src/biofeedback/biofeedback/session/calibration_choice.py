"""Which calibration a protocol asks for: that of the rig, or that of the session."""

from __future__ import annotations

from pathlib import Path

from biofeedback.session.calibration_program import CalibrationProgram
from biofeedback.session.protocol import Protocol
from biofeedback.session.rig_calibration_program import RigCalibrationProgram
from biofeedback.session.saved_session import state_folder
from biofeedback.session.session_calibration_program import SessionCalibrationProgram

RIG_FILE_NAME = "rig.yaml"
"""Name of the rig file where none is stated, in the folder of the sessions' progress."""


def calibration_of(
    protocol: Protocol, rig_file: str, model: Path, namespace: str
) -> CalibrationProgram:
    """Return what calibrates the rig where the protocol does that, else the session.

    Parameters
    ----------
    protocol
        Of the session.
    rig_file
        Path of ``rig.yaml``; may be empty.
    model
        Path of ``subject.yaml``.
    namespace
        Of the laboratory.
    """
    if protocol.rig_movement is None:
        return SessionCalibrationProgram(
            model, rig_file, namespace, at_most=protocol.diagnosis_minutes
        )
    rig = Path(rig_file) if rig_file else state_folder() / RIG_FILE_NAME
    return RigCalibrationProgram(rig, protocol.rig_movement, namespace)
