"""Driver and emulated controller in virtual time: two clocks, a line that can fail, no sockets and
no waiting.
"""

import importlib.util
import sys
from pathlib import Path

import pytest

pytest.register_assert_rewrite("held_against_limits")

NAME = "ankle_actuator_driver_virtual_laboratory"
path = Path(__file__).parent / "virtual_laboratory.py"
if NAME not in sys.modules:
    spec = importlib.util.spec_from_file_location(NAME, path)
    sys.modules[NAME] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(sys.modules[NAME])


@pytest.fixture
def laboratory():
    """`VirtualLaboratory`."""
    return sys.modules[NAME].VirtualLaboratory
