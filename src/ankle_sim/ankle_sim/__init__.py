"""A virtual rig and subject behind the topics of the real one."""

from importlib import import_module
from typing import Any

_MODULES = {
    "LiveRig": "live_rig",
    "State": "virtual_subject",
    "VirtualSubject": "virtual_subject",
    "draw_subject": "virtual_subject",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["LiveRig", "State", "VirtualSubject", "draw_subject"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
