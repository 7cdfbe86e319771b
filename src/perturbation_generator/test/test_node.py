"""The node as a process of its own, heard over DDS."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray
from std_srvs.srv import Trigger

from ankle_interfaces.block import unpack
from ankle_interfaces.continuity import Continuity
from ankle_interfaces.error_report import PROGRAM_ERROR
from ankle_node.node import BLOCK_QOS
from perturbation_generator.edges import Filtered
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

pytestmark = pytest.mark.live

COLUMNS = ("t[s]", "position[rad]", "velocity[rad/s]", "acceleration[rad/s^2]")
PROGRAM = (
    "import sys; from perturbation_generator.perturbation_generator_node import main; "
    "sys.exit(main())"
)


@pytest.fixture
def ear():
    """A listener on the node's topics."""
    context = rclpy.Context()
    rclpy.init(context=context)
    listener = Ear(context)
    yield listener
    listener.close()


class Ear:
    def __init__(self, context):
        self.context = context
        self.node = rclpy.create_node("ear", context=context)
        self.blocks = []
        self.figures = {}
        self.messages = []
        self.node.create_subscription(
            Float64MultiArray, "/perturbation/reference", self._block, BLOCK_QOS, raw=True
        )
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._health, 10)
        self.set = self.node.create_client(SetParameters, "/perturbation_generator/set_parameters")
        self.executor = SingleThreadedExecutor(context=context)
        self.executor.add_node(self.node)

    def _block(self, message):
        self.blocks.append(unpack(message))

    def _health(self, message):
        self.figures = {entry.key: entry.value for entry in message.status[0].values}
        self.messages.append(message.status[0].message)

    def listen(self, until, seconds=30.0):
        """Spin until a condition holds; whether it did."""
        end = time.monotonic() + seconds
        while time.monotonic() < end:
            self.executor.spin_once(timeout_sec=0.05)
            if until():
                return True
        return False

    def set_amplitude(self, value):
        assert self.set.wait_for_service(timeout_sec=20.0)
        request = SetParameters.Request(
            parameters=[
                Parameter(name="amplitude", value=ParameterValue(type=3, double_value=value))
            ]
        )
        future = self.set.call_async(request)
        assert self.listen(future.done)
        return future.result().results[0]

    def trigger(self, service):
        client = self.node.create_client(Trigger, f"/perturbation_generator/{service}")
        assert client.wait_for_service(timeout_sec=20.0)
        future = client.call_async(Trigger.Request())
        assert self.listen(future.done)
        return future.result().success, future.result().message

    @property
    def data(self):
        return np.concatenate([block.data for block in self.blocks])

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


def start(*parameters):
    arguments = [sys.executable, "-c", PROGRAM, "--ros-args"]
    for parameter in parameters:
        arguments += ["-p", parameter]
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


def finish(process, seconds=30):
    try:
        return process.communicate(timeout=seconds)[0]
    finally:
        process.kill()


def test_blocks_are_those_of_the_pure_signal_and_the_process_ends_by_itself(ear):
    process = start("duration:=2.0", "seed:=17", "shape:=filtered", "wait_for_readers:=1")
    try:
        assert ear.listen(lambda: process.poll() is not None)
        ear.listen(lambda: False, 0.3)
    finally:
        output = finish(process)
    assert process.returncode == 0, output
    assert "the signal is over: 128 blocks sent" in output
    assert {block.columns for block in ear.blocks} == {COLUMNS}
    assert {len(block.data) for block in ear.blocks} == {32}
    continuity = Continuity(2048.0)
    assert [finding for block in ear.blocks for finding in continuity.check(block.data)] == []
    heard = ear.data
    whole = PulseStep(Settings(duration=2.0, seed=17, shape=Filtered())).next(2 * 2048)
    np.testing.assert_array_equal(heard[:, 1:], whole)
    np.testing.assert_allclose(np.diff(heard[:, 0]), 1 / 2048, rtol=0, atol=1e-6)
    assert np.all(heard[-100:, 1:] == 0.0)


