"""`estimate` as a user calls it."""

import subprocess
import sys

import numpy as np
import pytest

from ankle_interfaces.block import Block
from session_recorder.bag_reader import BagReader
from session_recorder.bag_writer import BagWriter

COLUMNS = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")
PROGRAM = "from impedance_estimator.command_line import main; main()"


def call(*arguments):
    return subprocess.run(
        [sys.executable, "-c", PROGRAM, *map(str, arguments)],
        capture_output=True,
        text=True,
        timeout=200,
    )


@pytest.fixture
def bag(minute, tmp_path):
    samples = minute.samples()
    with BagWriter(tmp_path / "session") as writer:
        writer.add_topic("/ankle/samples")
        for k in range(0, len(samples), 1024):
            writer.write_block(
                "/ankle/samples", Block(COLUMNS, np.ascontiguousarray(samples[k : k + 1024]))
            )
    return tmp_path / "session"


def test_bag_in_table_and_bag_out(bag, tmp_path):
    done = call(bag, "--out", tmp_path / "impedance", "--algorithm", "CE", "--highpass", "all")
    assert done.returncode == 0, done.stderr
    assert "K[N.m/rad]" in done.stdout
    assert "I[kg.m^2]" in done.stdout
    _, rows = BagReader(tmp_path / "impedance").signal("/impedance/estimate")
    assert rows[-1, 1] == pytest.approx(100.0, rel=0.05)
    again = call(bag, "--out", tmp_path / "impedance")
    assert again.returncode == 1
    assert "is there already" in again.stderr


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("nowhere",), "no bag at nowhere"),
        (("nowhere", "--algorithm", "XY"), "algorithm 'XY' is not known; allowed: CE"),
        (("nowhere", "--algorithm", "CE", "--highpass", "none"), "'highpass' = 'none' is refused"),
        (("nowhere", "--highpass", "all"), "algorithm 'simultaneous' has no --highpass"),
    ],
)
def test_bad_input_is_one_line(arguments, words):
    done = call(*arguments)
    assert done.returncode == 1
    assert words in done.stderr
    assert "Traceback" not in done.stderr
