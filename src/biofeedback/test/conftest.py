"""Shared by the tests: their folder on the path, a laboratory without ROS, a calibrated session."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))
pytest.register_assert_rewrite("page_client")


@pytest.fixture
def laboratory(tmp_path, request):
    """A running laboratory with the short protocol; a test may ask for holds of other lengths."""
    from laboratory import Laboratory, short_protocol

    made = Laboratory(short_protocol(tmp_path, hold=getattr(request, "param", 2)))
    yield made
    made.close()
    assert made.failure is None


@pytest.fixture
def visit(tmp_path):
    """A session with the step of calibration, in virtual time."""
    from calibrated_session import CalibratedSession

    return CalibratedSession(tmp_path)