def test_rate_times_and_block_size_are_those_asked_for(ear):
    process = start("rate:=1000.0", "block_size:=50", "signal:=prbs")
    try:
        assert ear.listen(lambda: len(ear.blocks) >= 10)
        began, first = time.time(), len(ear.blocks)
        ear.listen(lambda: len(ear.blocks) >= first + 30)
        lasted = time.time() - began
        late = time.time() - ear.blocks[-1].time[-1]
    finally:
        process.send_signal(signal.SIGTERM)
        output = finish(process)
    assert process.returncode == 0, output
    assert "Traceback" not in output
    assert {len(block.data) for block in ear.blocks} == {50}
    np.testing.assert_allclose(np.diff(ear.data[:, 0]), 1e-3, rtol=0, atol=1e-6)
    # Paced by the clock: 30 blocks of 50 ms take no less than 1.5 s (a late first one allowed for),
    # and a block arrives after its last sample's time.
    assert lasted > 1.2
    assert 0.0 < late < 10.0


def test_a_node_that_was_held_up_catches_up_and_says_so(ear):
    process = start()
    try:
        assert ear.listen(lambda: len(ear.blocks) >= 20)
        os.kill(process.pid, signal.SIGSTOP)
        ear.listen(lambda: False, 1.5)
        os.kill(process.pid, signal.SIGCONT)
        # Half of the blocks of that time and more; the machine may have been late by itself.
        assert ear.listen(lambda: int(ear.figures.get("late blocks", 0)) >= 48)
        assert any("late so far, none left out" in message for message in ear.messages)
        now = time.time()
        assert ear.listen(lambda: ear.blocks[-1].time[-1] > now)
    finally:
        process.send_signal(signal.SIGINT)
        output = finish(process)
    assert process.returncode == 0, output
    continuity = Continuity(2048.0)
    assert [finding for block in ear.blocks for finding in continuity.check(block.data)] == []
    assert float(ear.figures["worst lateness [ms]"]) > 1000.0
    assert int(ear.figures["blocks sent"]) >= len(ear.blocks) - 64


def test_amplitude_changes_while_it_runs_within_the_limits(ear):
    process = start("pulse_step.stretch:=0.0")
    try:
        assert ear.listen(lambda: len(ear.blocks) >= 5)
        assert ear.set_amplitude(0.02).successful
        refused = ear.set_amplitude(0.2)
        assert not refused.successful
        assert "amplitude of 0.2 rad passes the limit of 0.14 rad" in refused.reason
        heard = len(ear.blocks)
        assert ear.listen(lambda: len(ear.blocks) >= heard + 96)
    finally:
        process.send_signal(signal.SIGTERM)
        output = finish(process)
    assert process.returncode == 0, output
    data = ear.data
    assert data[-1024:, 1].max() == pytest.approx(0.02)
    assert np.abs(data[:, 2]).max() <= 3.126  # rad/s, of an edge of 0.04 rad: no jump at the change


@pytest.mark.live
@pytest.mark.timeout(90)
def test_what_was_requested_ends_when_somebody_asks_for_rest(ear):
    process = start(
        "signal:=rig_calibration", "rig_calibration.on_request:=true", "wait_for_readers:=1"
    )
    try:
        assert ear.listen(lambda: ear.blocks)
        assert ear.trigger("perturb")[0]
        done, sentence = ear.trigger("perturb")
        assert not done
        assert "is not over for another" in sentence
        assert ear.trigger("rest") == (True, "0.000000")  # the first movement comes after 10 s
        assert ear.trigger("perturb")[0]
    finally:
        process.terminate()
        finish(process)
    process = start("wait_for_readers:=1")
    try:
        done, sentence = ear.trigger("rest")
        assert not done
        assert "runs by itself" in sentence
    finally:
        process.terminate()
        finish(process)


def test_an_error_while_pacing_ends_the_process():
    program = """
import sys
from ankle_node.node import run
from perturbation_generator.perturbation_generator_node import PerturbationGeneratorNode
def fail(n): raise ValueError("no samples")
class Failing(PerturbationGeneratorNode):
    def _pace(self): self._signal.next = fail; super()._pace()
sys.exit(run(Failing))
"""
    process = subprocess.Popen(
        [sys.executable, "-c", program], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True
    )
    output = finish(process)
    assert process.returncode == PROGRAM_ERROR
    assert "ValueError: no samples" in output
