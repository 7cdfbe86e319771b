"""Graph descriptions: what is in the package, settings, and every mistake by name."""

import os
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest

from ankle_bringup.errors import GraphError, RunError
from ankle_bringup.executables import node_command
from ankle_bringup.graph import Graph, NodeDescription, known_graphs, load_graph
from ankle_bringup.processes import Processes
from ankle_bringup.recording_place import in_study, what_follows, with_free_place
from session_analysis.errors import AnalysisError
from session_analysis.study.layout import init_study

pytestmark = [pytest.mark.live, pytest.mark.untimed]


@pytest.mark.parametrize("name", known_graphs())
def test_every_graph_names_executables_that_exist(name):
    graph = load_graph(name)
    assert graph.description
    for node in graph.nodes:
        assert node_command(node.package, node.executable)[1] == "-c"


def test_settings_reach_the_command_line():
    graph = load_graph("simulated").with_settings(
        ["ankle_sim.K=80.0", "perturbation_generator.signal=prbs"]
    )
    arguments = {node.name: node.ros_arguments() for node in graph.nodes}
    assert "K:=80.0" in arguments["ankle_sim"]
    assert "signal:=prbs" in arguments["perturbation_generator"]


def test_an_option_adds_its_nodes_and_a_graph_without_it_says_so():
    rig = load_graph("rig")
    names = {node.name for node in rig.with_options([]).nodes}
    assert names == {
        "biofeedback",
        "impedance_estimator",
        "ankle_actuator_driver",
        "perturbation_generator",
        "record",
    }
    assert {node.name for node in rig.with_options(["emulator"]).nodes} - names == {"rig_emulator"}
    with pytest.raises(GraphError, match="no option 'emulator'"):
        load_graph("simulated").with_options(["emulator"])


@pytest.mark.parametrize("setting", ["ankle_sim", "ankle_sim.K", "K=3", "nobody.K=3"])
def test_bad_settings_are_refused(setting):
    with pytest.raises(GraphError, match=setting.split(".")[0]):
        load_graph("simulated").with_settings([setting])


def test_a_value_that_a_node_would_refuse_is_refused_before_it_starts():
    with pytest.raises(
        GraphError, match=r"ankle_sim: parameter 'K' = 99999999 N\.m/rad is refused"
    ):
        load_graph("simulated").with_settings(["ankle_sim.K=99999999"])
    with pytest.raises(GraphError, match="'language' = 'xx' is refused; allowed: one of en, nl"):
        load_graph("rig").with_settings(["biofeedback.language=xx"])
    load_graph("simulated").with_settings(["perturbation_generator.amplitude=1e-2"])


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("nodes: [{package: x}]", "each node has 'package' and 'executable'"),
        ("nodes: [{package: x, executable: y, speed: 3}]", "unknown key 'speed'"),
        ("nodes: [{package: x, executable: y}, {package: z, executable: y}]", "appears twice"),
        ("nodes: [", "not YAML"),
        ("hello", "list 'nodes'"),
    ],
)
def test_bad_graph_files_are_named(tmp_path, text, words):
    path = tmp_path / "graph.yaml"
    path.write_text(text)
    with pytest.raises(GraphError, match=words):
        load_graph(str(path))


def test_unknown_graph_names_the_known_ones():
    with pytest.raises(GraphError, match="simulated"):
        load_graph("nothing")


def test_a_failing_node_is_reported_with_its_last_line(tmp_path):
    node = NodeDescription("ankle_sim", "ankle_sim", "ankle_sim", {"K": -5.0})
    with (
        Processes(Graph("", (node,)), tmp_path) as processes,
        pytest.raises(RunError, match=r"'K' = -5\.0 N\.m/rad is refused"),
    ):
        processes.wait_for_end("ankle_sim", 60.0)


def test_a_namespace_is_on_every_command_line():
    graph = load_graph("simulated").in_namespace("left/")
    assert graph.namespace == "/left"
    assert all("__ns:=/left" in node.ros_arguments() for node in graph.nodes)
    assert {node.full_name for node in graph.nodes} >= {"/left/ankle_sim"}
    assert load_graph("simulated").in_namespace("/") == load_graph("simulated")
    with pytest.raises(GraphError, match="namespace '2nd laboratory' is refused; allowed: letters"):
        graph.in_namespace("2nd laboratory")


def test_a_parameter_file_lies_between_the_graph_and_its_settings(tmp_path):
    path = tmp_path / "mine.yaml"
    path.write_text(
        "/**: {ros__parameters: {use_sim_time: false}}\n"
        "ankle_sim: {ros__parameters: {K: 90.0, seed: 7, voluntary_torque: {level: -2.0}}}\n"
        "/right/ankle_sim: {ros__parameters: {K: 60.0}}\n"
    )
    left = load_graph("simulated").in_namespace("left").with_parameter_file(path)
    right = load_graph("simulated").in_namespace("right").with_parameter_file(path)
    sims = [
        next(node.parameters for node in graph.nodes if node.name == "ankle_sim")
        for graph in (left.with_settings(["ankle_sim.seed=8"]), right)
    ]
    assert [(sim["K"], sim["seed"], sim["voluntary_torque.level"]) for sim in sims] == [
        (90.0, 8, -2.0),
        (60.0, 7, -2.0),
    ]
    assert all(node.parameters["use_sim_time"] is False for node in left.nodes)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("ankle_sim: {ros__parameters: {sed: 3}}", "did you mean 'seed'"),
        ("ankle_sim: {seed: 3}", "'ankle_sim' has no 'ros__parameters'"),
        ("[1, 2]", "a parameter file has NODE"),
        ("{", "not YAML"),
    ],
)
def test_bad_parameter_files_are_named(tmp_path, text, words):
    path = tmp_path / "mine.yaml"
    path.write_text(text)
    with pytest.raises(GraphError, match=words):
        load_graph("simulated").with_parameter_file(path)


