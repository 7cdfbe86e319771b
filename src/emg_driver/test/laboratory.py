"""EMG nodes as processes of their own, and a test that perturbs, measures and listens."""

import signal
import subprocess
import sys
import time

import numpy as np
import rclpy
from diagnostic_msgs.msg import DiagnosticArray
from rclpy.executors import SingleThreadedExecutor
from std_msgs.msg import Float64MultiArray, String

from ankle_interfaces.block import Block, pack, unpack
from ankle_node.acknowledgement import ACKNOWLEDGEMENT_SUFFIX, GREETING
from ankle_node.qos import BLOCK_QOS, LATEST_QOS, PUBLISHED_BLOCKS_QOS
from emg_driver.muscles import RESPONSE_TOPIC, SAMPLE_COLUMNS, SAMPLES_TOPIC
from perturbation_generator.pulse_step import PulseStep
from perturbation_generator.settings import Settings as PerturbationSettings

RATE, SIZE = 2048, 32
PATIENCE = 60.0  # s
MADE = "/emg/made"


def node_process(name, *arguments, **pipes):
    program = f"import sys; from emg_driver.{name}_node import main; sys.exit(main())"
    return subprocess.Popen([sys.executable, "-c", program, "--ros-args", *arguments], **pipes)


class Laboratory:
    """Publishes the reference and EMG: noise of 20 uV, three times as much 40 to 60 ms after the
    stretch of each muscle.

    Parameters
    ----------
    emg_topic
        Where the EMG goes.
    plate
        Whether the measured velocity of a plate that follows at once is published, too.
    """

    def __init__(self, emg_topic, plate=False):
        self.nodes = {}
        self.context = rclpy.Context()
        rclpy.init(context=self.context)
        self.node = rclpy.create_node("laboratory", context=self.context)
        self.executor = SingleThreadedExecutor(context=self.context)
        self.executor.add_node(self.node)
        self.blocks = {SAMPLES_TOPIC: [], RESPONSE_TOPIC: []}
        self.health = []
        self.node.create_subscription(DiagnosticArray, "/diagnostics", self._take_health, 64)
        self.reference = self.node.create_publisher(
            Float64MultiArray, "/perturbation/reference", BLOCK_QOS
        )
        self.emg = self.node.create_publisher(Float64MultiArray, emg_topic, BLOCK_QOS)
        self.plate = (
            self.node.create_publisher(Float64MultiArray, "/ankle/samples", BLOCK_QOS)
            if plate
            else None
        )
        # Before a reader has found a topic's publisher it gets nothing that is sent on it.
        self.processed = dict.fromkeys(("/perturbation/reference", emg_topic), -1)
        for topic in self.processed:
            self.node.create_subscription(
                String,
                topic + ACKNOWLEDGEMENT_SUFFIX,
                lambda message, topic=topic: self.processed.update(
                    {topic: int(message.data.split()[-1])}
                ),
                LATEST_QOS,
            )
        self.signal = PulseStep(PerturbationSettings(rate=RATE, seed=4))
        self.random = np.random.default_rng(1)
        self.sent, self.velocity = [], []
        self.newest = 0  # ns, before the newest block was sent

    def start(self, name, *arguments):
        self.nodes[name] = node_process(
            name, *arguments, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )

    def listen(self, topic):
        into = self.blocks[topic]
        self.node.create_subscription(
            Float64MultiArray,
            topic,
            lambda m: into.append(unpack(m)),
            PUBLISHED_BLOCKS_QOS,
            raw=True,
        )

    def _take_health(self, message):
        self.health += [
            (time.monotonic(), status.name.lstrip("/"), status.message) for status in message.status
        ]

    def reported(self, node, words, since=0.0):
        """What a node first said with these words on /diagnostics after a time of the steady clock
        [s].
        """
        return next(
            (
                text
                for when, name, text in self.health
                if when > since and name == node and words in text
            ),
            None,
        )

    def data(self, topic):
        return np.concatenate([block.data for block in self.blocks[topic]])

    def until(self, condition, what):
        deadline = time.monotonic() + PATIENCE
        while not condition():
            self.executor.spin_once(timeout_sec=0.02)
            assert time.monotonic() < deadline, (
                f"not reached: {what}; /diagnostics: {self.health[-3:]}"
            )

    def until_read(self):
        """Wait until the one reader of reference and EMG has found their publishers."""
        self.until(lambda: min(self.processed.values()) >= GREETING, "readers")

    def until_processed(self):
        """Wait until the one reader of reference and EMG has processed all that was sent.

        Responses do not tell: none comes before the plate's motion could have.
        """
        self.until(lambda: min(self.processed.values()) >= self.newest, "all blocks are processed")

    def publish(self, begin):
        """The next block of reference, plate and EMG, the first sample at `begin` [s]."""
        at = (len(self.sent) * SIZE + np.arange(SIZE)) / RATE
        position = self.signal.next(SIZE)[:, 0]
        emg = 20e-6 * self.random.standard_normal((SIZE, 4))
        for onset in self.signal.onsets():
            stretched = [0, 2, 3] if onset.direction > 0 else [1]
            emg[np.ix_((at >= onset.time + 0.040) & (at < onset.time + 0.060), stretched)] *= 3.0
        time_ = begin + np.arange(SIZE) / RATE
        before = self.sent[-1][-1, 1] if self.sent else position[0]
        velocity = np.diff(position, prepend=before) * RATE
        self.newest = time.time_ns()
        self.reference.publish(
            pack(Block(("t[s]", "position[rad]"), np.column_stack([time_, position])))
        )
        if self.plate is not None:
            self.plate.publish(
                pack(Block(("t[s]", "velocity[rad/s]"), np.column_stack([time_, velocity])))
            )
        self.emg.publish(pack(Block(SAMPLE_COLUMNS, np.column_stack([time_, emg]))))
        self.sent.append(np.column_stack([time_, position, emg]))
        self.velocity.append(velocity)

    def run(self, seconds):
        """Perturb and measure in real time."""
        begin, first = time.time(), time.monotonic()
        for k in range(round(seconds * RATE / SIZE)):
            while time.monotonic() < first + (k + 1) * SIZE / RATE:
                self.executor.spin_once(timeout_sec=0.002)
            self.publish(begin + k * SIZE / RATE)

    def close(self):
        """Exit codes by node."""
        try:
            for process in self.nodes.values():
                process.send_signal(signal.SIGINT)
            return {name: process.wait(timeout=30) for name, process in self.nodes.items()}
        finally:
            for process in self.nodes.values():
                process.kill()
            self.executor.shutdown()
            self.node.destroy_node()
            rclpy.shutdown(context=self.context)
