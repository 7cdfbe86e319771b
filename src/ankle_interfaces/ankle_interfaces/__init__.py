"""Blocks of samples: the message format of every sampled signal, its units, gaps and resampling."""

from importlib import import_module
from typing import Any

_MODULES = {
    "Block": "block",
    "Quantity": "quantity",
    "Topic": "topics",
    "pack": "block",
    "unpack": "block",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["Block", "Quantity", "Topic", "pack", "unpack"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
