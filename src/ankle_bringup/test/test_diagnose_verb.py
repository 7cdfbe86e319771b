"""`ankle diagnose` of a recording that cannot be used."""

import json

import numpy as np
import pytest
from typer.testing import CliRunner

from ankle_bringup.command_line import app
from ankle_bringup.errors import RunError
from ankle_interfaces.block import Block
from model_discrepancy.errors import DiagnosisError
from session_recorder.bag_writer import BagWriter


def test_a_recording_that_cannot_be_used_gets_its_report_and_fails(tmp_path):
    time = np.arange(5000) / 1000.0
    data = np.column_stack([time, 0.03 * np.sin(9.0 * time), 2.0 * np.sin(9.0 * time)])
    with BagWriter(tmp_path / "short") as writer:
        writer.add_topic("/ankle/samples")
        writer.write_block("/ankle/samples", Block(("t[s]", "position[rad]", "torque[N.m]"), data))
    out = tmp_path / "out"
    done = CliRunner().invoke(app, ["diagnose", str(tmp_path / "short"), "--out", str(out)])
    assert done.exit_code != 0
    with pytest.raises(DiagnosisError, match=r"short cannot be used: .* 5\.0 s"):
        raise done.exception
    assert json.loads((out / "verdict.json").read_text())["verdict"] == "bad_recording"
    assert (out / "report.html").exists()


def test_the_time_of_a_diagnosis_is_that_for_one_recording(tmp_path):
    done = CliRunner().invoke(app, ["diagnose", "a", "b", "--at-most", "2", "--out", str(tmp_path)])
    with pytest.raises(RunError, match="--at-most is the time for one recording"):
        raise done.exception
    done = CliRunner().invoke(app, ["diagnose", "a", "--at-most", "0.1"])
    assert done.exit_code == 2
    assert "0.5 to 120 min" in done.output
