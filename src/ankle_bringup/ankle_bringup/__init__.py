"""Launch files, configurations and the ankle command that runs all of it."""

from importlib import import_module
from typing import Any

_MODULES = {
    "Graph": "graph",
    "Processes": "processes",
    "load_graph": "graph",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["Graph", "Processes", "load_graph"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
