"""The bridge between the graph and a rig's own real-time controller."""

from importlib import import_module
from typing import Any

_MODULES = {
    "Bridge": "safety.bridge",
    "Limits": "safety.limits",
    "RigLink": "link.rig_link",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["Bridge", "Limits", "RigLink"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
