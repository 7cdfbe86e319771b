"""Shared by the tests: their folder on the path, a browser, a laboratory without ROS."""

import sys
from pathlib import Path

import pytest

from biofeedback.web.system_browser import ARGUMENTS, MISSING, find_browser

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture(scope="module")
def browser():
    """A real Chromium, the system's; Playwright holds this thread's event loop as long as it is
    open.
    """
    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = find_browser()
    if path is None:
        pytest.skip(MISSING)
    with playwright.sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        yield found
        found.close()


@pytest.fixture
def laboratory(tmp_path):
    """A running laboratory with the short protocol."""
    from laboratory import Laboratory, short_protocol

    made = Laboratory(short_protocol(tmp_path))
    yield made
    made.close()
    assert made.failure is None
