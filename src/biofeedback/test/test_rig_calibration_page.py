"""The calibration of a rig in a real Chromium, every node of the laboratory a process."""

import re
from datetime import datetime, timezone

import pytest
from test_whole_session import PATIENCE, hold_until

from ankle_bringup.browser_pages import free_port, wait_until_served
from ankle_bringup.graph import Graph, NodeDescription
from ankle_bringup.processes import Processes
from ankle_physics.model import Model
from ankle_physics.rig_file import Measured, RigFile

pytestmark = pytest.mark.live


@pytest.mark.slow
@pytest.mark.timeout(600)
def test_the_page_leads_through_the_calibration_of_a_rig(browser, tmp_path):
    hidden, found = tmp_path / "hidden.yaml", tmp_path / "rig.yaml"
    RigFile(
        "hidden",
        datetime(2026, 1, 1, tzinfo=timezone.utc),
        torque_delay=Measured(0.0012),
        noise={"position[rad]": 4.5e-5, "velocity[rad/s]": 6.5e-3, "torque[N.m]": 0.14},
        model=Model.of({"footplate_inertia": {"Ip": 0.0061}}),
    ).save(hidden)
    port = free_port()
    pages = {
        "protocol": "rig_calibration",
        "port": port,
        "rig_file": str(found),
        "state_file": str(tmp_path / "progress.json"),
        "frame_rate": 10.0,
    }
    plate = {"foot": False, "rig": str(hidden), "at_rest": True}
    movements = {
        "signal": "rig_calibration",
        "rig_calibration.on_request": True,
        "wait_for_readers": 1,
    }
    graph = Graph(
        "a simulated rig with its plate empty",
        tuple(
            NodeDescription(name, name, name, parameters)
            for name, parameters in (
                ("biofeedback", pages),
                ("ankle_sim", plate),
                ("perturbation_generator", movements),
            )
        ),
    )
    with Processes(graph, tmp_path / "logs") as processes:
        wait_until_served(port, processes)
        page = browser.new_page()
        page.set_default_timeout(PATIENCE)
        page.goto(f"http://127.0.0.1:{port}/operator")
        page.locator("#claim").click()
        entry = page.locator("#checks li", has_text="Rig calibration")
        page.locator("#checks li", has_text="No foot").locator("button", has_text="Confirm").click()
        hold_until(page, "armed", "Enter", "a")
        hold_until(page, "running", "Enter", "s")
        entry.locator("p", has_text="the plate moves").wait_for()
        assert not found.exists()
        entry.locator("b", has_text="✓").wait_for()
        shown = re.search(r"inertia of the plate: ([0-9.]+)", entry.inner_text())
        assert float(shown.group(1)) == pytest.approx(0.0061, rel=0.02)
        page.locator("#state", has_text="finished").wait_for()
    rig = RigFile.load(found)
    assert rig.torque_delay.value == pytest.approx(0.0012, abs=1e-4)
    assert rig.model.entry("footplate_inertia").values["Ip"] == pytest.approx(0.0061, rel=0.02)
