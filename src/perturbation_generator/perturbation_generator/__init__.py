"""Position perturbations for joint identification, sample by sample, and the node that publishes
them.
"""

from importlib import import_module
from typing import Any

_MODULES = {
    "SIGNALS": "signals",
    "signal_from": "signals",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["SIGNALS", "signal_from"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
