"""Physics that a joint model leaves out is located, named, modelled and shown to be missing.

No ROS.
"""

import os
from importlib import import_module
from typing import Any

# The matrices are tall and narrow: several BLAS threads wait for each other (3 to 15 times slower
# on a busy machine). It takes effect where this package is imported before numpy, as its commands
# do.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

_MODULES = {
    "Diagnosis": "diagnose",
    "Recording": "recording.recording",
    "prepare": "problem",
}
"""Module of each exported name; it is imported when the name is first used."""

__all__ = ["Diagnosis", "Recording", "prepare"]


def __getattr__(name: str) -> Any:
    """Give an exported name."""
    if name not in _MODULES:
        raise AttributeError(f"package '{__name__}' has no '{name}'; it exports {__all__}")
    return getattr(import_module(f"{__name__}.{_MODULES[name]}"), name)
