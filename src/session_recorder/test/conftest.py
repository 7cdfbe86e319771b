"""Bags, graphs and processes for the tests of this package."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

from ankle_interfaces.block import Block
from session_recorder.bag_writer import BagWriter

RATE = 2048
SAMPLES = ("t[s]", "position[rad]", "torque[N.m]")


def make_block(number, columns=SAMPLES, start=1000.0, size=32):
    t = start + (number * size + np.arange(size)) / RATE
    return Block(
        columns, np.column_stack([t, *(np.sin((k + 2) * t) for k in range(len(columns) - 1))])
    )


@pytest.fixture
def block():
    return make_block


@pytest.fixture
def make_bag(tmp_path):
    """A bag of n blocks on two topics, in chunks of a few blocks."""

    def make(name="bag", blocks=100, chunk_blocks=10):
        with BagWriter(tmp_path / name) as writer:
            writer.add_topic("/ankle/samples")
            writer.add_topic("/perturbation/reference")
            for number in range(blocks):
                writer.write_block("/ankle/samples", make_block(number))
                writer.write_block(
                    "/perturbation/reference", make_block(number, ("t[s]", "position[rad]"))
                )
                if number % chunk_blocks == chunk_blocks - 1:
                    writer.flush()
        return tmp_path / name

    return make


class Graph:
    """Processes in the tests' own ROS domain, each with a hard end."""

    def __init__(self):
        self.environment = {
            **os.environ,
            "PYTHONUNBUFFERED": "1",
        }
        self.processes = []

    def start(self, *arguments):
        process = subprocess.Popen(
            [sys.executable, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env=self.environment,
        )
        self.processes.append(process)
        return process

    def node(self, module, parameters, *more):
        arguments = ["-m", f"session_recorder.{module}", "--ros-args"]
        for name, value in parameters.items():
            arguments += ["-p", f"{name}:={value}"]
        return self.start(*arguments, *more)

    def wait_for_line(self, process, words, limit=30.0):
        seen = []
        deadline = time.monotonic() + limit
        while time.monotonic() < deadline and (line := process.stdout.readline()):
            seen.append(line)
            if words in line:
                return line
        raise AssertionError(f"'{words}' did not come; got: {''.join(seen)}")

    def stop(self, process, number=signal.SIGINT, limit=15.0):
        if process.poll() is None:
            process.send_signal(number)
        output, _ = process.communicate(timeout=limit)
        return output


@pytest.fixture
def graph():
    running = Graph()
    yield running
    for process in running.processes:
        if process.poll() is None:
            process.kill()
        process.wait(timeout=10)
        process.stdout.close()
