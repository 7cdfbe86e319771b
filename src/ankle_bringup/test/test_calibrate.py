"""`ankle calibrate`: what is refused before and after a recording, and what is said of a result."""

import os
import signal
import threading
import time
from contextlib import nullcontext, suppress
from datetime import datetime, timezone

import numpy as np
import pytest
import rclpy
from std_msgs.msg import String
from typer.testing import CliRunner

from ankle_bringup import calibration_recording, live_graph
from ankle_bringup.calibration_recording import recorded_into, require_state
from ankle_bringup.command_line import app
from ankle_bringup.errors import RunError
from ankle_bringup.verbs import calibrate
from ankle_interfaces.block import Block
from ankle_interfaces.topics import ANKLE_SAMPLES, RIG_STATE
from ankle_node.node import LATEST_QOS
from ankle_physics.model import Model, StatedValue
from ankle_physics.rig_file import Measured, RigFile
from calibration import session_calibration
from calibration.session_calibration import CalibratedSession
from session_recorder.bag_writer import BagWriter

RATE = 1000.0
COLUMNS = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")


def ankle(*arguments):
    return CliRunner().invoke(app, [str(a) for a in arguments])


def record(path, seconds):
    """Write a bag in which the velocity is read with the position."""
    time = np.arange(round(seconds * RATE)) / RATE
    omega = 2.0 * np.pi * np.array([5.0, 11.0])[:, None]
    position = 0.01 * np.sin(omega * time).sum(axis=0)
    velocity = 0.01 * (omega * np.cos(omega * time)).sum(axis=0)
    samples = np.column_stack([1.7e9 + time, position, velocity, 80.0 * position])
    with BagWriter(path) as writer:
        writer.add_topic(ANKLE_SAMPLES.absolute)
        if len(samples):
            writer.write_block(ANKLE_SAMPLES.absolute, Block(COLUMNS, samples))
    return path


