"""Parameters, blocks and stopping of the base node, in a real rclpy process."""

import os
import signal
import subprocess
import sys
import time

import pytest

pytestmark = pytest.mark.live

PROGRAM = """
import sys
from ankle_node.node import AnkleNode, run
from ankle_interfaces.quantity import Quantity
P = [
    Quantity("amplitude", "rad", 0.001, 0.1, 0.03, description="Step size."),
    Quantity("seed", "1", 0, 10, 1, description="Seed.", start_only=True),
    Quantity("shape", default="block", description="Shape.", choices=("block", "polynomial")),
]
class N(AnkleNode):
    def __init__(self):
        super().__init__("probe", P)
        from rclpy.parameter import Parameter as R
        for name, value in (("amplitude", 0.2), ("amplitude", 0.05), ("seed", 2), ("shape", "saw")):
            print(self.set_parameters([R(name, value=value)])[0].reason or "accepted")
        d = self.describe_parameters(["amplitude"])[0]
        print(d.description, d.floating_point_range[0].to_value, d.additional_constraints)
        print(self.set_parameters([R("amplitude", value=0.3)])[0].reason, flush=True)
sys.exit(run(N))
"""


def start(*parameters):
    arguments = [sys.executable, "-c", PROGRAM, "--ros-args"]
    for parameter in parameters:
        arguments += ["-p", parameter]
    return subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)


@pytest.mark.parametrize(
    ("assignment", "words"),
    [
        ("amplitude:=1", "'amplitude' = 1 rad is refused; allowed: 0.001 to 0.1 rad"),
        ("seed:=1.5", "'seed' = 1.5 is refused; allowed: whole number 0 to 10"),
        ("shape:=saw", "'shape' = 'saw' is refused; allowed: one of block, polynomial"),
        ("amplitude:=text", "'amplitude' = 'text' is refused"),
    ],
)
def test_bad_start_value_ends_with_one_line(assignment, words):
    process = start(assignment)
    _, error = process.communicate(timeout=30)
    assert process.returncode == 1
    assert words in error
    assert "Traceback" not in error


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_values_at_run_time_and_stop_by_signal(number):
    process = start("amplitude:=0.08")
    try:
        lines = [process.stdout.readline().strip() for _ in range(6)]
        time.sleep(0.3)
        os.kill(process.pid, number)
        assert process.wait(timeout=10) == 0
    finally:
        process.kill()
    assert "allowed: 0.001 to 0.1 rad" in lines[0]
    assert lines[1] == "accepted"
    assert "at start only" in lines[2]
    assert "one of block, polynomial" in lines[3]
    assert lines[4] == "Step size. [rad] 0.1 allowed: 0.001 to 0.1 rad"
    assert "'amplitude' = 0.3 rad is refused" in lines[5]
