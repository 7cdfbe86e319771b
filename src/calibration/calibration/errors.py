"""Errors that calibration raises."""


class CalibrationError(RuntimeError):
    """A recording from which a rig or a session cannot be calibrated; says what it lacks."""
