"""Driver, emulator and generator as processes of their own, over UDP and DDS."""

import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
from lifecycle_msgs.srv import ChangeState, GetState
from rcl_interfaces.msg import Parameter, ParameterType, ParameterValue
from rcl_interfaces.srv import SetParameters
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray, String
from std_srvs.srv import Trigger

from ankle_interfaces.block import unpack
from ankle_interfaces.continuity import Continuity
from ankle_interfaces.errors import QuantityError
from ankle_node.node import BLOCK_QOS, LATEST_QOS
from rig_emulator.fault_switches import switch_faults

PATIENCE = (
    240.0  # s; the first start compiles, and a busy machine takes a minute to start a process
)
pytestmark = [pytest.mark.live, pytest.mark.timeout(1500)]
DRIVER = "ankle_actuator_driver.ankle_actuator_driver_node"
EMULATOR = "rig_emulator.rig_emulator_node"
GENERATOR = "perturbation_generator.perturbation_generator_node"


def free_port():
    """A UDP port whose next one is free too."""
    while True:
        with (
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as first,
            socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as second,
        ):
            first.bind(("127.0.0.1", 0))
            port = first.getsockname()[1]
            try:
                second.bind(("127.0.0.1", port + 1))
            except (OSError, OverflowError):
                continue
            return port


