"""The session is calibrated with the perturbation running, by a program in the background."""

import asyncio
import json
import sys
import time
from pathlib import Path
from threading import current_thread
from unittest.mock import Mock

import pytest
from laboratory import (
    CALIBRATED,
    FakeCalibration,
    FakeEstimator,
    FakeRig,
    FakeSubject,
    short_protocol,
    until,
)

from ankle_node.session_event import SessionEvent
from ankle_physics import term
from ankle_physics.model import Model
from biofeedback.errors import CommandError, ProtocolError
from biofeedback.live_signals import LiveSignals
from biofeedback.session.calibration_files import subject_file_of
from biofeedback.session.calibration_program import CalibrationProgram
from biofeedback.session.calibration_step import TAKEOVER_PATIENCE
from biofeedback.session.check_list import DONE, FAILED, OPEN, RUNNING, SKIPPED
from biofeedback.session.commands import Command
from biofeedback.session.estimator_model import ModelOfEstimator, stated_model
from biofeedback.session.event_outbox import DISCOVERY, LONGEST_DISCOVERY, EventOutbox
from biofeedback.session.runner import SessionRunner
from biofeedback.session.saved_session import SAVE_PERIOD, ProgressKeeper, worth_resuming
from biofeedback.session.session_program import Session

PERIOD = 1 / 30
NAME = "session_calibration"


class CalibratedSession:
    """A session with the step, in virtual time."""

    def __init__(self, folder, file_checks=None):
        self.rig, self.events, self.calibration = FakeRig(), [], FakeCalibration()
        self.estimator, self.signals = FakeEstimator(), LiveSignals()
        self.session = Session(short_protocol(folder, baseline=60, more=CALIBRATED))
        self.now = 1000.0
        self.runner = SessionRunner(
            self.session,
            self.signals,
            self.rig,
            FakeSubject(),
            self.events.append,
            lambda: self.now,
            calibration=self.calibration,
            estimator=self.estimator,
            file_checks=file_checks,
        )
        self.runner.record(self.runner.checks.read_files(self.now))
        self.pass_time(0.1)

    def diagnose(self, at_once=False):
        """Start, and end the diagnosis; the estimator has the model and does not use it yet."""
        self.estimator.at_once = at_once
        self.start()
        self.calibration.finish(found="tissue friction")
        self.pass_time(0.1)

    def pass_time(self, seconds):
        for _ in range(round(seconds / PERIOD)):
            self.now += PERIOD
            self.runner.hear_operator(self.now)
            self.runner.tick(self.now, self.now)

    def command(self, name, **values):
        asyncio.run(self.runner.carry_out(Command(1, name, values)))
        self.rig.state = {"arm": "armed", "start": "running"}.get(name, self.rig.state)

    def start(self):
        self.command("check", check="warm_up", act="begin")
        self.command("arm")
        self.command("start")
        self.pass_time(0.5)

    @property
    def check(self):
        checks = self.runner.checks.entries
        return checks.states[NAME], checks.results[NAME]


@pytest.fixture
def visit(tmp_path):
    return CalibratedSession(tmp_path)


def test_the_step_begins_the_calibration_and_ends_with_it(visit):
    assert visit.check == (OPEN, {})
    with pytest.raises(CommandError, match=r"not complete: Warm-up$"):
        visit.command("arm")  # the calibration itself needs what is armed here
    with pytest.raises(CommandError, match="needs the running perturbation"):
        visit.command("check", check=NAME, act="begin")
    assert visit.calibration.begun == []
    assert not visit.estimator.prepared
    visit.start()
    assert visit.session.step.kind == "calibration"
    assert visit.calibration.begun == [90.0]
    assert visit.estimator.prepared
    assert visit.check == (RUNNING, {"progress": "recording, 34 of 90 s"})
    visit.calibration.recording = False
    visit.pass_time(300.0)  # the step waits for the diagnosis, however long that takes
    assert visit.session.step.kind == "calibration"
    visit.calibration.finish(found="tissue friction")
    visit.pass_time(0.1)
    assert visit.check[0] == DONE
    assert visit.session.step.kind == "baseline"
    names = [event.event for event in visit.events]
    assert names[-3:] == ["calibration started", "check done", "baseline started"]
    assert visit.events[-2].details["found"] == "tissue friction"
    assert visit.events[-2].details["estimator"] == "goes on with this model"
    assert visit.estimator.handed == [visit.calibration.model]
    assert visit.rig.stopped_at == []


