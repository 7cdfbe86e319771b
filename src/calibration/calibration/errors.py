"""Errors that calibration raises."""


class CalibrationError(RuntimeError):
    """Reports what a recording lacks from which a rig or a session cannot be calibrated."""
