"""Calibration measures the rig (``rig.yaml``) and the session (``subject.yaml``) once."""

from importlib import import_module
from typing import Any

_MODULES = {
    "calibrate_rig": "rig_calibration",
    "calibrate_session": "session_calibration",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["calibrate_rig", "calibrate_session"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
