"""A simulated rig at the other end of the driver's line, with a clock of its own and faults on
request.
"""

from importlib import import_module
from typing import Any

_MODULES = {
    "EmulatedDevice": "emulated_device",
    "EmulatedRig": "emulated_rig",
    "Faults": "faults",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["EmulatedDevice", "EmulatedRig", "Faults"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
