"""Hold periods of recorded sessions: impedance estimates against EMG, with confidence intervals,
pictures and a report.
"""

from importlib import import_module
from typing import Any

_MODULES = {
    "RecordedSession": "recorded_session",
    "Study": "study.layout",
    "read_session": "recorded_session",
    "run_study": "study.running",
    "validate": "validation",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["RecordedSession", "Study", "read_session", "run_study", "validate"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
