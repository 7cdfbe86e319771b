"""An estimate is made with the subject's model that is named, or else with that of its bag."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from ankle_bringup.command_line import app
from ankle_bringup.known_model import NO_MODEL, known_model
from ankle_interfaces.block import Block
from ankle_interfaces.topics import IMPEDANCE_MODEL, IMPEDANCE_PROVENANCE
from ankle_physics.errors import ModelError
from ankle_physics.model import PAPER_TERMS, Model
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.provenance import model_text, provenance
from impedance_estimator.stream import EstimateStream
from session_recorder.bag_writer import BagWriter
from session_recorder.message_definitions import typestore

RATE = 1000.0
MONDAY = Model.of({**{name: {} for name in PAPER_TERMS}, "maxwell_relaxation": {"k": 25.0}}, "M")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory):
    """Write 30 s of an ankle, estimated with the model of that Monday."""
    path = tmp_path_factory.mktemp("recorded") / "bag"
    random = np.random.default_rng(1)
    time = np.arange(round(30 * RATE)) / RATE
    steps = np.repeat(random.uniform(-0.03, 0.03, len(time) // 200 + 1), 200)[: len(time)]
    position = np.convolve(steps, np.hanning(20) / np.hanning(20).sum(), "same")
    velocity = np.gradient(position, 1 / RATE)
    torque = 0.01 * np.gradient(velocity, 1 / RATE) + 0.6 * velocity + 80.0 * position
    data = np.column_stack([time, position, torque + 0.02 * random.normal(size=len(time))])
    stream = EstimateStream("simultaneous", None, KnownPhysics(None, MONDAY))
    store = typestore()
    with BagWriter(path) as writer:
        writer.add_topic("/ankle/samples")
        for topic, text in (
            (IMPEDANCE_PROVENANCE, provenance(stream)),
            (IMPEDANCE_MODEL, model_text(stream)),
        ):
            writer.add_topic(topic.absolute)
            message = store.serialize_cdr(store.types[topic.message](data=text), topic.message)
            writer.write(topic.absolute, 0, bytes(message))
        columns = ("t[s]", "position[rad]", "torque[N.m]")
        for first in range(0, len(data), 500):
            writer.write_block("/ankle/samples", Block(columns, data[first : first + 500]))
    return path


def test_the_model_of_the_recorded_estimates_is_taken_unless_another_one_is_named(
    recorded, tmp_path
):
    file = tmp_path / "monday.yaml"
    MONDAY.save(file)

    def stiffness(out, *options):
        arguments = ["estimate", recorded, "--out", tmp_path / out, "--json", *options]
        done = CliRunner().invoke(app, [str(one) for one in arguments])
        assert done.exit_code == 0, done.output
        answer = json.loads(done.stdout)
        return answer["median"]["K[N.m/rad]"], " ".join(answer["notes"])

    carried, said = stiffness("carried")
    assert "the model 'M' (SHA-256" in said
    assert "--model none leaves it out" in said
    named, said = stiffness("named", "--model", file)
    assert named == carried
    assert "in force" not in said
    without, said = stiffness("without", "--model", "none")
    assert abs(without - carried) > 5.0
    assert "in force" not in said


def test_what_is_no_model_is_refused(recorded, tmp_path):
    (tmp_path / "no.yaml").write_text("stiffness: 3")
    with pytest.raises(ModelError):
        known_model(tmp_path / "no.yaml", recorded)
    assert known_model(NO_MODEL, recorded) == (None, "")
