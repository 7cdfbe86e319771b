"""A session of a conditioning course in the running graph: every node a process."""

import asyncio
from importlib import resources

import numpy as np
import pytest

from ankle_bringup.browser_pages import free_port, wait_until_served
from ankle_bringup.graph import load_graph
from ankle_bringup.processes import Processes
from ankle_node.session_event import parse
from biofeedback.session.course import CONDITIONED, load_course
from biofeedback.session.course_record import SessionResult, load_record, new_record
from biofeedback.session.scripted_course import ScriptedCourse
from session_recorder.bag_reader import BagReader
from session_recorder.message_definitions import typestore

pytestmark = pytest.mark.live
UNIT = 0.3e-7  # V.s; the simulated subject's reflexes are 0.5e-7 to 3e-7


def events_of(bag):
    store = typestore()
    return [
        parse(store.deserialize_cdr(message, "std_msgs/msg/String").data)
        for _, _, message in bag.messages(["/session/event"])
    ]


def course_in_its_second_session(folder):
    """The demonstration, with one check, and a record that has ten control trials of session 2."""
    source = resources.files("biofeedback") / "config" / "courses" / "demonstration.yaml"
    path = folder / "course.yaml"
    path.write_text(
        source.read_text().replace("[zero, mvc_plantarflexion]", "[mvc_plantarflexion]")
    )
    record = new_record(load_course(str(path)), "S01")
    record.results = [SessionResult(1, "2026-11-20", 10, 10, 3 * UNIT, np.nan, np.nan)]
    record.unfinished = [k * UNIT for k in range(1, 11)]
    record.save(folder / "S01.yaml")
    return path


@pytest.mark.timeout(300)
def test_trials_are_gated_rewarded_and_recorded(tmp_path):
    """The ten conditioned trials of a session whose control trials were done before."""
    port, record = free_port(), tmp_path / "S01.yaml"
    course = course_in_its_second_session(tmp_path)
    graph = load_graph("simulated_conditioning").with_settings(
        [
            f"record.out={tmp_path / 'bag'}",
            f"biofeedback.port={port}",
            f"biofeedback.state_file={tmp_path / 'progress.json'}",
            f"biofeedback.course_record={record}",
            f"biofeedback.course={course}",
        ]
    )
    script = ScriptedCourse(f"http://127.0.0.1:{port}", lambda sentence: None, seed=4)
    with Processes(graph, tmp_path / "logs") as processes:
        wait_until_served(port, processes)
        state = asyncio.run(script.run(200.0))
        assert set(processes.stop().values()) == {0}
    assert state["trials"]["success_rate"] is not None
    bag = BagReader(tmp_path / "bag")
    events = events_of(bag)
    trials = [event.details for event in events if event.event == "trial"]
    assert [trial["trial"] for trial in trials] == list(range(11, 21))
    assert {trial["kind"] for trial in trials} == {CONDITIONED}
    # The criterion is the quantile of the control trials; a success lies below it.
    plan = load_course(str(course))
    criterion = np.quantile(UNIT * np.arange(1, 11), plan.success_rate)
    for trial in trials:
        assert trial["criterion[V.s]"] == pytest.approx(criterion, rel=1e-4)
        assert trial["success"] is bool(trial["reflex_emg[V.s]"] <= criterion)
    result = load_record(record).results[-1]
    assert (result.number, result.trials) == (2, 20)
    assert result.success_rate == pytest.approx(sum(trial["success"] for trial in trials) / 10)
    # Each trial was one stretch, at which the torque had been in its window long enough.
    given = len(trials) + sum(event.event == "trial not counted" for event in events)
    columns, reference = bag.signal("/perturbation/reference")
    rises = np.diff((reference[:, columns.index("position[rad]")] > 1e-3).astype(int)) == 1
    assert rises.sum() == given
    onsets = reference[1:, 0][rises]
    assert np.diff(onsets).min() >= plan.trial_interval
