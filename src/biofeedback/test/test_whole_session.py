"""A visit in a real Chromium, every node of the laboratory a process: from the check list to the
report, with a recorder that is killed in the middle.
"""

import os
import re
import signal
from dataclasses import replace
from datetime import datetime, timezone
from importlib import resources

import pytest
from test_pages import hold_keys

from ankle_bringup.browser_pages import free_port, wait_until_served
from ankle_bringup.graph import load_graph
from ankle_bringup.processes import Processes
from ankle_physics.model import Model
from session_analysis.report import write_report
from session_analysis.validation import validate
from session_analysis.visit_measures import measured_in_visit
from session_recorder.bag_reader import BagReader
from session_recorder.loss import account_of_bag
from session_recorder.message_definitions import typestore

pytestmark = pytest.mark.live

PATIENCE = 240_000  # ms
CHECKS = "check_list: [rig_calibration, zero, mvc_plantarflexion, mvc_dorsiflexion, warm_up]\n"
RIG = """
rig: simulated
calibrated: {today}T00:00:00Z
terms:
  - term: footplate_inertia
    Ip[kg.m^2]: 0.004
"""


def visit_protocol(folder):
    source = resources.files("biofeedback") / "config" / "demonstration.yaml"
    path = folder / "visit.yaml"
    path.write_text(source.read_text() + CHECKS)
    return path


def hold_until(operator, state, *keys):
    """Hold keys until the session is in a state: a busy computer may miss a hold, and an operator
    then holds them again.
    """
    shown = operator.locator("#state", has_text=state)
    for _ in range(10):
        hold_keys(operator, *keys, seconds=3.0)
        for _ in range(20):
            if shown.count():
                return
            operator.wait_for_timeout(500)
    shown.wait_for()


def do_check_list(operator):
    """Carry out the check list: what a file answers is done; the subject pushes, lifts, relaxes."""
    # The estimator compiles at its first start, for three minutes on a busy computer, and the
    # simulated rig waits for it; until then nothing can be measured.
    operator.wait_for_timeout(2000)
    operator.locator("#share").filter(has_not_text="no samples").wait_for(state="attached")
    done = operator.locator("#checks li", has_text="Rig calibration").locator("b", has_text="✓")
    done.wait_for()
    push = operator.locator('input[name="push"]')
    for title, value in (("Zero", "0"), ("Maximal push", "12"), ("Maximal lift", "-5")):
        entry = operator.locator("#checks li", has_text=title)
        push.fill(value)
        operator.wait_for_timeout(4000)
        # A subject drifts by 0.5 N.m: what fails is measured again, as an operator does it.
        for _ in range(6):
            entry.locator("button").first.click()
            operator.wait_for_timeout(1000)
            if entry.locator("b", has_text="○").count():
                continue  # refused: no samples at that moment
            entry.locator("b", has_text=re.compile("[✓✕]")).wait_for()
            if entry.locator("b", has_text="✓").count():
                break
        entry.locator("b", has_text="✓").wait_for()
    push.fill("0")
    operator.locator("#checks li", has_text="Warm-up").locator("button", has_text="Confirm").click()
    operator.locator("#check-list").wait_for(state="hidden")


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_visit_from_check_list_to_report_with_a_recorder_killed(browser, tmp_path):
    rig = tmp_path / "rig.yaml"
    rig.write_text(RIG.format(today=f"{datetime.now(timezone.utc):%Y-%m-%d}"))
    port, first, second = free_port(), tmp_path / "first", tmp_path / "second"
    graph = load_graph("simulated_session").with_settings(
        [
            f"record.out={first}",
            f"biofeedback.port={port}",
            # The least that a screen may have, and the view without traces: every process of a
            # laboratory and two pages are on one computer here.
            "biofeedback.frame_rate=10",
            f"biofeedback.state_file={tmp_path / 'progress.json'}",
            f"biofeedback.protocol={visit_protocol(tmp_path)}",
            f"biofeedback.rig_file={rig}",
            "ankle_sim.at_rest=true",
            "biofeedback.subject=S07",
            "biofeedback.visit=3",
        ]
    )
    again = replace(
        graph,
        nodes=tuple(
            replace(node, parameters={"out": str(second)})
            for node in graph.nodes
            if node.executable == "record"
        ),
    )
    with Processes(graph, tmp_path / "logs") as processes:
        wait_until_served(port, processes)
        subject = browser.new_page(viewport={"width": 640, "height": 400})
        operator = browser.new_page(viewport={"width": 1280, "height": 720})
        operator.set_default_timeout(PATIENCE)
        subject.goto(f"http://127.0.0.1:{port}/")
        operator.goto(f"http://127.0.0.1:{port}/operator")
        operator.locator("#title", has_text="S07, visit 3").wait_for()
        operator.locator("#recording", has_text="● recording").wait_for()
        operator.locator("#simulated-subject").wait_for(state="visible")
        operator.locator("#simple").click()
        operator.locator("#claim").click()
        do_check_list(operator)
        operator.locator('button[data-command="arm"]:enabled').wait_for()
        hold_until(operator, "armed", "Enter", "a")
        hold_until(operator, "running", "Enter", "s")
        operator.locator('input[name="excitability"]').fill("0.8")
        # In the hold itself: on the way to it, the next recorder could still be there in time.
        operator.locator("#step", has_text=re.compile("^Hold 1$")).wait_for()
        os.kill(processes.pids["record"], signal.SIGKILL)
        operator.locator("#recording", has_text="NOT RECORDING").wait_for()
        with Processes(again, tmp_path / "logs again") as recorder:
            operator.locator("#recording", has_text="● recording").wait_for()
            operator.locator("#step", has_text="hold 2").wait_for()
            operator.locator('input[name="push"]').fill("5")
            operator.locator("#state", has_text="finished").wait_for()
            subject.close()
            operator.close()
            codes = processes.stop()
            assert {name: code for name, code in codes.items() if code} == {
                "record": -signal.SIGKILL
            }
            assert set(recorder.stop().values()) == {0}
    # What was measured before the first block is in the recording that was cut off.
    largest = measured_in_visit(first)
    assert largest["mvc_plantarflexion[N.m]"] == pytest.approx(12.0, rel=0.2)
    assert largest["mvc_dorsiflexion[N.m]"] == pytest.approx(5.0, rel=0.3)
    assert "killed recorder" in " ".join(account_of_bag(BagReader(first)).sentences())
    # The hold in which it was killed is lost and reported; the other one is whole.
    found = validate([first, second], ["S07", "S07"])
    assert [(measure.hold.number, measure.hold.target) for measure in found.measures] == [(2, -5.0)]
    assert any("hold 1" in sentence for sentence in map(str, found.excluded)), found.excluded
    (tmp_path / "report").mkdir()
    text = write_report(found, tmp_path / "report", "a visit").read_text()
    assert "killed recorder" in text


