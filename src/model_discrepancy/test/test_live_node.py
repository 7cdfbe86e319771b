"""The watching node as a process of its own: a fixation that becomes soft is warned of, an
unchanged session is not.
"""

import signal
import subprocess
import sys
import time

import numpy as np
import pytest
import rclpy
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray

from ankle_interfaces.block import Block, pack
from ankle_node.node import BLOCK_QOS
from ankle_physics.model import Model
from ankle_physics.virtual_rig import simulate
from model_discrepancy.session_watch import RecentSamples, SessionWatch
from perturbation_generator.random_steps import RandomSteps
from perturbation_generator.settings import Settings

pytestmark = pytest.mark.live

RATE = 1024.0
WINDOW = 20.0  # s
COLUMNS = ("t[s]", "position[rad]", "velocity[rad/s]", "torque[N.m]")
PATIENCE = 90.0  # s
BASE = {"inertia": {}, "viscosity": {}, "stiffness": {}, "reflex": {}}


def session(soft, seconds=44.0):
    """Samples of shape (n, 4) whose fixation is soft in the second half, or not."""
    reference = RandomSteps(Settings(rate=RATE, amplitude=0.03, direction="both", seed=3)).next(
        int(seconds * RATE)
    )
    rigid = simulate(reference, RATE, Model.of(BASE), seed=1).measured
    samples = rigid
    if soft:
        loose = simulate(
            reference, RATE, Model.of({**BASE, "fixation_compliance": {}}), seed=1
        ).measured
        samples = np.concatenate([rigid[: len(rigid) // 2], loose[len(rigid) // 2 :]])
    return np.column_stack([np.arange(len(samples)) / RATE, samples])


def in_columns_of_the_watch(samples):
    return samples[:, [0, 1, 3, 2]]


class Bench:
    """A node process that is fed with blocks, and what it says."""

    def __init__(self):
        program = (
            "import sys; from model_discrepancy.model_discrepancy_node import main; "
            "sys.exit(main())"
        )
        parameters = ["-p", f"window:={WINDOW}", "-p", "period:=5.0"]
        self.process = subprocess.Popen(
            [sys.executable, "-c", program, "--ros-args", *parameters], stderr=subprocess.STDOUT
        )
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("bench", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.status = []
        self.node.create_subscription(
            DiagnosticArray, "/diagnostics", lambda m: self.status.extend(m.status), 64
        )
        self.publisher = self.node.create_publisher(Float64MultiArray, "/ankle/samples", BLOCK_QOS)
        self.until(lambda: self.publisher.get_subscription_count() > 0, "the node subscribes")

    def until(self, condition, what):
        deadline = time.monotonic() + PATIENCE
        while not condition():
            self.executor.spin_once(timeout_sec=0.05)
            assert self.process.poll() is None, "the node ended"
            assert time.monotonic() < deadline, f"not reached: {what}"

    def send(self, samples, size=256):
        for k in range(0, len(samples), size):
            self.publisher.publish(pack(Block(COLUMNS, samples[k : k + size])))
            self.executor.spin_once(timeout_sec=0.0)
            time.sleep(0.005)

    def counters(self):
        return {entry.key: entry.value for entry in self.status[-1].values} if self.status else {}

    def fits(self):
        return int(self.counters().get("fits", "0"))

    def close(self):
        self.process.send_signal(signal.SIGINT)
        try:
            code = self.process.wait(timeout=15)
        finally:
            self.process.kill()
            self.executor.shutdown()
            self.node.destroy_node()
            rclpy.shutdown(context=self.context)
        assert code == 0


@pytest.fixture
def bench():
    bench = Bench()
    yield bench
    bench.close()


def test_a_fixation_that_becomes_soft_is_warned_of(bench):
    samples = session(soft=True)
    half = len(samples) // 2
    bench.send(samples[:half])
    bench.until(lambda: bench.fits() >= 1, "the first fit")
    assert bench.counters()["state"] == "watching"
    assert float(bench.counters()["vaf_base[%]"]) > 90.0
    assert bench.status[-1].level == DiagnosticStatus.OK
    bench.send(samples[half:])
    bench.until(lambda: bench.status[-1].level == DiagnosticStatus.WARN, "the warning")
    message = bench.status[-1].message
    assert "at the start" in message
    assert "likely place" in message
    assert "coupling between footplate and foot" in message
    # Fitting held up no block, at fifty times real time.
    assert bench.counters()["ankle/samples missing samples"] == "0"


@pytest.mark.slow
def test_an_unchanged_session_stays_ok(bench):
    samples = session(soft=False)
    half = len(samples) // 2
    for part in (samples[:half], samples[half:]):
        before = bench.fits()
        bench.send(part)
        bench.until(lambda before=before: bench.fits() > before, "another fit")
    assert all(status.level == DiagnosticStatus.OK for status in bench.status)
    assert bench.counters()["state"] == "watching"


def test_a_broken_channel_is_no_reference_and_is_reported():
    watch = SessionWatch()
    samples = in_columns_of_the_watch(session(soft=False, seconds=WINDOW + 1.0))
    dead = samples.copy()
    dead[:, 2] = 0.0
    found = watch.judge(dead)
    assert watch.reference is None
    assert "dead" in watch.complaint(found, 5.0, 0.1)
    watch.judge(samples)
    assert watch.reference is not None


def test_the_window_is_full_before_it_is_given():
    recent = RecentSamples(2.0)
    time_ = np.arange(0.0, 5.0, 0.01)
    samples = np.column_stack([time_, time_, time_])
    recent.add(samples[:150])
    assert recent.snapshot() is None
    for k in range(150, 500, 50):
        recent.add(samples[k : k + 50])
    window = recent.snapshot()
    assert window[-1, 0] == samples[-1, 0]
    assert window[-1, 0] - window[0, 0] == pytest.approx(2.0, abs=0.025)