@pytest.fixture
def bag(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return record(tmp_path / "visit", 12.0)


@pytest.fixture
def diagnosed(monkeypatch):
    """What a diagnosis of a few minutes finds, and how often one was made."""
    model = Model.of({"stiffness": {"K": 80.0}, "reflex": {"G": 7.0}})
    model.stated = {"K": StatedValue(80.0, 30.0), "G": StatedValue(7.0, 0.4)}
    parameters = {
        "K[N.m/rad]": {"augmented": 80.0, "standard_error": 30.0},
        "G[N.m.s/rad]": {"augmented": 7.0, "standard_error": 0.4},
    }
    verdict = {"verdict": "unexplained", "effects": [], "parameters": parameters}
    made = []

    def calibrated(recording, *_):
        made.append(recording.name)
        return CalibratedSession(model, verdict)

    monkeypatch.setattr(session_calibration, "calibrate_session", calibrated)
    monkeypatch.setattr(session_calibration, "require_gain", lambda *_: None)
    return made


def rig_file(path, delay):
    date = datetime(2026, 1, 1, tzinfo=timezone.utc)
    RigFile("laboratory 2", date, velocity_delay=Measured(delay)).save(path)
    return path


def test_the_file_of_another_rig_writes_no_model_unless_it_is_forced(bag, diagnosed, tmp_path):
    words = ("calibrate", "session", bag, "--rig", rig_file(tmp_path / "rig.yaml", 0.0003))
    refused = ankle(*words)
    assert refused.exit_code == 1
    assert "calibrated were 0.30 ms" in str(refused.exception)
    assert "--force" in str(refused.exception)
    assert diagnosed == []
    assert not (tmp_path / "subject.yaml").exists()
    forced = ankle(*words, "--force")
    assert forced.exit_code == 0, forced.exception
    assert "contradicts the recording: velocity comes" in forced.output
    assert (tmp_path / "subject.yaml").exists()


def test_the_file_of_the_right_rig_is_taken_and_the_result_is_shown(bag, diagnosed, tmp_path):
    done = ankle("calibrate", "session", bag, "--rig", rig_file(tmp_path / "rig.yaml", 0.0))
    assert done.exit_code == 0, done.exception
    assert "contradicts" not in done.output
    shown = " ".join(done.output.split())
    assert "K[N.m/rad] 80 ± 30" in shown
    assert "G[N.m.s/rad] 7 ± 0.4" in shown
    assert "above 14 % of K or 12 % of G: every later estimate will be doubted" in shown
    assert "warning: the verdict is 'unexplained'" in shown
    assert "warning: K = 80 ± 30 N.m/rad is known to 38 % only, more than 25 %" in shown
    assert shown.index("warning: K") < shown.index("written to")


def test_each_place_that_is_taken_is_named_with_its_own_option(bag, tmp_path):
    taken = ankle("calibrate", "session", "--bag", bag)
    assert "another --bag, or calibrate from it: ankle calibrate session" in str(taken.exception)
    taken = ankle("calibrate", "rig", "--bag", bag)
    assert "another --bag, or calibrate from it: ankle calibrate rig" in str(taken.exception)
    (tmp_path / "session_diagnosis").mkdir()
    (tmp_path / "session_diagnosis" / "verdict.json").touch()
    assert "another --report" in str(ankle("calibrate", "session", bag).exception)
    (tmp_path / "subject.yaml").touch()
    assert "another --out" in str(ankle("calibrate", "session", bag).exception)


def test_a_file_is_completed_with_a_spring_alone(bag, tmp_path):
    beside = rig_file(tmp_path / "empty.yaml", 0.0)
    refused = ankle("calibrate", "rig", bag, "--beside", beside)
    assert str(refused.exception).startswith("--beside needs a spring")


def test_a_recording_without_samples_leaves_no_bag(tmp_path):
    bag = tmp_path / "bag"
    with (
        pytest.raises(RunError, match="no samples came while"),
        recorded_into(bag),
    ):
        record(bag, 0.0)
    assert not bag.exists()
    for seconds, left in ((0.0, False), (1.0, True)):
        with suppress(KeyboardInterrupt), recorded_into(bag):
            record(bag, seconds)
            raise KeyboardInterrupt
        assert bag.exists() is left
    with suppress(RunError), recorded_into(tmp_path / "plate", whole=True):
        record(tmp_path / "plate", 1.0)
        raise RunError("the rig was stopped")
    assert not (tmp_path / "plate").exists()


@pytest.mark.live
@pytest.mark.parametrize("verb", ["session", "rig"])
def test_without_a_rig_nothing_is_recorded_and_the_refusal_comes_soon(verb, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(calibration_recording, "RIG_SECONDS", 1.0)
    refused = ankle("calibrate", verb, "--namespace", "nobody")
    assert "no rig runs: nobody publishes '/nobody/ankle/samples'" in str(refused.exception)
    assert [*tmp_path.iterdir()] == []


@pytest.mark.parametrize("state", ["armed", "ready: stopped by the operator", "fault: encoder"])
def test_a_rig_that_does_not_follow_is_not_calibrated(state):
    with pytest.raises(RunError, match=f"its state is '{state}': arm and start it"):
        require_state(["running", state])
    require_state([state, "running"])
    require_state([])  # a rig that states nothing


@pytest.fixture
def faulted():
    """A rig in the namespace `left` that has faulted, in a context as another process has it."""
    context = rclpy.Context()
    rclpy.init(context=context)
    driver = rclpy.create_node("driver", context=context, namespace="left")
    publisher = driver.create_publisher(String, RIG_STATE.name, LATEST_QOS)
    publisher.publish(String(data="fault: the plate hit its stop"))
    yield
    driver.destroy_node()
    rclpy.shutdown(context=context)


@pytest.mark.live
def test_an_ended_wait_for_the_estimator_says_so_and_names_the_fault(
    faulted, tmp_path, monkeypatch
):
    Model.of({"stiffness": {"K": 80.0}}).save(tmp_path / "subject.yaml")
    monkeypatch.setattr(live_graph, "set_parameter", lambda *_: None)
    heard = []

    def states(node):
        heard.append(listen(node))
        return heard[0]

    listen = calibrate.rig_states
    monkeypatch.setattr(calibrate, "rig_states", states)

    def end():
        # The model is waited for as soon as the first message arrives.
        while not (heard and heard[0]):
            time.sleep(0.05)
        os.kill(os.getpid(), signal.SIGTERM)

    threading.Thread(target=end, daemon=True).start()
    began = time.monotonic()
    said = calibrate._handed_over(tmp_path / "subject.yaml", "left")
    assert said == (
        "ended by a signal before the running estimator said that it uses the model; the rig is in "
        "fault: the plate hit its stop"
    )
    assert time.monotonic() - began < 30.0


@pytest.mark.parametrize("left", ["0.000000", "0.200000"])
def test_a_calibration_that_ends_early_brings_the_plate_to_rest(left, monkeypatch, tmp_path):
    asked = []

    def trigger(node, name, command):
        asked.append(command)
        return True, left

    def recording(bag, seconds, namespace, what, begun, follow):
        begun()
        raise RunError("the recording was ended after 20 s of 135 s")

    monkeypatch.setattr(live_graph, "observer", lambda **_: nullcontext())
    monkeypatch.setattr(live_graph, "set_parameter", lambda *_: None)
    monkeypatch.setattr(live_graph, "trigger", trigger)
    monkeypatch.setattr(calibration_recording, "rig_states", lambda node: ["running"])
    monkeypatch.setattr(calibration_recording, "record_session", recording)
    began = time.monotonic()
    with pytest.raises(RunError, match="ended after 20 s"):
        calibration_recording.record_rig(tmp_path / "bag", 0.04, "")
    assert time.monotonic() - began >= float(left)
    assert asked == ["rest", "perturb", "rest"]
