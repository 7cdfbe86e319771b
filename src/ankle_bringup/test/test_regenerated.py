"""`ankle up` on graphs that end by themselves, and the estimates made again from a recording."""

import pytest
from rich.console import Console

from ankle_bringup.errors import GraphError, RunError
from ankle_bringup.graph import load_graph
from ankle_bringup.live_monitor import ESTIMATE, REFERENCE, SAMPLES, with_one_more_reader
from ankle_bringup.processes import Processes
from ankle_bringup.recorded_estimator import set_as_recorded
from ankle_bringup.regenerate import agreement
from ankle_bringup.up import ending_node, run_graph
from ankle_physics.model import PAPER_TERMS, Model
from session_analysis.recorded_session import read_session
from session_recorder.bag_reader import BagReader

INPUTS = ("/perturbation/reference", "/ankle/samples", "/emg/samples", "/session/event")


def test_a_node_that_the_graph_lacks_has_not_ended(tmp_path):
    processes = Processes(load_graph("regenerated"), tmp_path)
    assert not processes.ended("perturbation_generator")
    with pytest.raises(RunError, match="no node 'perturbation_generator' runs; running: none"):
        processes.wait_for_end("perturbation_generator", 1.0)


@pytest.mark.parametrize(
    ("graph", "node"),
    [("regenerated", "replay"), ("simulated", "perturbation_generator")],
)
def test_a_graph_ends_with_the_node_that_ends_by_itself(graph, node):
    name, sentence = ending_node(load_graph(graph))
    assert name == node
    assert sentence
    assert ending_node(load_graph(graph).without(node)) == ("", "")


def test_a_replay_without_a_recording_is_refused_before_anything_starts(tmp_path):
    with pytest.raises(GraphError, match=r"--set replay\.bag=BAG"):
        run_graph(load_graph("regenerated"), tmp_path / "logs", 1.0, Console(quiet=True))
    assert not (tmp_path / "logs").exists()


def waits(graph):
    return {node.name: node.parameters.get("wait_for_readers") for node in graph.nodes}


def test_nodes_wait_for_the_table_beside_their_readers():
    graph = load_graph("simulated_calibrated")
    before, after = waits(graph), waits(with_one_more_reader(graph, (ESTIMATE, SAMPLES, REFERENCE)))
    one_more = {"impedance_estimator", "ankle_sim", "perturbation_generator"}
    assert {name for name in before if before[name] != after[name]} == one_more
    assert all(after[name] == before[name] + 1 for name in one_more)
    calibrated = waits(with_one_more_reader(graph, ("calibrated/impedance/estimate",)))
    assert {name for name in before if before[name] != calibrated[name]} == {"calibrated_estimator"}


@pytest.mark.live
@pytest.mark.timeout(240)
def test_a_recording_gives_its_estimates_again_and_can_be_validated(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    subject = tmp_path / "subject.yaml"
    physics = {**{name: {} for name in PAPER_TERMS}, "maxwell_relaxation": {"k": 10.0}}
    Model.of(physics, "subject").save(subject)
    session = [
        "impedance_estimator.settling_time=3.0",
        f"impedance_estimator.model={subject}",
        "ankle_sim.subject=1",
        "ankle_sim.holds=2",
        "ankle_sim.hold_duration=3.0",
        "ankle_sim.reach_duration=1.0",
        "perturbation_generator.duration=12.0",
    ]
    console = Console(record=True, quiet=True)
    run_graph(load_graph("simulated_recorded").with_settings(session), tmp_path, 0.0, console)
    subject.unlink()
    replay = load_graph("regenerated").with_settings(["replay.bag=session"])
    as_recorded, _ = set_as_recorded(replay, tmp_path)
    run_graph(as_recorded, tmp_path, 0.0, console)
    live, again = BagReader("session"), BagReader("regenerated")
    assert again.complete
    for topic in INPUTS:
        assert again.topics[topic].count == live.topics[topic].count > 0
    for topic in ("/emg/responses", "/impedance/provenance", "/impedance/model"):
        assert again.topics[topic].count > 0
    columns, estimates = live.signal("/impedance/estimate")
    found = agreement(columns, estimates, again.signal("/impedance/estimate")[1])
    assert (estimates[:, columns.index("valid[1]")] == 1.0).any()
    assert (found.only_first, found.only_second) == (0, 0)
    assert found.largest <= 1e-9
    first, second = read_session(tmp_path / "session"), read_session(tmp_path / "regenerated")
    assert (second.holds, second.excluded) == (first.holds, first.excluded)
    assert len(second.holds) + len(second.excluded) == 2
    assert second.provenances == first.provenances
    assert "model: 'subject'" in second.provenances[0]
