"""`ankle investigate`, `compare` and `design-experiment` take joints and terms of one's own."""

from datetime import datetime, timezone
from types import SimpleNamespace

import pytest
from typer.testing import CliRunner

from ankle_bringup.command_line import app
from ankle_physics import own_terms
from ankle_physics.joint_profile import JointProfile, joint_in_force
from ankle_physics.model import Model
from ankle_physics.rig_file import RigFile
from model_discrepancy.report import comparison_report, investigation_report
from model_discrepancy.tools import experiment_design, investigation

AXIS = """joint: linear axis
units: {position: m, torque: N}
inertia_range: [1.0, 100.0]
terms: [inertia, viscosity]
"""


class ReachedError(Exception):
    """The work of the verb was about to begin."""


def ankle(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


@pytest.fixture
def axis(tmp_path):
    (tmp_path / "axis.yaml").write_text(AXIS)
    return tmp_path / "axis.yaml"


@pytest.fixture
def in_force(monkeypatch):
    """What the verbs' work would find in force, which ends there."""
    found = []

    def stop(*_, **__):
        found.append(joint_in_force().name)
        raise ReachedError

    monkeypatch.setattr(comparison_report, "compare_bags", stop)
    monkeypatch.setattr(investigation, "investigate", stop)
    monkeypatch.setattr(experiment_design, "design_experiment", stop)
    return found


@pytest.fixture
def loaded(monkeypatch):
    """Folders of terms that were read."""
    folders = []
    monkeypatch.setattr(own_terms, "load_terms", lambda folder: folders.append(str(folder)))
    return folders


INVESTIGATE = ("investigate", "bag", "--rig", "none")


@pytest.mark.parametrize("verb", [("compare", "bag", "bag"), INVESTIGATE])
def test_the_joint_is_in_force_while_bags_are_read(verb, axis, in_force, tmp_path):
    ended = ankle(*verb, "--joint", axis, "--out", tmp_path / "out")
    assert isinstance(ended.exception, ReachedError)
    assert in_force == ["linear axis"]


@pytest.mark.parametrize(
    "verb", [("compare", "bag", "bag"), INVESTIGATE, ("design-experiment", ".")]
)
def test_terms_of_ones_own_are_read_first(verb, in_force, loaded, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "verdict.json").write_text("{}")
    assert isinstance(ankle(*verb, "--terms", "mine").exception, ReachedError)
    assert loaded == ["mine"]


def test_an_investigation_reports_in_the_units_of_its_joint(axis, tmp_path, monkeypatch):
    values = {"K[N.m/rad]": {"base": 2.0, "augmented": 3.0, "standard_error": 0.1}}
    first = SimpleNamespace(
        verdict=SimpleNamespace(verdict="no_mismatch", effects=[], parameters=values)
    )

    def investigate(bag, conduct, out, rounds, progress, rig):
        assert rig is None
        out.mkdir()
        story = investigation.Investigation(first, [])
        story.save(out)
        return story

    monkeypatch.setattr(investigation, "investigate", investigate)
    done = ankle(*INVESTIGATE, "--joint", axis, "--out", tmp_path / "out", "--json")
    assert done.exit_code == 0, done.output
    assert '"K[N/m]"' in done.output
    assert "first/model.yaml" in done.output
    assert investigation_report.with_unit("K[N/m]") in (tmp_path / "out/report.html").read_text()


def test_an_investigation_takes_the_rig_of_a_file_as_known(tmp_path, monkeypatch):
    now = datetime(2026, 11, 20, tzinfo=timezone.utc)
    RigFile("laboratory 2", now, model=Model.of({})).save(tmp_path / "rig.yaml")
    taken = []

    def investigate(*_, rig, **__):
        taken.append(rig.title)
        raise ReachedError

    monkeypatch.setattr(investigation, "investigate", investigate)
    ankle("investigate", "bag", "--rig", tmp_path / "rig.yaml", "--out", tmp_path / "out")
    assert taken == ["laboratory 2"]


def test_a_simulated_model_in_other_units_than_the_joint_is_refused(axis, tmp_path):
    with JointProfile.load(axis).in_force():
        Model.of({"inertia": {}, "viscosity": {}}).save(tmp_path / "model.yaml")
    model = tmp_path / "model.yaml"
    refused = ankle("investigate", "bag", "--simulate", model, "--out", tmp_path / "out")
    assert "in m and N, and the joint 'ankle' in rad and N.m" in str(refused.exception)
    assert not (tmp_path / "out").exists()
