"""Shares the tests between processes: the live ones one by one in the first, which mostly waits for
the clock; the rest beside them in the others, with less right to the cores.
"""

import os
from collections import Counter
from functools import cache
from pathlib import Path

from xdist.scheduler import LoadScopeScheduling

from ankle_node.domain import take_free_domain

BESIDE = 19  # niceness: a computation must not make a graph late that runs in real time

if "PYTEST_XDIST_WORKER" in os.environ:
    # Before NumPy is loaded: matrix products in two threads wait for each other where the other
    # process has the second core.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_configure(config):
    """Whatever runs beside on this computer, its topics are in another ROS domain."""
    take_free_domain()


@cache
def is_live(path):
    return "pytest.mark.live" in Path(path).read_text()


class LiveTogether(LoadScopeScheduling):
    """Hands out modules whole, so that their fixtures are made once; all live ones are one."""

    def _split_scope(self, nodeid):
        path = nodeid.split("::")[0]
        return "live" if is_live(path) else path


def pytest_xdist_make_scheduler(config, log):
    return LiveTogether(config, log)


def pytest_runtest_setup(item):
    """Step back for the live tests; not to be taken back, and not needed again: their group is the
    largest and so the first.
    """
    if "PYTEST_XDIST_WORKER" in os.environ and not item.get_closest_marker("live"):
        os.setpriority(os.PRIO_PROCESS, 0, BESIDE)


def pytest_terminal_summary(terminalreporter):
    """Say at the end what was not tested, and why."""
    reasons = Counter()
    for report in terminalreporter.stats.get("skipped", []):
        where = report.nodeid.partition("::")[0]
        told = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        reasons[where, str(told).removeprefix("Skipped: ")] += 1
    for (where, reason), number in sorted(reasons.items()):
        terminalreporter.write_line(f"NOT TESTED: {number} of {where}: {reason}")
