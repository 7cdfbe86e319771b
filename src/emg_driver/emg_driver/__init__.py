"""EMG: from the amplifier's stream to background and reflex activity for every stretch."""

from importlib import import_module
from typing import Any

_MODULES = {
    "EmgProcessor": "processor",
    "respond_bag": "offline",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["EmgProcessor", "respond_bag"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