class Bench:
    """Starts processes, hears the driver's topics, calls its services."""

    def __init__(self, folder):
        self.folder, self.processes, self.clients = folder, {}, {}
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("bench", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.blocks, self.states, self.continuity, self.findings = [], [], Continuity(), []
        self.node.create_subscription(
            Float64MultiArray, "/ankle/samples", self._samples, BLOCK_QOS, raw=True
        )
        self.node.create_subscription(
            String, "/rig/state", lambda message: self.states.append(message.data), LATEST_QOS
        )

    def _samples(self, message):
        block = unpack(message)
        self.blocks.append(block)
        self.findings += self.continuity.check(block.data)

    def start(self, module, *parameters):
        arguments = [
            sys.executable,
            "-c",
            f"import sys; from {module} import main; sys.exit(main())",
            "--ros-args",
        ]
        for parameter in parameters:
            arguments += ["-p", parameter]
        with open(self.folder / f"{module}.log", "ab") as log:
            self.processes[module] = subprocess.Popen(
                arguments, stdout=log, stderr=subprocess.STDOUT
            )

    def log(self, module):
        return (self.folder / f"{module}.log").read_text()

    def logs(self):
        return "\n".join(
            f"{path.name}: {path.read_text()[-1500:]}" for path in sorted(self.folder.glob("*.log"))
        )

    def until(self, condition, what, seconds=PATIENCE):
        deadline = time.monotonic() + seconds
        while not condition():
            self.executor.spin_once(timeout_sec=0.02)
            for module, process in self.processes.items():
                assert process.poll() is None, f"{module} ended: {self.log(module)}"
            assert time.monotonic() < deadline, f"not reached: {what}; {self.states}; {self.logs()}"

    def reaches(self, state):
        self.until(lambda: self.state == state, state)

    def call(self, kind, service, **fields):
        if service not in self.clients:
            self.clients[service] = self.node.create_client(
                kind, f"/ankle_actuator_driver/{service}"
            )
        client = self.clients[service]
        self.until(client.service_is_ready, service)
        # A first answer can be lost while the two ends still discover each other.
        for _ in range(5):
            future = client.call_async(kind.Request(**fields))
            deadline = time.monotonic() + PATIENCE / 5
            self.until(lambda: future.done() or time.monotonic() > deadline, service)  # noqa: B023
            if future.done():
                return future.result()
        raise AssertionError(f"no answer from {service}")

    def operate(self, name):
        return self.call(Trigger, name)

    @property
    def state(self):
        return self.states[-1].split(":")[0] if self.states else ""

    def run_the_rig(self, least=0.03):
        """Reset, arm and start until the plate has moved over so many rad in one go: a machine that
        keeps a process waiting for 100 ms stops the rig, and the operator begins again."""
        deadline = time.monotonic() + 2 * PATIENCE
        first = len(self.blocks)
        while time.monotonic() < deadline:
            if self.state == "running":
                heard = self.blocks[first:]
                if (
                    heard
                    and np.ptp(np.concatenate([block.column("position[rad]") for block in heard]))
                    > least
                ):
                    return
            else:
                command = {"fault": "reset_fault", "ready": "arm", "armed": "start"}.get(self.state)
                if command:
                    self.operate(command)
                first = len(self.blocks)
            self.executor.spin_once(timeout_sec=0.05)
        raise AssertionError(f"the plate does not move; {self.states}; {self.logs()}")

    def set(self, name, value):
        wanted = ParameterValue(type=ParameterType.PARAMETER_DOUBLE, double_value=value)
        return self.call(
            SetParameters, "set_parameters", parameters=[Parameter(name=name, value=wanted)]
        ).results[0]

    def end(self):
        """Tell the processes to stop; their exit codes."""
        codes = {}
        for process in self.processes.values():
            process.send_signal(signal.SIGINT)
        for module, process in self.processes.items():
            try:
                codes[module] = process.wait(timeout=20)
            except subprocess.TimeoutExpired:
                process.kill()
                codes[module] = process.wait()
        self.processes.clear()
        return codes

    def close(self):
        self.end()
        self.executor.shutdown()
        self.node.destroy_node()
        rclpy.shutdown(context=self.context)


@pytest.fixture
def bench(tmp_path):
    one = Bench(tmp_path)
    try:
        yield one
    finally:
        one.close()


def test_a_session_with_its_faults(bench):
    port = free_port()
    # A busy machine delays processes by more than the 0.1 s that the graph gives.
    bench.start(EMULATOR, f"port:={port}", "noise:=false")
    bench.start(
        DRIVER, f"rig_port:={port}", "autostart:=true", "soft_start:=0.5", "wait_for_readers:=1"
    )
    bench.start(GENERATOR, "lead:=0.6", "wait_for_readers:=1")
    bench.reaches("ready")
    assert bench.call(GetState, "get_state").current_state.label == "active"
    refused = bench.operate("start")
    assert not refused.success
    assert refused.message.startswith("start is refused: the driver is ")

    bench.run_the_rig()
    assert bench.blocks[-1].columns == ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")
    assert abs(bench.blocks[-1].time[-1] - time.time()) < 5.0
    torque = np.concatenate([block.column("torque[N.m]") for block in bench.blocks])
    assert np.ptp(torque) > 3.0  # to accelerate, damp and hold the simulated ankle

    passed = bench.set("angle_limit", 0.3)
    assert not passed.successful
    assert "'angle_limit' = 0.3 rad passes the hard limit of 0.175 rad" in passed.reason
    assert "at start only" in bench.set("hard_angle_limit", 0.3).reason
    assert bench.set("angle_limit", 0.1).successful

    stopped = "stopping: stopped by the operator"
    for _ in range(5):
        bench.run_the_rig()
        assert bench.operate("stop").success
        bench.until(lambda: bench.state in ("ready", "disabled", "fault"), "the plate rests")
        if stopped in bench.states:
            break
    assert stopped in bench.states

    bench.run_the_rig()
    assert switch_faults("emergency_stop=1", "127.0.0.1", port) == "emergency_stop=1"
    bench.reaches("fault")
    bench.until(
        lambda: "pressed" in bench.operate("reset_fault").message, "the pressed button is known"
    )
    assert not bench.operate("arm").success
    with pytest.raises(QuantityError, match="unknown"):
        switch_faults("explode=1", "127.0.0.1", port)
    assert switch_faults("emergency_stop=0", "127.0.0.1", port) == "none"

    bench.run_the_rig()
    driver = bench.processes.pop(DRIVER)
    driver.kill()
    driver.wait()
    last = ("fault, fault: heartbeat_lost", "off, fault")
    bench.until(
        lambda: any(word in bench.log(EMULATOR).strip().splitlines()[-1] for word in last),
        "the rig stops by itself",
    )


def test_life_cycle_services_and_a_rig_that_is_not_there(bench):
    bench.start(DRIVER, f"rig_port:={free_port()}")
    assert bench.call(GetState, "get_state").current_state.label == "unconfigured"
    assert "not configured" in bench.operate("arm").message
    assert bench.operate("stop").success
    for transition, label in ((1, "inactive"), (3, "active"), (4, "inactive"), (2, "unconfigured")):
        request = {"transition": ChangeState.Request().transition}
        request["transition"].id = transition
        assert bench.call(ChangeState, "change_state", **request).success
        assert bench.call(GetState, "get_state").current_state.label == label
        if label == "active":
            answer = bench.operate("arm")
            assert answer.message == "arm is refused: the driver is disabled (no rig was heard yet)"
    assert bench.end()[DRIVER] == 0
