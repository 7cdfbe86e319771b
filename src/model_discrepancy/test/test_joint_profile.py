"""Other joints and axes of machines are diagnosed by their own ranges and units.

The recordings are made by scipy alone: a mass on a spring and a damper behind a servo.
"""

import json
from pathlib import Path

import numpy as np
import pytest
import yaml
from scipy.signal import butter, lfilter

from ankle_interfaces.block import Block
from ankle_interfaces.topics import ANKLE_SAMPLES
from ankle_physics.errors import ModelError
from ankle_physics.joint_profile import ANKLE, JointProfile
from ankle_physics.model import Model
from ankle_physics.term import term_library
from model_discrepancy.diagnose import diagnose
from model_discrepancy.errors import DiagnosisError
from model_discrepancy.problem import prepare
from model_discrepancy.recording.recording import Recording
from model_discrepancy.recording.recording_checks import faults
from session_recorder.bag_writer import BagWriter

RATE = 1000.0
AXIS = """joint: linear axis
units: {position: m, torque: N}
inertia_range: [1.0, 100.0]
largest_range: 0.5
smallest_movement: 1.0e-4
torque_scale: 1000
terms: [inertia, viscosity]
"""
# Inertia, viscosity and stiffness of each.
JOINTS = {"wrist": (0.002, 0.03, 3.0), "knee": (0.35, 4.0, 120.0), "axis": (12.0, 60.0, 0.0)}
FEW = ("torque_sensor_lag", "maxwell_relaxation", "hardening_stiffness", "reflex_threshold")


@pytest.fixture
def axis_file(tmp_path: Path) -> Path:
    (tmp_path / "axis.yaml").write_text(AXIS)
    return tmp_path / "axis.yaml"


def profile(name: str, axis_file: Path) -> JointProfile:
    return JointProfile.load(axis_file if name == "axis" else name)


def recording(name: str, seconds: float = 30.0, seed: int = 1) -> Recording:
    """Random steps of a mass on a spring and a damper, with 1 % of noise in the torque."""
    random = np.random.default_rng(seed)
    steps = np.repeat(random.uniform(-0.02, 0.02, int(seconds / 0.25)), int(0.25 * RATE))
    position = lfilter(*butter(4, 15.0, fs=RATE), steps)
    velocity = np.gradient(position) * RATE
    inertia, viscosity, stiffness = JOINTS[name]
    torque = inertia * np.gradient(velocity) * RATE + viscosity * velocity + stiffness * position
    noise = random.standard_normal((2, len(position)))
    return Recording(
        RATE,
        position + 2e-5 * noise[0],
        torque + 0.01 * np.std(torque) * noise[1],
        name=name,
    )


@pytest.mark.parametrize("name", JOINTS)
def test_a_joint_is_usable_by_its_own_profile_and_not_by_an_ankles(name, axis_file):
    made = recording(name)
    with profile(name, axis_file).in_force():
        assert faults(made) == []
    if name != "wrist":  # 0.002 kg.m^2 is within a factor of four of a child's foot
        assert "another joint by --joint" in faults(made)[0]


@pytest.mark.parametrize("name", [pytest.param("wrist", marks=pytest.mark.slow), "knee", "axis"])
def test_the_base_model_finds_inertia_viscosity_and_stiffness(name, axis_file):
    joint = profile(name, axis_file)
    with joint.in_force():
        base = prepare(recording(name), joint.terms).base
    inertia, viscosity, stiffness = JOINTS[name]
    assert base.values["inertia"]["I"] == pytest.approx(inertia, rel=0.02)
    assert base.values["viscosity"]["B"] == pytest.approx(viscosity, rel=0.1)
    assert base.values.get("stiffness", {"K": 0.0})["K"] == pytest.approx(stiffness, rel=0.05)
    assert not any("inertia" in bound for bound in base.at_bounds)


def test_ranges_and_units_hold_while_a_profile_is_in_force(axis_file):
    ankle = term_library()["stiffness"].parameter("K")
    with JointProfile.load(axis_file).in_force():
        axis = term_library()["stiffness"].parameter("K")
        assert axis.key == "K[N/m]"
        assert axis.upper == 1000 * ankle.upper
        assert term_library()["inertia"].parameter("I").key == "I[kg]"
        assert term_library()["hardening_stiffness"].parameter("k3").unit == "N/m^3"
    with JointProfile.load("wrist").in_force():
        assert term_library()["reflex"].parameter("delay").lower < 0.02
    assert term_library()["stiffness"].parameter("K") == ankle


def test_a_model_file_states_its_joint_and_is_read_without_a_further_option(tmp_path, axis_file):
    with JointProfile.load(axis_file).in_force():
        model = Model.of({"inertia": {"I": 12.0}, "stiffness": {"K": 90000.0}})
    model.save(tmp_path / "model.yaml")
    assert "I[kg]" in (tmp_path / "model.yaml").read_text()
    again = Model.load(tmp_path / "model.yaml")
    assert again.joint == JointProfile.load(axis_file)
    assert again.entry("stiffness").values["K"] == 90000.0
    Model.of({"stiffness": {}}).save(tmp_path / "ankle.yaml")
    assert "joint" not in (tmp_path / "ankle.yaml").read_text()
    assert Model.load(tmp_path / "ankle.yaml").joint == ANKLE


