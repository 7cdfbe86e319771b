"""Shares the tests between two processes: the live ones one by one in the first, the rest beside them, with less right to the cores."""

import os

import pytest

BESIDE = 10  # niceness: a computation must not make a graph late that runs in real time


def pytest_collection_modifyitems(items):
    """Live tests are one group; any other module is one of its own, so that its fixtures are made once."""
    for item in items:
        item.add_marker(pytest.mark.xdist_group("live" if item.get_closest_marker("live") else str(item.path)))


def pytest_runtest_setup(item):
    """Step back for the live tests; not to be taken back, and not needed again: their group is the largest and so the first."""
    if "PYTEST_XDIST_WORKER" in os.environ and not item.get_closest_marker("live"):
        os.setpriority(os.PRIO_PROCESS, 0, BESIDE)
