"""A verb takes the rig as known that is named, or else the one that the bags carry."""

import json
from datetime import datetime, timezone

import numpy as np
import pytest
from typer.testing import CliRunner

from ankle_bringup.command_line import app
from ankle_bringup.known_rig import NO_RIG, known_rig
from ankle_interfaces.block import Block
from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from session_recorder.bag_writer import BagWriter
from session_recorder.errors import BagError
from session_recorder.rig_of_bag import RIG_KEY

RATE = 1000.0
DATE = datetime(2026, 11, 20, 14, 2, tzinfo=timezone.utc)
PLATE = 0.004  # kg.m^2
MOVING = 0.010  # kg.m^2, of foot and plate


def rig(title):
    return RigFile(title, DATE, model=Model.of({"footplate_inertia": {"Ip": PLATE}}))


def bag(path, carried=None):
    """Write 30 s of an ankle of 80 N.m/rad on a plate."""
    random = np.random.default_rng(1)
    time = np.arange(round(30 * RATE)) / RATE
    steps = np.repeat(random.uniform(-0.03, 0.03, len(time) // 200 + 1), 200)[: len(time)]
    position = np.convolve(steps, np.hanning(20) / np.hanning(20).sum(), "same")
    velocity = np.gradient(position, 1 / RATE)
    torque = MOVING * np.gradient(velocity, 1 / RATE) + 0.6 * velocity + 80.0 * position
    torque += 0.02 * random.normal(size=len(time))
    data = np.column_stack([time, position, torque])
    with BagWriter(path) as writer:
        writer.add_topic("/ankle/samples")
        if carried is not None:
            writer.custom_data[RIG_KEY] = carried.text()
        columns = ("t[s]", "position[rad]", "torque[N.m]")
        for first in range(0, len(data), 500):
            writer.write_block("/ankle/samples", Block(columns, data[first : first + 500]))
    return path


def test_the_named_rig_counts_before_the_one_that_the_bag_carries(tmp_path):
    carrying = bag(tmp_path / "carrying", rig("of the bag"))
    rig("of the file").save(tmp_path / "rig.yaml")
    found, said = known_rig(None, [carrying])
    assert found.title == "of the bag"
    assert "'of the bag', calibrated 2026-11-20, which the bag carries" in said
    found, said = known_rig(tmp_path / "rig.yaml", [carrying])
    assert (found.title, said) == ("of the file", "")
    assert known_rig(NO_RIG, [carrying]) == (None, "")
    assert known_rig(None, [bag(tmp_path / "bare")]) == (None, "")


def test_bags_that_carry_different_rigs_and_what_is_no_rig_are_refused(tmp_path):
    one = bag(tmp_path / "one", rig("one"))
    other = bag(tmp_path / "other", rig("other"))
    with pytest.raises(BagError, match=r"one: one, .*other: other\); name one with --rig"):
        known_rig(None, [one, other])
    with pytest.raises(BagError, match="bare: none"):
        known_rig(None, [one, bag(tmp_path / "bare")])
    (tmp_path / "no.yaml").write_text("stiffness: 3")
    with pytest.raises(ModelError):
        known_rig(tmp_path / "no.yaml", [one])


def test_an_estimate_takes_off_the_plate_that_the_rig_of_its_bag_states(tmp_path):
    recorded = bag(tmp_path / "recorded", rig("plate B"))

    def inertia(out, *options):
        arguments = ["estimate", recorded, "--out", tmp_path / out, "--json", *options]
        done = CliRunner().invoke(app, [str(one) for one in arguments])
        assert done.exit_code == 0, done.output
        answer = json.loads(done.stdout)
        return answer["median"]["I[kg.m^2]"], " ".join(answer["notes"])

    carried, said = inertia("carried")
    assert carried == pytest.approx(MOVING - PLATE, rel=0.05)
    assert "the rig 'plate B', calibrated 2026-11-20, which the bag carries" in said
    without, said = inertia("without", "--rig", "none")
    assert without == pytest.approx(MOVING, rel=0.05)
    assert "plate B" not in said
