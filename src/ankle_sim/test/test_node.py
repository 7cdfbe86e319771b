"""The node as a process of its own, over DDS: topics, parameters at run time, scenario, gaps, bad
input.
"""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import DescribeParameters, GetParameters, SetParameters
from rclpy.executors import SingleThreadedExecutor
from sensor_msgs.msg import JointState
from std_msgs.msg import Float64MultiArray

from ankle_interfaces.block import Block, pack, unpack
from ankle_node.acknowledgement import Greetings
from ankle_node.node import BLOCK_QOS
from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings

pytestmark = pytest.mark.live

RATE = 2048.0
COLUMNS = ("t[s]", "position[rad]", "velocity[rad/s]", "acceleration[rad/s^2]")
PATIENCE = 60.0  # s; the first start compiles


def process(*parameters):
    program = "import sys; from ankle_sim.ankle_sim_node import main; sys.exit(main())"
    arguments = [sys.executable, "-c", program, "--ros-args"]
    for parameter in parameters:
        arguments += ["-p", parameter]
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)


class Bench:
    """Publishes references to a node process and hears what it answers."""

    def __init__(self, *parameters):
        self.process = process("wait_for_readers:=1", *parameters)
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("bench", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.samples, self.truth, self.joint, self.health = [], [], [], []
        subscribe = self.node.create_subscription
        subscribe(
            Float64MultiArray,
            "/ankle/samples",
            lambda m: self.samples.append(unpack(m)),
            BLOCK_QOS,
            raw=True,
        )
        subscribe(
            Float64MultiArray,
            "/ankle/truth",
            lambda m: self.truth.append(unpack(m)),
            BLOCK_QOS,
            raw=True,
        )
        subscribe(JointState, "/joint_states", self.joint.append, 64)
        subscribe(DiagnosticArray, "/diagnostics", lambda m: self.health.extend(m.status), 64)
        self.reference = self.node.create_publisher(
            Float64MultiArray, "/perturbation/reference", BLOCK_QOS
        )

    def until(self, condition, what):
        deadline = time.monotonic() + PATIENCE
        while not condition():
            self.executor.spin_once(timeout_sec=0.05)
            if self.process.poll() is not None:
                raise AssertionError(f"the node ended: {self.process.stdout.read()}")
            assert time.monotonic() < deadline, f"not reached: {what}"

    def send(self, start, reference, columns=COLUMNS, rate=RATE, size=32):
        """Blocks from time `start` on, never more than a few ahead of the answers."""
        stamps = start + np.arange(len(reference)) / rate
        for k in range(0, len(reference), size):
            self.reference.publish(
                pack(
                    Block(columns, np.column_stack([stamps[k : k + size], reference[k : k + size]]))
                )
            )
            self.executor.spin_once(timeout_sec=0.001)
            time.sleep(0.001)
        return stamps

    def hear(self, count):
        self.until(
            lambda: sum(len(block.data) for block in self.samples) >= count, f"{count} samples"
        )
        return np.concatenate([block.data for block in self.samples])

    def call(self, kind, service, **fields):
        client = self.node.create_client(kind, f"/ankle_sim/{service}")
        self.until(client.service_is_ready, service)
        future = client.call_async(kind.Request(**fields))
        self.until(future.done, service)
        return future.result()

    def set(self, name, value):
        wanted = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        return self.call(
            SetParameters, "set_parameters", parameters=[Parameter(name=name, value=wanted)]
        ).results[0]

    def close(self):
        self.process.send_signal(signal.SIGINT)
        try:
            code = self.process.wait(timeout=10)
        finally:
            self.process.kill()
            self.process.stdout.close()
            self.executor.shutdown()
            self.node.destroy_node()
            rclpy.shutdown(context=self.context)
        assert code == 0


@pytest.fixture
def bench(request):
    benches = []

    def start(*parameters):
        benches.append(Bench(*parameters))
        bench = benches[-1]
        # The node may find the publisher later than it is found, and gets nothing until then.
        greetings = Greetings(bench.node, "/perturbation/reference")
        bench.until(
            lambda: bench.reference.get_subscription_count() > 0 and not greetings.missing,
            "the node subscribes",
        )
        greetings.close()
        return bench

    yield start
    for one in benches:
        one.close()


def test_samples_truth_parameters_and_gaps(bench):
    rig = bench("noise:=false", "K:=80.0", "seed:=3")
    reference = PulseStep(Settings()).next(3 * 2048)
    start = time.time()
    stamps = rig.send(start, reference[:2048])
    heard = rig.hear(2048)
    expected = simulate(
        reference[:2048],
        RATE,
        Model.of({"inertia": {}, "viscosity": {}, "stiffness": {"K": 80.0}, "reflex": {}}),
    ).clean
    assert rig.samples[0].columns == ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")
    assert np.array_equal(heard[:, 0], stamps)
    assert np.abs(heard[:, 1:] - expected).max() < 1e-9
    rig.until(
        lambda: len(rig.truth) == 64 and len(rig.joint) == 64,
        "truth and joint states of every block",
    )
    assert rig.truth[-1].columns == ("t[s]", "K[N.m/rad]", "G[N.m.s/rad]", "voluntary_torque[N.m]")
    assert rig.truth[-1].data[0].tolist() == [stamps[-1], 80.0, 10.0, 0.0]
    assert rig.joint[-1].name == ["ankle"]
    assert [rig.joint[-1].position[0], rig.joint[-1].velocity[0], rig.joint[-1].effort[0]] == heard[
        -1, 1:
    ].tolist()

    refused = rig.set("K", 5000.0)
    assert not refused.successful
    assert refused.reason == "parameter 'K' = 5000.0 N.m/rad is refused; allowed: 0 to 1000 N.m/rad"
    assert "at start only" in rig.set("omega", 30.0).reason
    for name, value in (("K", 150.0), ("G", 15.0), ("voluntary_torque.level", -5.0)):
        assert rig.set(name, value).successful
    # 320 samples are missing after the first second.
    second = stamps[-1] + 321 / RATE
    later = rig.send(second, reference[2368:4096])
    heard = rig.hear(2048 + len(later))[2048:]
    assert np.array_equal(heard[:, 0], later)
    rig.until(lambda: len(rig.truth) == 64 + 54, "truth of every block")
    assert rig.truth[-1].data[0, 1:].tolist() == [150.0, 15.0, -5.0]
    rig.until(
        lambda: any(
            "320 samples" in status.message for status in rig.health if status.name == "/ankle_sim"
        ),
        "the gap in the health",
    )

    described = rig.call(DescribeParameters, "describe_parameters", names=["G"]).descriptors[0]
    assert "N.m.s/rad" in described.description
    assert described.additional_constraints == "allowed: 0 to 100 N.m.s/rad"


def test_model_file_scenario_and_bad_blocks(bench, tmp_path):
    Model.of(
        {
            "inertia": {"I": 0.02},
            "viscosity": {},
            "stiffness": {"K": 61.0},
            "reflex": {"delay": 0.045},
            "maxwell_relaxation": {},
        }
    ).save(tmp_path / "model.yaml")
    (tmp_path / "script.yaml").write_text(
        "scenario: jump\nchanges:\n  - at[s]: 0.5\n    stiffness.K[N.m/rad]: 120\n"
    )
    rig = bench(f"model:={tmp_path}/model.yaml", f"scenario:={tmp_path}/script.yaml", "G:=3.0")
    values = rig.call(
        GetParameters, "get_parameters", names=["I", "delay", "G", "K", "maxwell_relaxation.k"]
    ).values
    assert [value.double_value for value in values] == [0.02, 0.045, 3.0, 61.0, 30.0]

    reference = PulseStep(Settings()).next(2048)
    start = time.time()
    stamps = rig.send(start, reference)
    rig.hear(2048)
    rig.until(lambda: len(rig.truth) == 32 * 2, "truth of every block")
    stiffness = np.array([block.data[0, 1] for block in rig.truth])
    at = np.array([block.data[0, 0] for block in rig.truth]) - start
    # ROS time in a double is good to 0.2 microseconds.
    assert np.array_equal(stiffness, np.where(at > 0.5 - 1e-6, 120.0, 61.0))
    assert "scripted by the scenario" in rig.set("K", 50.0).reason

    bad = reference[:32, :1]
    rig.send(stamps[-1] + 1 / RATE, bad, ("t[s]", "position[furlong]"))
    rig.until(
        lambda: any("furlong" in status.message for status in rig.health),
        "the bad unit in the health",
    )
    in_degrees = rig.send(
        stamps[-1] + 1 / RATE, np.degrees(reference[:64, :1]), ("t[s]", "position[deg]")
    )
    assert rig.hear(2048 + 64)[-1, 0] == in_degrees[-1]