def test_whoever_may_be_in_the_rig_is_recorded():
    for name in ("rig", "simulated_session"):
        graph = load_graph(name)
        assert any(node.package == "session_recorder" for node in graph.nodes)


def test_a_second_session_makes_a_second_recording(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    graph = load_graph("simulated_session")
    assert with_free_place(graph, []) == (graph, "")
    (tmp_path / "session").mkdir()
    second, sentence = with_free_place(graph, [])
    assert "recording into session_2" in sentence
    assert second.nodes[0].parameters["out"] == "session_2"
    (tmp_path / "session_2").mkdir()
    assert "session_3" in with_free_place(graph, [])[1]
    assert with_free_place(graph, ["record.out=session"]) == (graph, "")


def test_a_visit_of_a_study_names_and_places_its_recording(tmp_path):
    study = init_study(tmp_path / "study")
    stated = {"side": "left", "body_mass[kg]": 71}
    graph, place = in_study(load_graph("rig"), study.folder, "S07", 3, stated)
    assert place.name == "sub-S07_ses-03_run-01_bag"
    (recorder,) = (node for node in graph.nodes if node.package == "session_recorder")
    assert recorder.parameters["out"] == str(place)
    assert '"side": "left"' in place.with_name("sub-S07_ses-03_run-01.json").read_text()
    (screens,) = (node for node in graph.nodes if node.package == "biofeedback")
    shown = {key: screens.parameters[key] for key in ("subject", "visit", "body_mass")}
    assert shown == {"subject": "S07", "visit": 3, "body_mass": 71.0}
    model = Path(screens.parameters["subject_file"])
    assert model == place.with_name("sub-S07_ses-03_subject.yaml")
    _, second = in_study(load_graph("rig"), study.folder, "S07", 3)
    assert second.name == "sub-S07_ses-03_run-02_bag"
    with pytest.raises(AnalysisError, match="pseudonym"):
        in_study(load_graph("rig"), study.folder, "anna", 1)
    with pytest.raises(GraphError, match="no recorder"):
        in_study(load_graph("simulated"), study.folder, "S07", 1)


def test_the_course_of_a_subject_is_kept_in_the_study_and_its_trend_is_offered(tmp_path):
    course = load_graph("simulated_conditioning")
    records = []
    for name in ("one", "other"):
        study = init_study(tmp_path / name)
        graph, _ = in_study(course, study.folder, "S07", 3)
        (screens,) = (node for node in graph.nodes if node.package == "biofeedback")
        records.append(Path(screens.parameters["course_record"]))
        assert records[-1] == study.folder / "sub-S07" / "sub-S07_course-demonstration.yaml"
        sentences = " ".join(what_follows(graph, study.folder))
        assert f"ankle study run {study.folder}" in sentences
        assert f"ankle course demonstration --record {records[-1]}" in sentences
    assert records[0] != records[1]
    chosen = course.with_settings(["biofeedback.course_record=mine.yaml"])
    graph, _ = in_study(chosen, study.folder, "S07", 4)
    (screens,) = (node for node in graph.nodes if node.package == "biofeedback")
    assert screens.parameters["course_record"] == "mine.yaml"
    without, _ = in_study(load_graph("rig"), study.folder, "S07", 5)
    assert "ankle course" not in " ".join(what_follows(without, study.folder))


def test_a_port_in_use_is_named_with_the_process_that_holds_it(tmp_path):
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as held:
        held.bind(("127.0.0.1", 0))
        port = held.getsockname()[1]
        node = NodeDescription("rig_emulator", "rig_emulator", "rig_emulator", {"port": port})
        words = f"rig_emulator cannot listen; port {port} is held by process {os.getpid()} "
        with pytest.raises(RunError, match=words), Processes(Graph("", (node,)), tmp_path):
            pass


PARENT = """
import subprocess, sys, time
from ankle_node.parent_process import end_with_parent
child = subprocess.Popen(["sleep", "300"], start_new_session=True, preexec_fn=end_with_parent)
print(child.pid, flush=True)
time.sleep(300)
"""


def test_nodes_end_with_a_parent_that_is_killed():
    parent = subprocess.Popen([sys.executable, "-c", PARENT], stdout=subprocess.PIPE, text=True)
    child = Path(f"/proc/{int(parent.stdout.readline())}/cmdline")
    assert "sleep" in child.read_text()
    parent.kill()
    parent.wait()
    deadline = time.monotonic() + 10.0
    while child.exists() and child.read_text():
        assert time.monotonic() < deadline
        time.sleep(0.02)