def test_a_stop_ends_the_recording_and_the_next_start_begins_anew(visit):
    visit.start()
    visit.command("stop")
    visit.pass_time(0.2)
    assert visit.calibration.cancelled == ["interrupted while it was recording"]
    assert visit.check == (FAILED, {"problem": "interrupted while it was recording"})
    visit.command("arm")
    visit.command("start")
    visit.pass_time(0.2)
    assert visit.calibration.begun == [90.0, 90.0]
    assert visit.check[0] == RUNNING


def test_a_failed_calibration_is_repeated_or_skipped_by_the_operator(visit):
    visit.start()
    visit.calibration.finish("the recording is too noisy")
    visit.pass_time(60.0)
    assert visit.session.step.kind == "calibration"
    assert visit.check == (FAILED, {"problem": "the recording is too noisy"})
    visit.command("check", check=NAME, act="begin")
    assert visit.calibration.begun == [90.0, 90.0]
    visit.command("check", check=NAME, act="skip")
    visit.pass_time(0.2)
    assert visit.check[0] == SKIPPED
    assert visit.session.step.kind == "baseline"
    assert visit.calibration.cancelled == ["skipped by the operator"]


def test_a_new_session_is_calibrated_anew_and_forgets_the_model_of_the_last_subject(visit):
    visit.start()
    visit.calibration.finish()
    visit.pass_time(0.2)
    visit.command("stop")
    visit.command("restart")
    assert visit.check == (OPEN, {})
    assert visit.estimator.handed == [visit.calibration.model, None]


# ----- the estimator -----


def test_the_baseline_waits_until_the_estimator_uses_the_model(visit):
    visit.diagnose()
    visit.pass_time(TAKEOVER_PATIENCE / 2)
    assert visit.session.step.kind == "calibration"
    state, shown = visit.check
    assert state == RUNNING
    assert "waiting for the estimator to go on with the model, 60 s so far" in shown["progress"]
    with pytest.raises(CommandError, match="once the estimator uses the new model; 'Skip'"):
        visit.command("next")
    visit.estimator.confirmed = True
    visit.pass_time(0.1)
    assert visit.check[0] == DONE
    assert visit.session.step.kind == "baseline"


def test_an_estimator_that_does_not_take_the_model_is_named_and_can_be_left_without(visit):
    reason = {"estimate": "not valid: no excitation in the memory"}
    visit.signals.feed_status("impedance_estimator", 0, "running", reason, visit.now)
    visit.diagnose()
    visit.pass_time(TAKEOVER_PATIENCE + 1.0)
    assert visit.session.step.kind == "calibration"
    state, shown = visit.check
    assert state == FAILED
    assert "does not go on with the model after 120 s" in shown["problem"]
    assert "are not valid: no excitation in the memory" in shown["problem"]
    assert "skip to go on without" in shown["problem"]
    assert [event.event for event in visit.events].count("check failed") == 1
    visit.command("check", check=NAME, act="skip")
    visit.pass_time(0.1)
    assert visit.session.step.kind == "baseline"
    assert visit.estimator.handed[-1] is None  # it must not take over in the middle of a hold


def test_a_model_that_is_used_late_counts(visit):
    visit.diagnose()
    visit.pass_time(TAKEOVER_PATIENCE + 1.0)
    assert visit.check[0] == FAILED
    visit.estimator.confirmed = True
    visit.pass_time(0.1)
    assert visit.check[0] == DONE
    assert visit.session.step.kind == "baseline"


