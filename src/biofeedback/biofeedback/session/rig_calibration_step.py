"""The step that calibrates a rig: the armed and started plate is moved by a program of its own, and
the session is over once the rig file is written.
"""

from __future__ import annotations

from biofeedback.session.calibration_step import CalibrationStep
from biofeedback.session.check_list import CALIBRATE_RIG
from biofeedback.session.protocol import RIG_CALIBRATION


class RigCalibrationStep(CalibrationStep):
    """Leads the calibration of a rig; the end of the session then stops the rig."""

    check, kind = CALIBRATE_RIG, RIG_CALIBRATION
    needs = "the armed rig: confirm that no foot is on the plate, then arm and start"
    goes_on = "the session ends by itself once the rig file is written"
