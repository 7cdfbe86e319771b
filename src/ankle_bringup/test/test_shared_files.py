"""What is installed beside the code: parameter file, description of the ankle, layouts of tools,
protocol of the tutorial.
"""

import importlib
import json
import re
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest
import yaml

from ankle_actuator_driver.safety.limits import HARD_LIMIT_PARAMETERS
from ankle_bringup.graph import load_graph
from ankle_bringup.parameter_file import of_every_node
from ankle_interfaces.topics import TOPICS
from ankle_node.derived_topics import FRAME, JOINT
from biofeedback.session.protocol import HOLD, load_protocol
from session_analysis.correlation import LEAST_PAIRS
from session_analysis.holds import SHORTEST_HOLD

SHARED = Path(__file__).parents[1]
OF_ROS = {"/rosout": "rcl_interfaces/msg/Log", "/robot_description": "std_msgs/msg/String"}
KNOWN = {topic.absolute: topic.message for topic in TOPICS} | OF_ROS


def fields(message):
    package, _, name = message.split("/")
    kind = getattr(importlib.import_module(f"{package}.msg"), name)
    return set(kind.get_fields_and_field_types())


def test_the_parameter_file_holds_every_default():
    path = SHARED / "params" / "laboratory.yaml"
    again = "ankle parameter-file --overwrite --out src/ankle_bringup/params/laboratory.yaml"
    assert path.read_text() == of_every_node(), f"write it anew: {again}"
    content = yaml.safe_load(path.read_text())
    assert content["perturbation_generator"]["ros__parameters"]["amplitude"] == 0.04
    assert content["ankle_sim"]["ros__parameters"]["K"] > 0
    assert max(map(len, path.read_text().splitlines())) <= 120


def test_a_graph_takes_the_whole_parameter_file():
    graph = load_graph("simulated").with_parameter_file(SHARED / "params" / "laboratory.yaml")
    assert {node.name: len(node.parameters) > 3 for node in graph.nodes} == {
        node.name: True for node in graph.nodes
    }


def test_the_description_has_the_joint_of_joint_states():
    robot = ET.parse(SHARED / "description" / "ankle.urdf").getroot()
    (joint,) = [joint for joint in robot.iter("joint") if joint.get("type") == "revolute"]
    assert joint.get("name") == JOINT
    assert joint.find("parent").get("link") == FRAME
    # Turned about -y the toes, in front, go up: dorsiflexion is positive.
    assert joint.find("axis").get("xyz") == "0 -1 0"
    most = {parameter.name: parameter.upper for parameter in HARD_LIMIT_PARAMETERS}
    limit = joint.find("limit")
    assert float(limit.get("upper")) == -float(limit.get("lower")) == most["hard_angle_limit"]
    assert float(limit.get("velocity")) == most["hard_velocity_limit"]
    assert float(limit.get("effort")) == most["hard_torque_limit"]
    links = {link.get("name") for link in robot.findall("link")}
    assert links == {"shank", "foot", "plate"}


def foxglove():
    layout = json.loads((SHARED / "layouts" / "session_foxglove.json").read_text())
    panels = layout["configById"]
    placed = set(re.findall(r'"(\w+![a-z]+)"', json.dumps(layout["layout"])))
    assert placed == set(panels)
    for panel in panels.values():
        yield from (path["value"] for path in panel.get("paths", ()))
        yield from (panel[key] for key in ("topicPath", "topicToRender") if key in panel)
        yield from (layer["topic"] for layer in panel.get("layers", {}).values())


def plotjuggler():
    root = ET.parse(SHARED / "layouts" / "session_plotjuggler.xml").getroot()
    subscribed = {topic.get("value") for topic in root.iter("selected_topics")}
    for curve in root.iter("curve"):
        topic, _, field = curve.get("name").rpartition("/")
        assert topic in subscribed
        yield f"{topic}.{field}"
    yield from subscribed


@pytest.mark.parametrize("layout", [foxglove, plotjuggler])
def test_a_layout_shows_topics_and_fields_that_exist(layout):
    shown = list(layout())
    assert {"/impedance/K.data", "/impedance/G.data", "/ankle/torque.data"} <= set(shown)
    for path in shown:
        topic, _, field = path.partition(".")
        assert topic in KNOWN, path
        assert not field or field in fields(KNOWN[topic]), path


def test_the_session_of_the_tutorial_has_enough_holds_to_be_validated():
    (path,) = (SHARED / "ankle_bringup" / "protocols").glob("*.yaml")
    protocol = load_protocol(str(path))
    holds = [step for step in protocol.steps if step.kind == HOLD]
    assert {step.torque_target for step in holds} == {0.0}
    assert len(holds) >= LEAST_PAIRS + 2
    assert min(step.duration for step in holds) > SHORTEST_HOLD
    assert protocol.duration < 11 * 60.0
    tutorial = SHARED.parents[1] / "docs" / "tutorials" / "session.md"
    assert f"biofeedback.protocol={path.relative_to(SHARED.parents[1])}" in tutorial.read_text()
