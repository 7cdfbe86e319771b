"""The programs that calibrate a session or a rig in the background, and what they write."""

import json
import sys
import time
from pathlib import Path

import pytest
from laboratory import until

from biofeedback.errors import CommandError
from biofeedback.session.calibration_choice import calibration_of
from biofeedback.session.calibration_files import subject_file_of
from biofeedback.session.protocol import RigMovement, load_protocol
from biofeedback.session.rig_calibration_program import RigCalibrationProgram
from biofeedback.session.session_calibration_program import SessionCalibrationProgram

PROGRAM = """
import json, pathlib, sys, time
words = sys.argv[1:]
out = pathlib.Path(words[words.index("--out") + 1])
pathlib.Path(str(out) + ".words").write_text(json.dumps(words))
{act}
"""


def written(folder, act):
    path = folder / "program.py"
    path.write_text(PROGRAM.format(act=act))
    return sys.executable, str(path)


def program(folder, act, at_most=None):
    called = written(folder, act)
    return SessionCalibrationProgram(folder / "S07.yaml", "rig.yaml", "/left", called, at_most)


def rig_program(folder, act, spring=0.0):
    movement = RigMovement(0.03, spring, "laboratory 2")
    return RigCalibrationProgram(folder / "rig.yaml", movement, "left", written(folder, act))


def end_of(calibration):
    found = []
    until(lambda: found.append(calibration.ended()) or found[-1] is not None, "ended")
    return found[-1]


def test_the_programs_result_is_read(tmp_path):
    printed = json.dumps({"effects": [{"name": "tissue_friction"}], "warnings": ["I is 0"]})
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
    assert end.figures == {"found": "tissue friction", "warning": "I is 0"}
    assert not calibration.running
    words = json.loads((tmp_path / "S07.yaml.words").read_text())
    assert words[:2] == ["calibrate", "session"]
    given = {"--seconds": "90", "--rig": str(Path("rig.yaml").resolve()), "--namespace": "left"}
    for option, value in given.items():
        assert words[words.index(option) + 1] == value


@pytest.mark.parametrize(("at_most", "given"), [(None, None), (5.0, "5")])
def test_the_diagnosis_ends_in_the_time_that_the_protocol_states(tmp_path, at_most, given):
    calibration = program(tmp_path, "print('{}')", at_most)
    calibration.begin(90.0)
    end_of(calibration)
    words = json.loads((tmp_path / "S07.yaml.words").read_text())
    assert ("--at-most" in words) == (given is not None)
    assert given is None or words[words.index("--at-most") + 1] == given


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


CALIBRATED_RIG = (
    'out.write_text("new")\n'
    'print(json.dumps({"found": {"servo": "31 Hz"}, "remarks": ["mount a spring"]}))'
)


def test_a_rig_file_is_replaced_by_a_calibration_that_went_well_and_kept_beside_it(tmp_path):
    rig = tmp_path / "rig.yaml"
    rig.write_text("old")
    failed = rig_program(tmp_path, "out.write_text('half'); sys.exit('error: a foot is on it')")
    failed.begin(132.0)
    assert "a foot is on it" in end_of(failed).problem
    assert rig.read_text() == "old"
    calibration = rig_program(tmp_path, CALIBRATED_RIG)
    calibration.begin(132.0)
    assert calibration.recording
    assert "keep away" in calibration.progress()
    end = end_of(calibration)
    assert end.problem == ""
    assert end.figures == {"servo": "31 Hz", "note": "mount a spring", "file": str(rig)}
    assert rig.read_text() == "new"
    (before,) = tmp_path.glob("rig_calibration_*/before.yaml")
    assert before.read_text() == "old"
    words = json.loads((before.parent / "rig.yaml.words").read_text())
    assert words[:2] == ["calibrate", "rig"]
    given = {"--amplitude": "0.03", "--title": "laboratory 2", "--namespace": "left"}
    for option, value in given.items():
        assert words[words.index(option) + 1] == value
    assert "--spring" not in words


def test_a_spring_completes_the_rig_file_that_is_there(tmp_path):
    calibration = rig_program(tmp_path, CALIBRATED_RIG, spring=110.0)
    with pytest.raises(CommandError, match="calibrate the rig with its plate empty first"):
        calibration.begin(132.0)
    (tmp_path / "rig.yaml").write_text("empty plate")
    calibration.begin(132.0)
    assert end_of(calibration).problem == ""
    (words,) = (json.loads(p.read_text()) for p in tmp_path.glob("rig_calibration_*/*.words"))
    assert words[words.index("--spring") + 1] == "110"
    assert words[words.index("--beside") + 1] == str(tmp_path / "rig.yaml")


BOTH = ("--out", "--bag", "--namespace", "--json", "--overwrite")


@pytest.mark.parametrize(
    ("what", "options"),
    [
        ("session", ("--no-hand-over", "--seconds", "--report", "--rig")),
        ("rig", ("--title", "--amplitude", "--spring", "--beside")),
    ],
)
def test_the_options_are_those_of_the_command(what, options):
    from typer.testing import CliRunner

    from ankle_bringup.command_line import app

    words = ["calibrate", what, "--help"]
    shown = CliRunner().invoke(app, words, env={"TERMINAL_WIDTH": "200"})
    for option in (*BOTH, *options):
        assert option in shown.output


def test_the_protocol_says_what_is_calibrated(tmp_path):
    model = tmp_path / "S07.yaml"
    visit = calibration_of(load_protocol("visit"), "rig.yaml", model, "")
    assert (visit.what, visit.model) == ("session", model)
    rig = calibration_of(load_protocol("rig_calibration"), str(tmp_path / "a.yaml"), model, "")
    assert (rig.what, rig.model) == ("rig", tmp_path / "a.yaml")
    unnamed = calibration_of(load_protocol("rig_calibration"), "", model, "")
    assert unnamed.model.name == "rig.yaml"


def test_every_visit_has_a_subject_file_of_its_own():
    folder = Path("state")
    assert subject_file_of("own.yaml", "S07", 3, folder, 0.0) == Path("own.yaml")
    assert subject_file_of("", "S07", 3, folder, 0.0) == folder / "subject_S07_visit_3.yaml"
    # Nobody is named: the model of one start is never taken for that of another.
    first, second = (subject_file_of("", "", 0, folder, now) for now in (100.0, 200.0))
    assert first != second
