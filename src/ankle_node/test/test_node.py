"""Parameters, blocks and stopping of the base node, in a real rclpy process."""

import os
import signal
import subprocess
import sys
import time

import pytest

from ankle_interfaces.errors import QuantityError
from ankle_interfaces.quantity import Quantity
from ankle_node.given_parameters import check_given, shared_names

pytestmark = [pytest.mark.live, pytest.mark.untimed]

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


def test_a_node_loads_what_it_has_dumped_and_refuses_what_is_fixed_or_unknown():
    program = PROGRAM[: PROGRAM.index("        for name, value in")] + LOADS
    process = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, timeout=60
    )
    dumped, read_only, *refused = process.stdout.strip().splitlines()
    assert dumped == "[True, True, True, True, True]", process.stderr
    assert read_only == "[False, True, False]"
    assert refused == [
        "parameter 'seed' can be set at start only",
        "parameter 'use_sim_time' can be set at start only",
        "parameter 'amplitud' is unknown; did you mean 'amplitude'?",
        "parameter 'mass' is unknown; known: amplitude, seed, shape",
    ]


LOADS = """
        names = ["amplitude", "seed", "shape"]
        mine = [*names, "use_sim_time", "start_type_description_service"]
        dump = [R(name, value=self.get_parameter(name).value) for name in mine]
        print([result.successful for result in self.set_parameters(dump)])
        print([self.describe_parameter(name).read_only for name in names])
        wrong = (("seed", 2), ("use_sim_time", True), ("amplitud", 0.05), ("mass", 1.0))
        for name, value in wrong:
            print(self.set_parameters([R(name, value=value)])[0].reason, flush=True)
        raise SystemExit
sys.exit(run(N))
"""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--amplitude", "0.05"), "error: argument '--amplitude' is unknown; "),
        (("--ros-args", "-p", "amplitude"), "error: Failed to parse ROS arguments: "),
    ],
)
def test_an_argument_that_no_node_has_ends_with_one_line(arguments, words):
    process = subprocess.run(
        [sys.executable, "-c", PROGRAM, *arguments], capture_output=True, text=True, timeout=30
    )
    assert process.returncode == 1
    (line,) = process.stderr.splitlines()
    assert line.startswith(words)


def test_a_typing_error_at_the_start_is_refused_and_what_is_of_other_nodes_is_named(tmp_path):
    process = start("amplitud:=0.05")
    _, error = process.communicate(timeout=30)
    assert process.returncode == 1
    assert "parameter 'amplitud' is unknown; did you mean 'amplitude'?" in error
    shared = tmp_path / "shared.yaml"
    shared.write_text("/**: {ros__parameters: {seed: 3, protocol: van_t_veld_2018}}")
    arguments = [sys.executable, "-c", PROGRAM, "--ros-args", "--params-file", str(shared)]
    process = subprocess.Popen(arguments, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    lines = [process.stdout.readline() for _ in range(6)]
    process.send_signal(signal.SIGINT)
    _, error = process.communicate(timeout=30)
    assert process.returncode == 0
    assert "accepted" in lines[1]
    assert "parameter 'protocol' is unknown; known: amplitude, seed, shape; it is ignored" in error


@pytest.mark.parametrize(
    ("content", "named"),
    [
        ("probe: {ros__parameters: {nobody: 3}}", True),
        ("/: {probe: {ros__parameters: {nobody: 3}}}", True),
        ("/*/probe: {ros__parameters: {nobody: 3}}", True),
        ("/**: {ros__parameters: {nobody: 3}}", False),
        ("/**: {ros__parameters: {nobody: 3}}\nprobe: {ros__parameters: {nobody: 3}}", True),
        ("/**: {ros__parameters: {nobody: 3}}\nother: {ros__parameters: {nobody: 3}}", False),
    ],
)
def test_what_a_file_gives_to_this_node_is_refused_and_what_it_gives_to_all_is_named(
    tmp_path, content, named
):
    file = tmp_path / "parameters.yaml"
    file.write_text(content)
    shared = shared_names(["--ros-args", "--params-file", str(file)], "probe")
    declared = {"seed": Quantity("seed", "1", 0, 10, 1, description="Seed.")}
    if named:
        with pytest.raises(QuantityError, match="'nobody' is unknown; known: seed"):
            check_given(["nobody"], declared, shared)
    else:
        assert check_given(["nobody"], declared, shared) == [
            "parameter 'nobody' is unknown; known: seed; it is ignored"
        ]


def test_what_the_command_line_gives_is_for_this_node(tmp_path):
    file = tmp_path / "parameters.yaml"
    file.write_text("/**: {ros__parameters: {nobody: 3, check: {somebody: 1}}}")
    arguments = ["--ros-args", "--params-file", str(file), "-p"]
    assert shared_names([*arguments, "nobody:=4"], "probe") == {"check.somebody"}
    assert shared_names([*arguments, "probe:nobody:=4"], "probe") == {"check.somebody"}


SLOW = """
import sys, time
from ankle_node.node import AnkleNode, run
class N(AnkleNode):
    def __init__(self):
        super().__init__("slow", [])
        print("starting", flush=True)
        for _ in range(6000):  # as a compilation: long, in steps that Python cannot interrupt
            time.sleep(0.01)
sys.exit(run(N))
"""


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_node_that_is_still_starting_ends_at_once(number):
    process = subprocess.Popen(
        [sys.executable, "-c", SLOW], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout.readline() == "starting\n"
        began = time.monotonic()
        process.send_signal(number)
        _, error = process.communicate(timeout=30)
    finally:
        process.kill()
    assert process.returncode == 0
    assert "Traceback" not in error
    assert time.monotonic() - began < 20.0  # instead of a minute; the limit is for a busy machine


SECOND_SIGNAL = """
import signal, sys
from ankle_node.running import StopSignal
stop = StopSignal()
stop.starting = False
left = [20]
def trace(frame, event, argument):
    if left[0]:
        left[0] -= 1
        signal.raise_signal(signal.SIGTERM)
    return trace
sys.settrace(trace)
signal.raise_signal(signal.SIGINT)
sys.settrace(None)
sys.exit(0 if stop.received else 3)
"""


def test_a_second_signal_in_the_middle_of_the_first_does_not_hang_the_node():
    """A parent that is killed sends one, and somebody else sends another."""
    assert subprocess.run([sys.executable, "-c", SECOND_SIGNAL], timeout=120).returncode == 0
