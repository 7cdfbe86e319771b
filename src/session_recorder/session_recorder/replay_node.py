"""Replays a bag to the graph.

| topic | direction | type | what |
| --- | --- | --- | --- |
| the recorded inputs, or those of `topics` | out | as recorded | as recorded, with the recorded QoS |
| /clock | out | Clock | the log time of what is sent, never backwards |
| TOPIC/_acknowledged | in | String | how far each reader of blocks has got |
| /diagnostics | out | DiagnosticArray | messages sent, delay |

Parameters: `session_recorder.parameters`. Rename topics with ROS's own remapping (``-r
/ankle/samples:=/old/samples``). At any `rate` at most `flow_control.WINDOW` blocks of a topic are
ahead of the slowest reader made by `AnkleNode.block_subscription`, so that nothing is lost; of
other readers DDS reports only that their queue has the message, so give them a rate that they follow.
Ends with 0 when every reader acknowledged everything.
"""  # noqa: E501

from __future__ import annotations

import sys
import threading
import time
from collections.abc import Sequence

from rclpy.clock import Clock, ClockType
from rclpy.executors import ExternalShutdownException

from ankle_node.node import WARN, AnkleNode, run
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError
from session_recorder.graph_outlet import POLL_PERIOD, GraphOutlet
from session_recorder.parameters import REPLAYER
from session_recorder.replaying import Replay, choose_topics

PROGRESS_PERIOD = 2.0  # s
# s in which both ends of a connection find each other (localhost: a few ms; longer on a busy
# machine)
SETTLING = 1.0
# s; a reader that reports how far it is may not be known as such yet: Fast DDS announces again,
# after 3 s, what was lost on the way.
SILENT_SETTLING = 4.0
REPORTED_DELAY = 0.5  # s behind the asked rate before it is reported


PARAMETERS = REPLAYER


class ReplayNode(AnkleNode):
    """Sends a bag from a thread of its own, while the executor hears how far the readers are."""

    def __init__(self) -> None:
        super().__init__("replayer", PARAMETERS)
        if not self.text("bag"):
            raise BagError("parameter 'bag' is missing: the bag to replay")
        self._reader = BagReader(self.text("bag"))
        for problem in self._reader.problems:
            self._warn(problem)
        chosen = choose_topics(self._reader, self.text("topics"))
        self._outlet = GraphOutlet(self, self._reader, chosen)
        self._replay = Replay(
            self._reader,
            chosen,
            self.number("rate"),
            self._outlet.flows,
            self._outlet,
            self.number("reader_timeout"),
            self.context.ok,
        )
        self.error: str | None = None
        self.finished = False
        self._shown = time.monotonic()
        self._thread = threading.Thread(target=self._run, name="replay", daemon=True)
        self._thread.start()
        self.create_timer(POLL_PERIOD, self._watch, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def _run(self) -> None:
        try:
            self._wait_for_readers()
            self.finished = self._replay.run()
        except Exception as error:  # the thread must not end unheard
            if self.context.ok():
                self.error = (
                    str(error)
                    if isinstance(error, BagError)
                    else f"{type(error).__name__}: {error}"
                )

    def _wait_for_readers(self) -> None:
        needed, patience = int(self.number("wait_for_readers")), self.number("wait_timeout")
        deadline = time.monotonic() + patience
        before, since = None, time.monotonic()
        while self.context.ok():
            state = self._outlet.connections()
            nodes = state.nodes
            if state != before or state.open_links or len(nodes) < needed:
                before, since = state, time.monotonic()
            elif time.monotonic() - since > (SILENT_SETTLING if state.silent else SETTLING):
                break
            if time.monotonic() > deadline:
                names = ", ".join(sorted(nodes)) or "none"
                raise BagError(
                    f"{len(nodes)} of {needed} readers (wait_for_readers) connected within "
                    f"{patience:g} s: {names}"
                )
            time.sleep(POLL_PERIOD)
        self._outlet.refuse_second_source()
        for sentence in self._outlet.settle():
            self._warn(sentence)

    def _warn(self, sentence: str) -> None:
        self.get_logger().warning(sentence)
        self.health("replay", WARN, sentence)

    def _watch(self) -> None:
        self.count("messages sent", self._replay.sent)
        if self._replay.behind > REPORTED_DELAY:
            self.health(
                "pace",
                WARN,
                f"up to {self._replay.behind:.1f} s late: the readers do not follow at this rate",
            )
        self._outlet.refuse_second_source()
        if time.monotonic() - self._shown > PROGRESS_PERIOD:
            self._shown = time.monotonic()
            self.get_logger().info(
                f"replayed {self._replay.elapsed:.1f} of {self._reader.duration:.1f} s"
            )
        if not self._thread.is_alive():
            if self.error is not None:
                raise BagError(self.error)
            if self.finished:
                print(
                    f"replayed {self._replay.sent} messages of {self._reader.path}, every one "
                    "acknowledged",
                    flush=True,
                )
            raise ExternalShutdownException

    def destroy_node(self) -> None:
        """Let the sending thread end first."""
        self.context.try_shutdown()
        self._thread.join(timeout=PROGRESS_PERIOD)
        super().destroy_node()


def main(arguments: Sequence[str] | None = None) -> int:
    """Start the node: the entry point of ``ros2 run session_recorder replay``.

    It returns 0 only when everything was delivered.
    """
    made: list[ReplayNode] = []

    def make() -> ReplayNode:
        made.append(ReplayNode())
        return made[0]

    return run(make, arguments) or int(not all(node.finished for node in made))


if __name__ == "__main__":
    sys.exit(main())
