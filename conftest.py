"""Shares the tests between processes. The live ones run one by one in the first, which mostly waits
for the clock; live ones in which nothing is due at a time (``untimed``) one by one in the second;
the rest beside them in the others, with less right to the cores.
"""

import ast
import json
import os
from collections import Counter
from functools import cache
from pathlib import Path

import pytest
from hypothesis import settings
from xdist.scheduler import LoadScopeScheduling

from ankle_node.domain import RANGE_VARIABLE, take_free_domain

BESIDE = 19  # niceness: a computation must not make a graph late that runs in real time
ROOT = Path(__file__).parent
FAILED = ROOT / "build" / "failed_tests.json"
MOST_REPEATED = 5  # failed live tests; more of them are no accident of a busy computer

if "PYTEST_XDIST_WORKER" in os.environ:
    # Before NumPy is loaded: matrix products in two threads wait for each other where the other
    # process has the second core.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")


def pytest_addoption(parser):
    parser.addoption(
        "--failed-live",
        action="store_true",
        help="repeat, one by one, the live tests that failed in the last run beside others; an "
        "error where any other test failed",
    )


def pytest_configure(config):
    """Whatever runs beside on this computer or its network, its topics are in another ROS domain,
    and no drawn case fails for the time that it took.
    """
    if "PYTEST_XDIST_WORKER" not in os.environ and not config.getoption("--failed-live"):
        FAILED.unlink(missing_ok=True)
    take_free_domain()
    os.environ[RANGE_VARIABLE] = "LOCALHOST"
    settings.register_profile("untimed", deadline=None)
    settings.load_profile("untimed")


def group_of(marks):
    """Return the group of live tests that marks belong to, or nothing."""
    live = "pytest.mark.live" in marks
    return "untimed" if live and "pytest.mark.untimed" in marks else "live" if live else ""


@cache
def groups(path):
    """Return the group of a module's tests, and those of the tests that have marks of their own."""
    text = Path(path).read_text()
    if "pytest.mark.live" not in text:
        return "", {}
    body = ast.parse(text).body
    whole = "".join(
        ast.unparse(one.value)
        for one in body
        if isinstance(one, ast.Assign) and ast.unparse(one.targets[0]) == "pytestmark"
    )
    tests = [one for one in body if isinstance(one, ast.FunctionDef)]
    marks = {one.name: "".join(map(ast.unparse, one.decorator_list)) for one in tests}
    return group_of(whole), {name: group_of(whole + own) for name, own in marks.items()}


def group(path, name):
    """Return the group of live tests that a test belongs to, or nothing."""
    whole, own = groups(path)
    return own.get(name.partition("[")[0], whole)


class LiveTogether(LoadScopeScheduling):
    """Hands out modules whole, so that their fixtures are made once; a live group is one."""

    def _split_scope(self, nodeid):
        path, _, name = nodeid.partition("::")
        return group(ROOT / path, name) or path


def pytest_xdist_make_scheduler(config, log):
    config.option.loadscopereorder = False  # the order of the collection below
    return LiveTogether(config, log)


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config, items):
    """Put the groups of live tests first: they take longest, and nothing shortens their waiting."""
    if config.getoption("--failed-live"):
        items[:] = failed_live(items)
    items.sort(key=lambda item: ("live", "untimed", "").index(group(item.path, item.name)))


def failed_live(items):
    """Return the live tests that failed beside others; end the run where something else failed."""
    failed = json.loads(FAILED.read_text()) if FAILED.exists() else []
    chosen = [item for item in items if item.nodeid in failed and item.get_closest_marker("live")]
    if not failed or len(chosen) < len(failed) or len(chosen) > MOST_REPEATED:
        pytest.exit(f"{len(failed)} failed, of which {len(chosen)} live: none is repeated", 1)
    for item in chosen:
        print(f"\nREPEATED ALONE, because it failed beside other tests: {item.nodeid}")
    return chosen


def pytest_runtest_setup(item):
    """Step back for the live tests; not to be taken back, and not needed again: their groups are
    the first.
    """
    if "PYTEST_XDIST_WORKER" in os.environ and not item.get_closest_marker("live"):
        os.setpriority(os.PRIO_PROCESS, 0, BESIDE)


@pytest.fixture(scope="module")
def browser():
    """A real Chromium, the system's; Playwright holds this thread's event loop as long as it is
    open.
    """
    # Here, as a package whose tests only compute needs no browser.
    from biofeedback.web.system_browser import ARGUMENTS, NO_BROWSER, find_browser

    playwright = pytest.importorskip("playwright.sync_api", reason="playwright is not installed")
    path = find_browser()
    if path is None:
        pytest.skip(NO_BROWSER)
    with playwright.sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=path, args=list(ARGUMENTS))
        yield found
        found.close()


def pytest_terminal_summary(terminalreporter):
    """Keep what failed, for `failed_live`, and say what was not tested, and why."""
    stats = terminalreporter.stats
    failed = {report.nodeid for kind in ("failed", "error") for report in stats.get(kind, [])}
    if FAILED.parent.is_dir():
        FAILED.write_text(json.dumps(sorted(failed)))
    reasons = Counter()
    for report in terminalreporter.stats.get("skipped", []):
        where = report.nodeid.partition("::")[0]
        reason = report.longrepr[2] if isinstance(report.longrepr, tuple) else report.longrepr
        reasons[where, str(reason).removeprefix("Skipped: ")] += 1
    for (where, reason), number in sorted(reasons.items()):
        terminalreporter.write_line(f"NOT TESTED: {number} of {where}: {reason}")
