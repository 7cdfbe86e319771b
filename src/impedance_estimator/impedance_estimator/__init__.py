"""Online separation of intrinsic and reflexive joint impedance."""

from importlib import import_module
from typing import Any

_MODULES = {
    "EstimateStream": "stream",
    "compile_estimator": "stream",
    "estimate_bag": "offline.recorded_estimates",
    "make_estimator": "algorithms",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["EstimateStream", "compile_estimator", "estimate_bag", "make_estimator"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