def test_time_without_perturbation_is_no_time_for_the_estimator(visit):
    visit.diagnose()
    visit.pass_time(TAKEOVER_PATIENCE - 10.0)
    visit.command("stop")
    visit.pass_time(300.0)
    assert visit.check[0] == RUNNING
    visit.command("arm")
    visit.command("start")
    visit.pass_time(5.0)
    assert visit.check[0] == RUNNING
    assert visit.calibration.begun == [90.0]  # what is diagnosed is not recorded again
    visit.pass_time(10.0)
    assert visit.check[0] == FAILED
    visit.command("stop")
    visit.pass_time(0.1)
    visit.command("arm")
    visit.command("start")
    visit.pass_time(1.0)
    assert visit.check[0] == RUNNING
    assert visit.estimator.handed == 2 * [visit.calibration.model]


@pytest.mark.parametrize("field", ["problem", "refusal"])
def test_an_estimator_that_refuses_says_why(visit, field):
    setattr(visit.estimator, field, "no node 'impedance_estimator' answers")
    visit.diagnose()
    assert visit.check[0] == FAILED
    assert "no node 'impedance_estimator' answers" in visit.check[1]["problem"]
    assert visit.session.step.kind == "calibration"


def test_a_model_from_a_file_counts_once_the_estimator_uses_it(tmp_path):
    visit = CalibratedSession(tmp_path, {NAME: lambda: {"terms": "stiffness"}})
    assert visit.check == (DONE, {"terms": "stiffness"})
    visit.estimator.at_once = False
    visit.start()
    assert visit.session.step.kind == "calibration"
    assert visit.check[0] == RUNNING
    assert visit.calibration.begun == []
    visit.estimator.confirmed = True
    visit.pass_time(0.1)
    assert visit.check == (DONE, {"terms": "stiffness", "estimator": "goes on with this model"})
    assert visit.session.step.kind == "baseline"


def test_the_estimators_own_words_say_which_model_it_uses(tmp_path):
    from impedance_estimator.known_physics import KnownPhysics
    from impedance_estimator.provenance import provenance
    from impedance_estimator.stream import EstimateStream

    path = tmp_path / "S07.yaml"
    Model.of(title="S07").save(path)
    known = KnownPhysics(None, Model.load(path))
    assert stated_model(provenance(EstimateStream(known=known))) == Model.load(path).sha256
    assert stated_model(provenance(EstimateStream())) == ""
    assert stated_model("algorithm: simultaneous") is None
    assert stated_model("[") is None


def test_a_step_of_calibration_needs_its_check(tmp_path):
    with pytest.raises(ProtocolError, match=r"'calibration\[s\]' needs the check 'session_cal"):
        short_protocol(tmp_path, more='"calibration[s]": 90\n')
    with pytest.raises(ProtocolError, match=r"calibration\[s\] = 5 is refused; allowed: 30 to 600"):
        short_protocol(tmp_path, more=CALIBRATED.replace("90", "5"))


# ----- the program -----


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
    record = 'pathlib.Path(words[words.index("--bag") + 1]).mkdir(); time.sleep(0.5)'
    calibration = program(tmp_path, f"{record}; print({printed!r})")
    calibration.begin(90.0)
    assert calibration.recording
    assert "starting to record" in calibration.progress()
    until(lambda: "recording, 0 of 90 s" in calibration.progress(), "recording")
    assert calibration.recording
    with pytest.raises(CommandError, match="already"):
        calibration.begin(90.0)
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


# ----- what the node hands on -----


def test_events_wait_for_a_reader_but_not_for_ever():
    now, readers, logged, sent, woken = [0.0], [0], [], [], []
    outbox = EventOutbox(
        logged.append, sent.append, lambda: readers[0], lambda: woken.append(1), lambda: now[0]
    )
    outbox.put(SessionEvent("note", 1.0))
    assert woken
    outbox.send()
    assert (len(logged), sent) == (1, [])
    now[0], readers[0] = DISCOVERY + 0.1, 1
    outbox.send()
    assert len(sent) == 1
    readers[0] = 0
    outbox.put(SessionEvent("note", 2.0))
    outbox.send()
    assert len(sent) == 1
    now[0] = LONGEST_DISCOVERY + 0.1
    outbox.send()
    assert (len(logged), len(sent)) == (2, 2)


