"""A rig is calibrated by a step of its own, with nobody in it."""

import pytest
from laboratory import FakeCalibration
from virtual_session import VirtualSession

from biofeedback.errors import CommandError, ProtocolError
from biofeedback.session.check_list import DONE, FAILED, OPEN, RUNNING
from biofeedback.session.protocol import load_protocol
from perturbation_generator.rig_calibration import DURATION

NAME = "calibrate_rig"


class CalibratedRig(VirtualSession):
    """A calibration of a rig, in virtual time."""

    def __init__(self):
        self.calibration = FakeCalibration()
        super().__init__(load_protocol("rig_calibration"), calibration=self.calibration)
        self.pass_time(0.1)

    def start(self):
        self.command("check", check="no_foot_on_plate", act="begin")
        self.command("arm")
        self.command("start")
        self.pass_time(0.5)

    @property
    def check(self):
        checks = self.runner.checks.entries
        return checks.states[NAME], checks.results[NAME]


@pytest.fixture
def rig():
    return CalibratedRig()


def test_nothing_moves_before_the_plate_is_said_to_be_empty(rig):
    assert rig.check == (OPEN, {})
    with pytest.raises(CommandError, match=r"not complete: No foot on the plate$"):
        rig.command("arm")
    with pytest.raises(CommandError, match="needs the armed rig: confirm that no foot"):
        rig.command("check", check=NAME, act="begin")
    assert rig.calibration.begun == []
    assert rig.rig.requests == []


def test_the_session_ends_and_the_rig_stops_once_the_rig_file_is_written(rig):
    rig.start()
    assert rig.calibration.begun == [DURATION]
    assert rig.check[0] == RUNNING
    assert rig.runner.view.instruction == "rig_calibration"
    rig.pass_time(2.0 * DURATION)  # the step waits for the file, however long that takes
    assert rig.session.state == "running"
    assert rig.rig.stopped_at == []
    with pytest.raises(CommandError, match="ends by itself once the rig file is written"):
        rig.command("next")
    rig.calibration.finish(servo="31 Hz")
    rig.pass_time(0.1)
    assert rig.check == (DONE, {"servo": "31 Hz"})
    assert rig.session.state == "finished"
    assert rig.rig.stopped_at != []
    assert [event.event for event in rig.events][-3:] == [
        "calibration started", "check done", "session finished",
    ]  # fmt: skip


def test_a_stop_ends_the_movement_and_a_failure_is_told(rig):
    rig.start()
    rig.command("stop")
    rig.pass_time(0.2)
    assert rig.calibration.cancelled == ["interrupted while it was recording"]
    assert rig.check == (FAILED, {"problem": "interrupted while it was recording"})
    rig.command("arm")
    rig.command("start")
    rig.pass_time(0.2)
    rig.calibration.finish("something holds the plate with 31 N.m/rad")
    rig.pass_time(0.2)
    assert rig.check == (FAILED, {"problem": "something holds the plate with 31 N.m/rad"})
    assert rig.session.state == "running"
    rig.command("check", check=NAME, act="begin")
    assert rig.calibration.begun == [DURATION] * 3


@pytest.mark.parametrize(
    ("text", "problem"),
    [
        ("check_list: [no_foot_on_plate]", "needs the check 'calibrate_rig'"),
        ("check_list: [calibrate_rig]", r"amplitude\[rad\] = 0.5 is refused; allowed: 0.005 to"),
        ("hold[s]: 3\ncheck_list: [calibrate_rig]", r"unknown key 'hold\[s\]'"),
    ],
)
def test_a_wrong_protocol_of_a_rig_is_refused(tmp_path, text, problem):
    path = tmp_path / "own.yaml"
    amplitude = 0.5 if "0.5" in problem else 0.04
    path.write_text(f"{text}\nrig_calibration: {{'amplitude[rad]': {amplitude}}}\n")
    with pytest.raises(ProtocolError, match=problem):
        load_protocol(str(path))


def test_the_shipped_protocols_of_a_rig():
    empty, spring = (load_protocol(f"rig_calibration{end}") for end in ("", "_with_spring"))
    assert empty.rig_movement.spring == 0.0
    assert spring.rig_movement.spring == 110.0
    assert spring.check_list == ("spring_on_plate", NAME)
    assert load_protocol("visit").rig_movement is None
