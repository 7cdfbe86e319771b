"""A session in a real Chromium, every node of the laboratory a process: from arm to report."""

import time

import pytest
from test_pages import hold_keys

from ankle_bringup.browser_pages import free_port, wait_until_served
from ankle_bringup.graph import load_graph
from ankle_bringup.processes import Processes
from session_analysis.recorded_session import read_session
from session_analysis.report import write_report
from session_analysis.validation import validate

pytestmark = pytest.mark.live

PATIENCE = 240_000  # ms


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_from_arm_to_report(browser, tmp_path, monkeypatch):
    monkeypatch.setenv("ROS_AUTOMATIC_DISCOVERY_RANGE", "LOCALHOST")
    port = free_port()
    graph = load_graph("simulated_session").with_settings(
        [
            f"record.out={tmp_path / 'bag'}",
            f"biofeedback.port={port}",
            f"biofeedback.state_file={tmp_path / 'progress.json'}",
            "biofeedback.session.protocol=demonstration",
        ]
    )
    with Processes(graph, tmp_path / "logs") as processes:
        wait_until_served(port, processes)
        subject = browser.new_page(viewport={"width": 1280, "height": 720})
        operator = browser.new_page(viewport={"width": 1600, "height": 950})
        operator.set_default_timeout(PATIENCE)
        subject.goto(f"http://127.0.0.1:{port}/")
        operator.goto(f"http://127.0.0.1:{port}/operator")
        operator.locator("#recording", has_text="● recording").wait_for()
        operator.locator("#simulated-subject").wait_for(state="visible")
        operator.locator("#claim").click()
        operator.locator('button[data-command="arm"]:enabled').wait_for()
        hold_keys(operator, "Enter", "a")
        operator.locator("#state", has_text="armed").wait_for()
        hold_keys(operator, "Enter", "s")
        operator.locator("#step", has_text="hold 1").wait_for()
        # The subject goes where the screen asks: more reflex, then a push of 5 N.m.
        operator.locator('input[name="excitability"]').fill("0.8")
        operator.locator("#step", has_text="Hold 1").wait_for()
        quality = []
        deadline = time.monotonic() + 40.0
        while time.monotonic() < deadline:
            quality.append(subject.evaluate("document.getElementById('screen').dataset.quality"))
            time.sleep(0.5)
        operator.locator("#step", has_text="hold 2").wait_for()
        operator.locator('input[name="push"]').fill("5")
        operator.locator("#state", has_text="finished").wait_for()
        subject.close()
        operator.close()
        assert set(processes.stop().values()) == {0}
    assert quality.count("valid") > 0.8 * len(quality)
    session = read_session(tmp_path / "bag")
    assert [(hold.number, hold.target) for hold in session.holds] == [(1, 0.0), (2, -5.0)]
    found = validate([tmp_path / "bag"], ["simulated subject"])
    assert len(found.measures) == 2, found.excluded
    low, high = found.measures[0], found.measures[1]
    assert high.background[0] > 2.0 * low.background[0]  # the soleus pushes
    (tmp_path / "report").mkdir()
    report = write_report(found, tmp_path / "report", "a session")
    assert "hold" in report.read_text()