def write_bag(path: Path, made: Recording, columns: tuple[str, str]) -> None:
    with BagWriter(path) as writer:
        writer.add_topic(ANKLE_SAMPLES.absolute)
        data = np.column_stack([made.time, made.position, made.torque])
        for begin in range(0, len(data), 1000):
            writer.write_block(
                ANKLE_SAMPLES.absolute, Block(("t[s]", *columns), data[begin : begin + 1000])
            )


def test_a_bag_in_metres_and_newtons_is_read_by_its_profile_only(tmp_path, axis_file):
    made = recording("axis", 5.0)
    write_bag(tmp_path / "bag", made, ("position[mm]", "force[N]"))
    with JointProfile.load(axis_file).in_force():
        again = Recording.from_bag(tmp_path / "bag")
    np.testing.assert_allclose(again.position, 1e-3 * made.position)
    with pytest.raises(DiagnosisError, match="expected rad"):
        Recording.from_bag(tmp_path / "bag")


@pytest.mark.parametrize(
    ("name", "library"),
    [("wrist", FEW), *(pytest.param(n, None, marks=pytest.mark.slow) for n in JOINTS)],
)
def test_a_joint_without_mismatch_is_diagnosed_and_named_so(name, library, axis_file, tmp_path):
    made, joint = recording(name, 60.0 if library is None else 30.0), profile(name, axis_file)
    found = diagnose(made, tmp_path / "out", library=library, joint=joint)
    assert found.verdict.verdict == "no_mismatch"
    content = json.loads((tmp_path / "out" / "verdict.json").read_text())
    unit = "N/m" if name == "axis" else "N.m/rad"
    assert content["parameters"][f"K[{unit}]"]["augmented"] == pytest.approx(
        JOINTS[name][2], rel=0.05, abs=1e-6
    )
    assert Model.load(tmp_path / "out" / "model.yaml").joint.name.startswith(
        "linear" if name == "axis" else name
    )


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"units": {"position": "m", "torque": "N.m"}}, "do not belong together"),
        ({"inertia_range": [3.0, 1.0]}, "no range above 0"),
        ({"torque_scale": -1}, "torque_scale = -1 is not above 0"),
        ({"speed": 3}, "unknown 'speed'"),
        ({"torque_scale": "much"}, "torque_scale = 'much' cannot be read; allowed: a finite"),
        ({"torque_scale": True}, "torque_scale = True cannot be read; allowed: a finite"),
        ({"largest_range": 0}, "largest_range = 0 rad is not above 0; allowed: a finite number"),
        ({"largst_range": 1}, "unknown 'largst_range'; did you mean 'largest_range'"),
        ({"inertia_range": 5}, "inertia_range = 5 cannot be read; allowed: two finite numbers"),
        ({"inertia_range": "12"}, "inertia_range = '12' cannot be read; allowed: two finite"),
        ({"inertia_range": [1, 2, 3]}, "inertia_range = .1, 2, 3. cannot be read; allowed: two"),
        ({"inertia_range": [3, 1]}, "= 3 to 1 kg.m.2 is no range .* the lower one first"),
        ({"inertia_range": [1, float("inf")]}, "= 1 to inf kg.m.2 is no range above 0"),
        ({"units": "m"}, "units = 'm' is refused; allowed: a table such as"),
        ({"joint": None}, "joint = None is no name; allowed: one line of free text"),
        ({"terms": "inertia"}, "terms = 'inertia' cannot be read; allowed: a list of names"),
        ({"terms": ["inertia", 5]}, "terms = .'inertia', 5. cannot be read; allowed: a list"),
        ({"terms": []}, "names at least one term"),
        ({"terms": ["inertia", "inertia"]}, "names 'inertia' more than once; allowed: once"),
        ({"terms": ["inertia", "viscocity"]}, "names 'viscocity', .* did you mean 'viscosity'"),
        ({"terms": ["inertia", "nosuch"]}, "names 'nosuch', which is no term .*--terms FOLDER"),
    ],
)
def test_a_profile_that_makes_no_sense_is_refused_with_its_file(tmp_path, change, words):
    (tmp_path / "j.yaml").write_text(yaml.safe_dump({"joint": "x", **change}))
    with pytest.raises(ModelError, match=rf"j\.yaml: .*{words}"):
        JointProfile.load(tmp_path / "j.yaml")


def test_an_unknown_joint_is_named_with_those_that_are_known():
    with pytest.raises(ModelError, match="'hip' is neither a file nor one of ankle, knee"):
        JointProfile.load("hip")
