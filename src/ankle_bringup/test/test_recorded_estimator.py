"""A replay's estimator has the settings and the rig of the recorded run, unless others are set."""

import hashlib
from datetime import datetime, timezone

import pytest
import yaml

from ankle_bringup.graph import load_graph
from ankle_bringup.recorded_estimator import MODEL_FILE, RIG_FILE, set_as_recorded
from ankle_interfaces.topics import IMPEDANCE_MODEL, IMPEDANCE_PROVENANCE
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from impedance_estimator.provenance import provenance
from impedance_estimator.stream import EstimateStream
from session_recorder.bag_writer import BagWriter
from session_recorder.message_definitions import typestore
from session_recorder.rig_of_bag import RIG_KEY

STRING = "std_msgs/msg/String"
RIG = RigFile(
    "laboratory 2",
    datetime(2026, 11, 20, tzinfo=timezone.utc),
    model=Model.of({"footplate_inertia": {"Ip": 0.005}}),
)


def stated(**changes):
    text = provenance(EstimateStream("CE", None))
    return yaml.safe_dump({**yaml.safe_load(text), **changes}, default_flow_style=True).strip()


def bag(path, *origins, rig="", models=()):
    store = typestore()
    with BagWriter(path) as writer:
        for topic, texts in ((IMPEDANCE_PROVENANCE, origins), (IMPEDANCE_MODEL, models)):
            writer.add_topic(topic.absolute)
            for k, text in enumerate(texts):
                message = store.serialize_cdr(store.types[STRING](data=text), STRING)
                writer.write(topic.absolute, round((1.7 + k) * 1e9), bytes(message))
        if rig:
            writer.custom_data[RIG_KEY] = rig
    return path


def replayed(path, tmp_path, *settings):
    graph = load_graph("regenerated").with_settings([f"replay.bag={path}", *settings])
    graph, said = set_as_recorded(graph, tmp_path / "logs")
    return {node.name: node.parameters for node in graph.nodes}, " ".join(said)


def test_algorithm_settings_and_rig_are_those_of_the_recording(tmp_path):
    sha = hashlib.sha256(RIG.text().encode()).hexdigest()
    settings = yaml.safe_load(stated())["settings"] | {"settling_time": 4.0}
    origin = stated(settings=settings, rig={"title": RIG.title, "sha256": sha})
    nodes, said = replayed(bag(tmp_path / "bag", origin, rig=RIG.text()), tmp_path)
    estimator = nodes["impedance_estimator"]
    assert (estimator["algorithm"], estimator["settling_time"]) == ("CE", 4.0)
    assert estimator["wait_for_readers"] == 1
    kept = tmp_path / "logs" / RIG_FILE
    assert estimator["rig"] == nodes["record"]["rig"] == str(kept)
    assert RigFile.load(kept).text() == RIG.text()
    assert said == "the estimator is set as in the recorded run (CE)"


def test_what_is_set_stays(tmp_path):
    path = bag(tmp_path / "bag", stated())
    nodes, _ = replayed(path, tmp_path, "impedance_estimator.settling_time=7.0")
    assert nodes["impedance_estimator"]["settling_time"] == 7.0
    nodes, said = replayed(path, tmp_path, "impedance_estimator.algorithm=simultaneous")
    assert "estimate_rate" not in nodes["impedance_estimator"]
    assert not said


def test_the_model_is_the_last_one_of_the_recording(tmp_path):
    first, last = (Model.of({"maxwell_relaxation": {"k": k}}, "Monday") for k in (20.0, 30.0))
    origins = [stated(model={"title": m.title, "sha256": m.sha256}) for m in (first, last)]
    path = bag(tmp_path / "bag", *origins, models=["", first.text(), last.text()])
    nodes, said = replayed(path, tmp_path)
    kept = tmp_path / "logs" / MODEL_FILE
    assert nodes["impedance_estimator"]["model"] == str(kept)
    assert Model.load(kept).sha256 == last.sha256
    assert "model" not in said
    nodes, _ = replayed(path, tmp_path, "impedance_estimator.model=mine.yaml")
    assert nodes["impedance_estimator"]["model"] == "mine.yaml"


def test_a_model_with_terms_of_ones_own_is_not_called_missing(tmp_path):
    origin = stated(model={"title": "Monday", "sha256": "12"})
    text = (
        Model.of({"maxwell_relaxation": {}}, "Monday")
        .text()
        .replace("maxwell_relaxation", "my_term")
    )
    _, said = replayed(bag(tmp_path / "bag", origin, models=[text]), tmp_path)
    assert "has terms that are not known here" in said
    assert "my_term" in said


def test_what_the_bag_does_not_hold_is_said(tmp_path):
    one = stated()
    other = stated(
        model={"title": "Monday", "sha256": "1234567890123456"},
        rig={"title": "plate", "sha256": "0"},
    )
    _, said = replayed(bag(tmp_path / "bag", one, other, rig=RIG.text()), tmp_path)
    assert "its model 'Monday' (SHA-256 123456789012…) is neither in the bag nor beside it" in said
    assert "--set impedance_estimator.model=FILE" in said
    assert "its rig 'plate' is not in the bag" in said
    assert "it has what it had in the end" in said
    assert not (tmp_path / "logs").exists()


@pytest.mark.parametrize("graph", ["simulated", "regenerated"])
def test_a_graph_without_a_recording_of_estimates_stays_as_it_is(graph, tmp_path):
    path = bag(tmp_path / "bag")
    chosen = load_graph(graph)
    if graph == "regenerated":
        chosen = chosen.with_settings([f"replay.bag={path}"])
    assert set_as_recorded(chosen, tmp_path) == (chosen, [])
