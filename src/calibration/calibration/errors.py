"""Errors that calibration raises."""

from ankle_interfaces.errors import UserError


class CalibrationError(UserError, RuntimeError):
    """Reports what a recording lacks from which a rig or a session cannot be calibrated."""
