"""Record, replay, import and export of bags."""

from importlib import import_module
from typing import Any

_MODULES = {
    "BagReader": "bag_reader",
    "BagWriter": "bag_writer",
    "import_recording": "importing",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["BagReader", "BagWriter", "import_recording"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
