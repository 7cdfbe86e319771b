"""The simulation study of van 't Veld et al. 2018, and the estimators against each other."""

from importlib import import_module
from typing import Any

_MODULES = {
    "Trial": "trial",
    "record": "rigs",
    "run_study": "study",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["Trial", "record", "run_study"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
