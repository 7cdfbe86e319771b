"""Parameters, blocks and stopping of the base node, in a real rclpy process."""

import os
import signal
import subprocess
import sys
import time

import pytest

from ankle_node.parameters import Parameter, ParameterError

pytestmark = pytest.mark.live

PROGRAM = """
import sys
from ankle_node.node import AnkleNode, run
from ankle_node.parameters import Parameter
P = [Parameter("amplitude", 0.03, "rad", "Step size.", 0.001, 0.1), Parameter("seed", 1, "1", "Seed.", 0, 10, fixed=True),
     Parameter("shape", "block", "", "Shape.", choices=("block", "polynomial"))]
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
"""  # noqa: E501


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


def test_check_keeps_types_apart():
    assert Parameter("x", 1.0, "s", "", 0, 2).check(2) == 2.0
    for declared, value in (
        (Parameter("x", 1.0, "s", "", 0, 2), True),
        (Parameter("x", True, "", ""), 1),
        (Parameter("x", 1.0, "s", ""), float("nan")),
    ):
        with pytest.raises(ParameterError):
            declared.check(value)
