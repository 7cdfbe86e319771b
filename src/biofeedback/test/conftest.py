"""Shared by the tests: their folder on the path, a laboratory without ROS."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def laboratory(tmp_path):
    """A running laboratory with the short protocol."""
    from laboratory import Laboratory, short_protocol

    made = Laboratory(short_protocol(tmp_path))
    yield made
    made.close()
    assert made.failure is None
