"""The program that calibrates a session in the background, and the file that it writes."""

import json
import sys
import time
from pathlib import Path

import pytest
from laboratory import until

from biofeedback.errors import CommandError
from biofeedback.session.calibration_files import subject_file_of
from biofeedback.session.calibration_program import CalibrationProgram

PROGRAM = """
import json, pathlib, sys, time
words = sys.argv[1:]
out = pathlib.Path(words[words.index("--out") + 1])
pathlib.Path(str(out) + ".words").write_text(json.dumps(words))
{act}
"""


def program(folder, act):
    path = folder / "program.py"
    path.write_text(PROGRAM.format(act=act))
    return CalibrationProgram(folder / "S07.yaml", "rig.yaml", "/left", (sys.executable, str(path)))


def end_of(calibration):
    found = []
    until(lambda: found.append(calibration.ended()) or found[-1] is not None, "ended")
    return found[-1]


def test_the_programs_result_is_read(tmp_path):
    printed = json.dumps({"effects": [{"name": "tissue_friction"}]})
    # It records once it is told to, and ends so, too: its begin is not to be missed.
    told, ended = tmp_path / "record", tmp_path / "end"
    act = (
        f"while not pathlib.Path({str(told)!r}).exists(): time.sleep(0.01)\n"
        'pathlib.Path(words[words.index("--bag") + 1]).mkdir()\n'
        f"while not pathlib.Path({str(ended)!r}).exists(): time.sleep(0.01)\n"
        f"print({printed!r})"
    )
    calibration = program(tmp_path, act)
    calibration.begin(90.0)
    assert calibration.recording
    assert "starting to record" in calibration.progress()
    told.touch()
    until(lambda: "recording, 0 of 90 s" in calibration.progress(), "recording")
    assert calibration.recording
    with pytest.raises(CommandError, match="already"):
        calibration.begin(90.0)
    ended.touch()
    end = end_of(calibration)
    assert end.problem == ""
    assert end.figures == {"found": "tissue friction"}
    assert not calibration.running
    words = json.loads((tmp_path / "S07.yaml.words").read_text())
    assert words[:2] == ["calibrate", "session"]
    for option, value in {"--seconds": "90", "--rig": "rig.yaml", "--namespace": "left"}.items():
        assert words[words.index(option) + 1] == value


def test_the_programs_last_words_say_why_it_failed(tmp_path):
    calibration = program(tmp_path, "sys.exit('error: no rig is running')")
    calibration.begin(90.0)
    end = end_of(calibration)
    assert end.problem.startswith("error: no rig is running (all of it: ")


def test_a_program_that_is_cancelled_ends(tmp_path):
    calibration = program(tmp_path, "time.sleep(60)")
    calibration.begin(90.0)
    calibration.cancel("interrupted")
    assert not calibration.recording
    assert end_of(calibration).problem == "interrupted"
    calibration.begin(90.0)
    began = time.monotonic()
    calibration.close()
    assert time.monotonic() - began < 10.0
    assert not calibration.running


def test_the_options_are_those_of_the_command():
    from typer.testing import CliRunner

    from ankle_bringup.command_line import app

    words = ["calibrate", "session", "--help"]
    shown = CliRunner().invoke(app, words, env={"TERMINAL_WIDTH": "200"})
    for option in (
        "--no-hand-over",
        "--seconds",
        "--out",
        "--bag",
        "--report",
        "--rig",
        "--namespace",
        "--json",
    ):
        assert option in shown.output


def test_every_visit_has_a_subject_file_of_its_own():
    folder = Path("state")
    assert subject_file_of("own.yaml", "S07", 3, folder, 0.0) == Path("own.yaml")
    assert subject_file_of("", "S07", 3, folder, 0.0) == folder / "subject_S07_visit_3.yaml"
    # Nobody is named: the model of one start is never taken for that of another.
    first, second = (subject_file_of("", "", 0, folder, now) for now in (100.0, 200.0))
    assert first != second
