"""Records the topics of the graph into a bag.

| topic | direction | type | what |
| --- | --- | --- | --- |
| every topic, or `topics` | in | any | stored as received, with its publishers' QoS |
| /diagnostics | out | DiagnosticArray | ready, messages, missing samples, free disk |
| TOPIC/_acknowledged | out | String | how far a replay may go on (see `ankle_node.node`) |

The log line ``ready: recording into PATH`` and ``ready`` = True in the diagnostics say that every
topic known so far is connected. The laboratory's topics are connected before they have a publisher,
so that no first block is lost; any other one when it appears. Log time is the time of reception, or
the simulated time under `use_sim_time`; publish time is the publisher's stamp. Parameters:
`session_recorder.parameters`. What is missing is counted by `session_recorder.loss`.
"""

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Sequence
from datetime import datetime

from rclpy.clock import Clock, ClockType

from ankle_interfaces.topics import JOINT_STATES, TOPICS
from ankle_node.node import BLOCK_QOS, ERROR, OK, WARN, AnkleNode, MessageInfo, run
from ankle_node.real_time import RECORDER_PRIORITY
from session_recorder.bag_writer import CHUNK_SECONDS
from session_recorder.errors import BagError
from session_recorder.parameters import RECORDER
from session_recorder.raw_subscriptions import RawSubscriptions
from session_recorder.recording import Recording
from session_recorder.rig_of_bag import RIG_KEY, rig_text
from session_recorder.ros_qos import to_record
from session_recorder.topic_choice import TopicChoice
from session_recorder.topic_discovery import TopicDiscovery

# Connected from the start, publisher or not.
LABORATORY_TOPICS = (*(topic for topic in TOPICS if topic.columns), JOINT_STATES)
DISCOVERY_PERIOD = 0.25  # s; how long a new topic waits for its subscription
SYNC_PERIOD = 2.0
"""[s] What a power cut may cost besides the last chunk: a disk that is busy takes 0.1 s for it."""
LONGEST_BACKLOG = 2.0
"""[s] Age of a message from which the recorder says that it falls behind: what waits is only in
memory."""


PARAMETERS = RECORDER