def test_progress_is_written_at_steps_and_once_a_second(tmp_path):
    now, written = [0.0], []
    start = {"index": 0, "elapsed": 0.0}
    keeper = ProgressKeeper(tmp_path / "p.json", start, print, lambda: now[0])
    keeper.close()
    keeper._writer.keep = written.append
    keeper.keep({"index": 0, "elapsed": 0.1})
    assert written == []
    keeper.keep({"index": 1, "elapsed": 0.0})
    assert len(written) == 1
    now[0] = SAVE_PERIOD + 0.1
    keeper.keep({"index": 1, "elapsed": 0.9})
    keeper.keep({"index": 1, "elapsed": 0.9})
    assert len(written) == 2


def test_only_a_session_that_got_anywhere_is_resumed():
    assert not worth_resuming(None)
    assert not worth_resuming({"state": "idle", "index": 0, "checks": {}})
    assert worth_resuming({"state": "idle", "index": 0, "checks": {"zero": {}}})
    assert worth_resuming({"state": "running", "index": 0})


def test_terms_are_loaded_beside_the_session_while_it_is_calibrated(monkeypatch):
    loaded = []
    monkeypatch.setattr(term, "term_library", lambda: loaded.append(current_thread()))
    ModelOfEstimator(Mock()).prepare()
    until(lambda: loaded, "loaded")
    assert loaded != [current_thread()]


@pytest.mark.live
def test_a_node_that_has_the_models_path_already_receives_its_new_content(tmp_path):
    import rclpy
    from rcl_interfaces.msg import SetParametersResult
    from rclpy.executors import SingleThreadedExecutor
    from std_msgs.msg import String

    from ankle_interfaces.topics import IMPEDANCE_PROVENANCE
    from ankle_node.qos import publisher_qos

    context = rclpy.Context()
    context.init()
    estimator = rclpy.create_node("impedance_estimator", context=context)
    pages = rclpy.create_node("pages", context=context)
    executor = SingleThreadedExecutor(context=context)
    executor.add_node(estimator)
    executor.add_node(pages)
    given = []
    estimator.add_on_set_parameters_callback(
        lambda changes: (
            given.extend(change.value for change in changes),
            SetParametersResult(successful=True),
        )[1]
    )
    estimator.declare_parameter("model", "")
    given.clear()
    stated = estimator.create_publisher(
        String, IMPEDANCE_PROVENANCE.name, publisher_qos(IMPEDANCE_PROVENANCE)
    )
    model = ModelOfEstimator(pages)

    def spin(condition):
        until(lambda: (executor.spin_once(timeout_sec=0.05), condition())[1], "received", 20.0)

    try:
        path = tmp_path / "S07.yaml"
        for stiffness in (80.0, 120.0):
            Model.of({"stiffness": {"K": stiffness}}).save(path)
            spin(lambda: model._client.service_is_ready())
            model.hand_over(path)
            assert not model.confirmed
            spin(lambda: len(given) == 2)
            assert given == ["", str(path)]
            given.clear()
            stated.publish(String(data=f"model: {{sha256: {Model.load(path).sha256}}}"))
            spin(lambda: model.confirmed)
        assert model.refusal == ""
        with pytest.raises(CommandError, match=r"nothing\.yaml"):
            model.hand_over(tmp_path / "nothing.yaml")
        assert not model.confirmed
        estimator.add_on_set_parameters_callback(
            lambda changes: SetParametersResult(successful=False, reason="no such term")
        )
        model.hand_over(None)
        spin(lambda: model.refusal == "no such term")
    finally:
        executor.shutdown()
        pages.destroy_node()
        estimator.destroy_node()
        context.try_shutdown()
