"""The session is calibrated with the perturbation running, in a step of its own."""

import pytest
from calibrated_session import NAME
from laboratory import CALIBRATED, short_protocol

from biofeedback.errors import CommandError, ProtocolError
from biofeedback.session.check_list import DONE, FAILED, OPEN, RUNNING, SKIPPED


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


def test_the_time_for_the_diagnosis_belongs_to_a_step_of_calibration(tmp_path):
    protocol = short_protocol(tmp_path, more=CALIBRATED + '"diagnosis[min]": 4\n')
    assert protocol.diagnosis_minutes == 4.0
    assert short_protocol(tmp_path, more=CALIBRATED).diagnosis_minutes is None
    with pytest.raises(ProtocolError, match=r"'diagnosis\[min\]' needs 'calibration\[s\]'"):
        short_protocol(tmp_path, more='"diagnosis[min]": 4\n')
    with pytest.raises(ProtocolError, match=r"diagnosis\[min\] = 0 is refused; allowed: 1 to 60"):
        short_protocol(tmp_path, more=CALIBRATED + '"diagnosis[min]": 0\n')


def test_a_step_of_calibration_needs_its_check(tmp_path):
    with pytest.raises(ProtocolError, match=r"'calibration\[s\]' needs the check 'session_cal"):
        short_protocol(tmp_path, more='"calibration[s]": 90\n')
    with pytest.raises(ProtocolError, match=r"calibration\[s\] = 5 is refused; allowed: 30 to 600"):
        short_protocol(tmp_path, more=CALIBRATED.replace("90", "5"))