CALIBRATED = 'check_list: [session_calibration]\n"calibration[s]": 40\n'


@pytest.mark.slow
@pytest.mark.timeout(900)
def test_a_session_is_calibrated_before_its_baseline(browser, tmp_path):
    """The running estimator goes on with what the program found, and the recording says so."""
    port, bag, model = free_port(), tmp_path / "bag", tmp_path / "S07.yaml"
    protocol = tmp_path / "calibrated.yaml"
    source = resources.files("biofeedback") / "config" / "demonstration.yaml"
    protocol.write_text(source.read_text() + CALIBRATED)
    graph = load_graph("simulated_session").with_settings(
        [
            f"record.out={bag}",
            f"biofeedback.port={port}",
            "biofeedback.frame_rate=10",
            f"biofeedback.state_file={tmp_path / 'progress.json'}",
            f"biofeedback.protocol={protocol}",
            f"biofeedback.subject_file={model}",
            "ankle_sim.at_rest=true",
            "perturbation_generator.wait_for_readers=3",  # simulated ankle, estimator and recorder
            # A reader keeps 64 blocks: 4 s of such blocks, which a process on a busy computer may
            # stand still without a lost sample.
            "perturbation_generator.block_size=128",
        ]
    )
    # Nobody reads the EMG's responses here: the computer's cores are left to the others.
    nodes = tuple(node for node in graph.nodes if node.executable != "emg_processor")
    with Processes(replace(graph, nodes=nodes), tmp_path / "logs") as processes:
        wait_until_served(port, processes)
        operator = browser.new_page(viewport={"width": 1280, "height": 720})
        operator.set_default_timeout(PATIENCE)
        operator.goto(f"http://127.0.0.1:{port}/operator")
        operator.locator("#recording", has_text="● recording").wait_for()
        operator.locator("#share").filter(has_not_text="no samples").wait_for(state="attached")
        operator.locator("#simple").click()
        operator.locator("#claim").click()
        operator.locator('button[data-command="arm"]:enabled').wait_for()
        hold_until(operator, "armed", "Enter", "a")
        hold_until(operator, "running", "Enter", "s")
        entry = operator.locator("#checks li", has_text="Session calibration")
        entry.locator("p", has_text="of 40 s; the subject relaxes").wait_for()
        # A busy computer loses samples: what fails is repeated, as an operator does it.
        baseline = operator.locator("#step", has_text="Baseline")
        for _ in range(4):
            entry.locator("p", has_text="✕").or_(baseline).first.wait_for()
            if baseline.count():
                break
            entry.locator("button", has_text="Calibrate again").click()
            entry.locator("p", has_text="…").wait_for()
        baseline.wait_for()
        operator.locator("#log", has_text="goes on with this model").wait_for()
        operator.wait_for_timeout(1000)  # the baseline itself begins with the new model
        operator.close()
        assert set(processes.stop().values()) == {0}
    assert {"inertia", "stiffness"} <= {entry.term.name for entry in Model.load(model).entries}
    provenance, event = "/impedance/provenance", "/session/event"
    stated: list[tuple[str, str]] = [
        (topic, typestore().deserialize_cdr(raw, "std_msgs/msg/String").data)
        for topic, _, raw in BagReader(bag).messages([provenance, event])
    ]
    models = [text for topic, text in stated if topic == provenance]
    assert "model: null" in models[0]
    assert Model.load(model).sha256 in models[-1]
    begun = [text for topic, text in stated if topic == provenance or "baseline started" in text]
    assert "baseline started" in begun[-1], begun  # nothing changes the estimator after it
