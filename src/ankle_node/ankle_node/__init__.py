"""What every node shares: declared parameters, blocks in and out, diagnostics, start and stop."""

from importlib import import_module
from typing import Any

_MODULES = {
    "AnkleNode": "node",
    "run": "node",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["AnkleNode", "run"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