class RecordNode(AnkleNode):
    """Hands raw messages of its subscriptions to a `Recording`."""

    def __init__(self) -> None:
        super().__init__("recorder", PARAMETERS)
        named = [name.strip() for name in self.text("topics").split(",") if name.strip()]
        self._choice = TopicChoice(map(self.resolve_topic_name, named), self.get_namespace())
        self._inputs = RawSubscriptions(self, self._store)
        self._discovery = TopicDiscovery(self, self._choice, self._inputs, self._warn)
        self._ready = False
        self._simulated_time = bool(self.get_parameter("use_sim_time").value)
        self.failed = False
        self._behind = 0.0  # s, the oldest message since the last look
        if not self._simulated_time:
            self.take_priority_beside_a_rig(RECORDER_PRIORITY)
        self.recording: Recording | None = Recording(
            self.text("out") or f"session_{datetime.now():%Y%m%d_%H%M%S}"
        )
        if self.text("rig"):
            self.recording.bag.custom_data[RIG_KEY] = rig_text(self.text("rig"))
        if self.get_namespace() != "/":
            self.recording.bag.custom_data["namespace"] = self.get_namespace()
        for topic in LABORATORY_TOPICS:
            name = self.resolve_topic_name(topic.name)
            if not named or self._choice.wants(name):
                self._discovery.connect(name, topic.message, to_record([BLOCK_QOS]))
        steady = Clock(clock_type=ClockType.STEADY_TIME)
        self.create_timer(DISCOVERY_PERIOD, self._look_for_topics, clock=steady)
        self.create_timer(CHUNK_SECONDS / 2, self._keep_safe, clock=steady)
        self.count("ready", False)
        self._ended = threading.Event()
        self._syncing = threading.Thread(target=self._sync, name="sync", daemon=True)
        self._syncing.start()

    def _sync(self) -> None:
        """Bring the bag to the medium again and again, while others wait for no disk."""
        while not self._ended.wait(SYNC_PERIOD):
            if (recording := self.recording) is not None:
                recording.bag.sync()

    def _look_for_topics(self) -> None:
        if self.recording is None:
            return
        self._discovery.look(self.recording)
        if late := self._discovery.late:
            sentence = f"no publisher yet of {', '.join(late)}"
            self.health("topics", WARN, sentence)
            self.get_logger().warning(sentence, throttle_duration_sec=10.0)
        else:
            self.health("topics", OK, "")
        if not self._ready and self._discovery.settled:
            self._ready = True
            self.count("ready", True)
            self.get_logger().info(f"ready: recording into {self.recording.bag.path}")

    def _store(self, topic: str, message: bytes, info: MessageInfo) -> None:
        if self.recording is None:
            return
        name = self._choice.name_in_bag(topic)
        if name not in self.recording.bag.topics:
            self._discovery.add_to(self.recording, topic)
        received = (
            self.get_clock().now().nanoseconds
            if self._simulated_time
            else info["received_timestamp"] or time.time_ns()
        )
        self._behind = max(self._behind, 1e-9 * (time.time_ns() - info["received_timestamp"]))
        for sentence in self.recording.write(
            name,
            received,
            message,
            info["source_timestamp"] or None,
            info["publication_sequence_number"],
        ):
            self._warn(topic, sentence)

    def _warn(self, topic: str, sentence: str) -> None:
        self.get_logger().warning(f"{topic}: {sentence}", throttle_duration_sec=1.0)
        self.health(topic, WARN, sentence)

    def _keep_safe(self) -> None:
        """Flush what was received to the disk, and end in good order before the disk is full."""
        if self.recording is None:
            return
        self.recording.bag.flush()
        self._report_backlog()
        free = self.recording.free_space()
        for topic, sentence in self.recording.settle().items():
            self._warn(topic, sentence)
        for what, value in self.recording.figures().items():
            self.count(what, value)
        self.count("free disk [MB]", round(free))
        if free < self.number("min_free_disk"):
            sentence = (
                f"recording ended: {free:.0f} MB free on the disk of "
                f"{self.recording.bag.path}, below min_free_disk"
            )
            sentence += f" = {self.number('min_free_disk'):g} MB"
            self.health("disk", ERROR, sentence)
            self._publish_health()
            self.recording.note(sentence)
            self._close()
            raise BagError(sentence)

    def _report_backlog(self) -> None:
        behind, self._behind = self._behind, 0.0
        self.count("behind [s]", f"{behind:.2f}")
        if behind > LONGEST_BACKLOG:
            sentence = (
                f"{behind:.1f} s behind: messages wait in memory for this process, because the "
                "computer is too busy"
            )
            self.health("backlog", WARN, sentence)
            self.get_logger().warning(sentence, throttle_duration_sec=10.0)

    def _close(self) -> None:
        recording, self.recording = self.recording, None
        if recording is not None:
            recording.close()
            print(recording.summary(), flush=True)

    def destroy_node(self) -> None:
        """Finish the bag first."""
        self._ended.set()
        absent = self._discovery.never_published if self.recording is not None else []
        try:
            self._close()
            if absent:
                raise BagError(f"nobody published {', '.join(absent)} during the recording")
        except BagError as error:
            self.failed = True
            print(f"error: {error}", file=sys.stderr, flush=True)
        super().destroy_node()


def main(arguments: Sequence[str] | None = None) -> int:
    """Start the node: the entry point of `ros2 run session_recorder record`; 1 after an error."""
    made: list[RecordNode] = []

    def make() -> RecordNode:
        made.append(RecordNode())
        return made[0]

    return run(make, arguments) or int(any(node.failed for node in made))


if __name__ == "__main__":
    sys.exit(main())
