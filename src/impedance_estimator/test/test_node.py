"""The node over DDS: the numbers of the file, reasons on /diagnostics, parameters at run time, bad
blocks.
"""

import contextlib
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.srv import DescribeParameters, SetParameters
from rclpy.executors import SingleThreadedExecutor
from rclpy.parameter import Parameter
from std_msgs.msg import Float64MultiArray

from ankle_interfaces.block import Block, pack, unpack
from ankle_node.acknowledgement import Greetings
from ankle_node.node import BLOCK_QOS
from ankle_physics.model import Model
from impedance_estimator.estimator import ESTIMATE_COLUMNS, REFLEX_COLUMNS
from impedance_estimator.known_physics import KnownPhysics
from impedance_estimator.offline.recorded_estimates import estimate_signal
from impedance_estimator.settings import Settings

pytestmark = pytest.mark.live

COLUMNS = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")
COMMAND = [
    sys.executable,
    "-c",
    "from impedance_estimator.impedance_estimator_node import main; main()",
]
LIMIT = 90.0  # s; compiling on a busy machine


class Laboratory:
    """A running node, and the topics around it."""

    def __init__(self, *parameters):
        arguments = [word for parameter in parameters for word in ("-p", parameter)]
        self.process = subprocess.Popen([*COMMAND, "--ros-args", *arguments])
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("probe", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.publisher = self.node.create_publisher(Float64MultiArray, "/ankle/samples", BLOCK_QOS)
        self.estimates, self.responses, self.tracked, self.health = [], [], [], []
        for topic, target in (
            ("/impedance/estimate", self.estimates),
            ("/impedance/reflex_irf", self.responses),
            ("/impedance/tracked", self.tracked),
        ):
            self.node.create_subscription(
                Float64MultiArray,
                topic,
                lambda m, target=target: target.append(unpack(m)),
                BLOCK_QOS,
                raw=True,
            )
        self.node.create_subscription(
            DiagnosticArray,
            "/diagnostics",
            lambda m: self.health.extend(s.message for s in m.status),
            10,
        )
        # The node may find the publisher later than it is found, and gets nothing until then.
        greetings = Greetings(self.node, "/ankle/samples")
        self.until(lambda: self.publisher.get_subscription_count() == 1 and not greetings.missing)
        greetings.close()

    def until(self, condition):
        end = time.monotonic() + LIMIT
        while not condition():
            assert self.process.poll() is None, "the node has ended"
            assert time.monotonic() < end, "nothing came within the time limit"
            self.executor.spin_once(timeout_sec=0.05)

    def send(self, blocks):
        """Blocks, never more than 32 ahead of their estimates, so that no queue overflows."""
        before = len(self.estimates)
        for k, block in enumerate(blocks):
            self.publisher.publish(pack(block))
            self.until(lambda k=k: len(self.estimates) - before > k - 32)
        self.until(lambda: len(self.estimates) - before >= len(blocks))

    def call(self, kind, service, request):
        client = self.node.create_client(kind, f"/impedance_estimator/{service}")
        self.until(client.service_is_ready)
        future = client.call_async(request)
        self.until(future.done)
        return future.result()

    def set(self, name, value):
        request = SetParameters.Request(
            parameters=[Parameter(name, value=value).to_parameter_msg()]
        )
        return self.call(SetParameters, "set_parameters", request).results[0]

    def close(self):
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.try_shutdown(context=self.context)
        self.process.terminate()
        with contextlib.suppress(subprocess.TimeoutExpired):
            self.process.wait(timeout=10)
        self.process.kill()


@pytest.fixture
def start():
    running = []

    def make(*parameters):
        running.append(Laboratory(*parameters))
        return running[-1]

    yield make
    for laboratory in running:
        laboratory.close()


def blocks_of(samples):
    return [
        Block(COLUMNS, np.ascontiguousarray(samples[k : k + 32]))
        for k in range(0, len(samples) - 31, 32)
    ]


def test_node_gives_the_numbers_of_the_file(start, minute):
    laboratory = start("algorithm:=CE", "settling_time:=3.0", "highpass:=all")
    samples = minute.samples()[: 32 * 400]
    laboratory.send(blocks_of(samples))
    expected = estimate_signal(*samples.T, "CE", Settings(settling_time=3.0, highpass="all"))
    rows = np.concatenate([block.data for block in laboratory.estimates])
    assert laboratory.estimates[0].columns == ESTIMATE_COLUMNS
    np.testing.assert_array_equal(rows, expected.rows)
    assert rows[-1, 7] == 1.0
    laboratory.until(lambda: len(laboratory.responses) == len(expected.responses))
    assert laboratory.responses[-1].columns == REFLEX_COLUMNS
    np.testing.assert_array_equal(laboratory.responses[-1].data, expected.responses[-1][1])


def test_tracked_gains_are_sent_as_the_file_gives_them(start, minute, tmp_path):
    model = Model.of(
        {
            "inertia": {"I": 0.0137},
            "viscosity": {"B": 0.63},
            "stiffness": {"K": 100.0},
            "reflex": {"G": 10.0},
            "maxwell_relaxation": {"k": 20.0},
        }
    )
    model.entry("maxwell_relaxation").tracked = True
    model.save(tmp_path / "subject.yaml")
    laboratory = start("algorithm:=CE", "settling_time:=3.0", f"model:={tmp_path}/subject.yaml")
    # The gains are stated from ten seconds on.
    samples = minute.samples()[: 32 * 720]
    laboratory.send(blocks_of(samples))
    known = KnownPhysics(subject=Model.load(tmp_path / "subject.yaml"))
    settings = Settings(settling_time=3.0)
    expected = estimate_signal(*samples.T, "CE", settings, known=known).tracked
    laboratory.until(lambda: len(laboratory.tracked) == len(expected))
    columns = ("maxwell_relaxation.k[N.m/rad]", "se_maxwell_relaxation.k[N.m/rad]")
    assert laboratory.tracked[-1].columns == ("t[s]", *columns)
    rows = np.concatenate([block.data for block in laboratory.tracked])
    np.testing.assert_array_equal(rows, expected)
    # That subject's tissue does not relax: a calibrated 20 N.m/rad is found to be none.
    assert abs(rows[-1, 1]) < 4.0 * rows[-1, 2] + 2.0


def test_parameters_reasons_and_bad_blocks_at_run_time(start, minute):
    laboratory = start("algorithm:=CE", "settling_time:=3.0")
    samples = minute.samples()[: 32 * 400]
    bad = Block(("t[s]", "position[rad]", "force[N]"), samples[:32, :3])
    laboratory.publisher.publish(pack(bad))
    laboratory.until(lambda: any("no column 'torque[N.m]'" in text for text in laboratory.health))
    laboratory.send(blocks_of(samples))
    refused = laboratory.set("highpass_cutoff", 50.0)
    assert not refused.successful
    assert "'highpass_cutoff' = 50.0 Hz is refused; allowed: 0.001 to 3 Hz" in refused.reason
    assert not laboratory.set("reflex_last_lag", 0.01).successful
    request = DescribeParameters.Request(names=["reflex_first_lag"])
    described = laboratory.call(DescribeParameters, "describe_parameters", request).descriptors[0]
    assert "[s]" in described.description
    assert described.additional_constraints == "allowed: 0.02 to 0.1 s"
    assert laboratory.estimates[-1].data[0, 7] == 1.0
    # A changed setting never stops the stream: what it changes takes over when it is valid.
    assert laboratory.set("highpass", "all").successful
    later = minute.samples()[32 * 400 : 32 * 800]
    del laboratory.estimates[:]
    laboratory.send(blocks_of(later))
    rows = np.concatenate([block.data for block in laboratory.estimates])
    assert (rows[:, 7] == 1.0).all()
    expected = estimate_signal(*later.T, "CE", Settings(settling_time=3.0, highpass="all")).rows
    np.testing.assert_array_equal(rows[-100:], expected[-100:])
    lost = samples[: 32 * 8].copy()
    lost[:, 0] += later[-1, 0] + 1.0
    lost[:, 1] = np.nan
    laboratory.send(blocks_of(lost))
    laboratory.until(lambda: any("NaN" in text for text in laboratory.health))
    assert laboratory.estimates[-1].data[0, 7] == 0.0
