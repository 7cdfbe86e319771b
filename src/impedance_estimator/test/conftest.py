"""The independent reference simulation as a fixture: test modules are imported by path and cannot
import each other.
"""

import importlib.util
import sys
from functools import lru_cache
from pathlib import Path

import pytest


def _load():
    path = Path(__file__).parent / "reference_ankle.py"
    spec = importlib.util.spec_from_file_location("impedance_estimator_reference_ankle", path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


REFERENCE = _load()


@lru_cache(maxsize=4)
def _short(seed):
    return REFERENCE.simulate(60.0, seed=seed)


@pytest.fixture(scope="session")
def simulate():
    """`reference_ankle.simulate`."""
    return REFERENCE.simulate


@pytest.fixture(scope="session")
def minute():
    """60 s of the paper's CE condition."""
    return _short(7)
