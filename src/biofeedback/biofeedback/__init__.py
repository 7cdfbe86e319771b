"""The subject's 2-D feedback screen and the operator's page, served to any browser."""

from importlib import import_module
from typing import Any

_MODULES = {
    "Course": "session.course",
    "Protocol": "session.protocol",
    "Session": "session.session_program",
    "load_course": "session.course",
    "load_protocol": "session.protocol",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["Course", "Protocol", "Session", "load_course", "load_protocol"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
