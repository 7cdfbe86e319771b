"""The file of a calibrated rig: what is written is read back, what is wrong is named."""

import re
from datetime import datetime, timedelta, timezone
from pathlib import Path

import pytest

from ankle_physics.errors import ModelError
from ankle_physics.model import Model
from ankle_physics.rig_file import Measured, RigFile

WHEN = datetime(2026, 11, 20, 14, 2, 11, tzinfo=timezone.utc)


def rig():
    model = Model.of(
        {
            "footplate_inertia": {"Ip": 0.0042},
            "servo_compliance": {"k_a": 2100.0},
            "torque_sensor_mode": {"frequency": 71.0, "damping": 0.03},
        }
    )
    model.entry("footplate_inertia").standard_errors = {"Ip": 3e-5}
    return RigFile(
        "laboratory 2, plate B",
        WHEN,
        "rig_20261120",
        "ab" * 32,
        Measured(0.00049, 0.00002),
        Measured(0.0, 0.00003),
        0.012,
        -0.31,
        {"position[rad]": 4.5e-5, "velocity[rad/s]": 6.5e-3, "torque[N.m]": 0.14},
        Measured(31.2, 0.1),
        Measured(0.72),
        model,
    )


def test_a_rig_file_reads_back_to_the_same_values(tmp_path):
    rig().save(tmp_path / "rig.yaml")
    read = RigFile.load(tmp_path / "rig.yaml")
    assert read.text() == rig().text()
    assert read.calibrated == WHEN
    assert read.torque_delay == Measured(0.00049, 0.00002)
    entry = read.model.entry("footplate_inertia")
    assert (entry.values["Ip"], entry.standard_errors["Ip"]) == (0.0042, 3e-5)
    assert read.servo is not None
    assert read.servo.bandwidth == 31.2


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("terms: []", "a rig file has"),
        ("rig: a\ncalibrated: yesterday", "no date"),
        ("rig: a\ncalibrated: 2026-11-20\nzeros: {}", "unknown key 'zeros'"),
        ("'torque_delay[s]': 0.5", "torque_delay' = 0.5 s is refused; allowed: -0.02 to 0.02 s"),
        ("'torque_delay[s]': {value: 0.001, standard_error: -1}", "standard error of torque_delay"),
        ("noise: {'torque[Nm]': 1}", "'noise' has no 'torque[Nm]'"),
        ("terms: [{term: stiffness}]", "belongs to the subject"),
        ("terms: [{term: channel_skew}]", "instead of term 'channel_skew'"),
        ("terms: [{term: footplate_inertia, 'Ip[kg.m^2]': 3.0}]", "allowed: 0 to 0.1 kg.m^2"),
        ("bag_sha256: 12", "no SHA-256"),
    ],
)
def test_what_is_wrong_in_a_rig_file_is_named(tmp_path, text, message):
    if not text.startswith(("rig", "terms: []")):
        text = "rig: a\ncalibrated: 2026-11-20T14:00:00Z\n" + text
    (tmp_path / "rig.yaml").write_text(text)
    with pytest.raises(ModelError, match=r"rig\.yaml") as refused:
        RigFile.load(tmp_path / "rig.yaml")
    assert message in str(refused.value)


def test_a_twin_has_the_terms_of_both_and_the_rigs_where_both_state_one():
    subject = Model.of({"stiffness": {"K": 80.0}, "footplate_inertia": {"Ip": 0.02}})
    twin = rig().twin(subject)
    assert twin.entry("footplate_inertia").values["Ip"] == 0.0042
    assert twin.entry("channel_skew").values["skew"] == 0.00049
    assert twin.entry("stiffness").values["K"] == 80.0


def test_the_age_is_in_days():
    assert rig().age(WHEN + timedelta(hours=36)) == pytest.approx(1.5)


def test_the_file_of_the_documentation_is_one():
    page = Path(__file__).parents[3] / "docs" / "calibration.md"
    (text,) = re.findall(r"```yaml\n(rig: .*?)```", page.read_text(), re.DOTALL)
    shown = RigFile.from_text(text)
    named = {entry.term.name for entry in shown.model.entries}
    assert named == {"footplate_inertia", "servo_compliance", "torque_sensor_mode"}
    assert shown.torque_delay == Measured(0.00049, 0.00002)
