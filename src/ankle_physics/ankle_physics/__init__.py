"""The ankle joint as a list of physics terms, and its simulation. No ROS."""

from importlib import import_module
from typing import Any

_MODULES = {
    "Model": "model",
    "OperatingPoint": "impedance",
    "Term": "term",
    "simulate": "virtual_rig",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["Model", "OperatingPoint", "Term", "simulate"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
