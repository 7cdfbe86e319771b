"""What a replay sends, and when. No ROS."""

from __future__ import annotations

import time
from collections.abc import Callable, Collection, Mapping
from typing import Protocol

from ankle_interfaces.topics import CLOCK, DIAGNOSTICS, INPUTS
from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError
from session_recorder.flow_control import Flow

# What the outside world gave to the session; everything else was computed from it and is computed
# again.
RECORDED_INPUTS = tuple(topic.absolute for topic in INPUTS)
# Topics that ROS itself writes and that would mix with those of the running graph.
ROS_TOPICS = (CLOCK.name, "/rosout", "/parameter_events", DIAGNOSTICS.name)
ALL_TOPICS = "all"
CLOCK_STEP = (
    5_000_000  # ns of bag time between two messages on /clock: finer than the blocks' 15.6 ms
)
LONGEST_CLOCK_PERIOD = 0.02  # s; /clock goes on at least this often while nothing is due


def choose_topics(reader: BagReader, wanted: str) -> list[str]:
    """Return the topics to replay.

    Parameters
    ----------
    reader
        Reader of the bag.
    wanted
        Names joined by commas; empty takes the recorded inputs that the bag holds; ``all`` takes
        everything but what ROS writes about itself.

    Raises
    ------
    BagError
        A named topic that is not there; nothing to replay.
    """
    names = [name.strip() for name in wanted.split(",") if name.strip()]
    if names == [ALL_TOPICS]:
        names = [name for name in reader.topics if name not in ROS_TOPICS]
    elif not names:
        names = [name for name in RECORDED_INPUTS if name in reader.topics]
        if not names:
            reader.topic(RECORDED_INPUTS[1])
    for name in names:
        reader.topic(name)
    return names


class Outlet(Protocol):
    """Describes the place that a replay sends to: the graph, or a test."""

    def send(self, topic: str, message: bytes) -> None:
        """Publish a message."""

    def clock(self, now_ns: int) -> None:
        """Publish the time [ns] on /clock."""

    def delivered(self, topic: str, patience: float) -> bool:
        """Wait until the middleware has handed everything to the readers' queues.

        The result is False after `patience` [s].
        """


class Replay:
    """Sends messages of a bag in order.

    Each is sent when it is due, and no further ahead than its readers allow.

    Parameters
    ----------
    reader
        Reader of the bag.
    topics
        Absolute names of the topics that are sent.
    rate
        Bag seconds per second; 0 is as fast as the readers follow.
    flows
        Of the topics whose readers report how far they are.
    outlet
        Takes the messages that are due.
    patience
        Time [s] that a reader may take for one message.
    going_on
        Asked while waiting; False ends the replay.

    Attributes
    ----------
    sent
        Messages so far.
    behind
        Longest delay so far [s] against the pace.
    """

    def __init__(
        self,
        reader: BagReader,
        topics: Collection[str],
        rate: float,
        flows: Mapping[str, Flow],
        outlet: Outlet,
        patience: float,
        going_on: Callable[[], bool],
    ) -> None:
        self._reader, self._topics, self._rate, self._flows, self._outlet = (
            reader,
            topics,
            rate,
            flows,
            outlet,
        )
        self._patience, self._going_on = patience, going_on
        self._time_ns = -CLOCK_STEP
        self._begin_ns: int | None = None
        self._began = 0.0
        self.sent = 0
        self.behind = 0.0

    @property
    def elapsed(self) -> float:
        """Return the bag time replayed so far [s]."""
        return 0.0 if self._begin_ns is None else (self._time_ns - self._begin_ns) * 1e-9

    def run(self) -> bool:
        """Replay everything.

        Returns
        -------
        bool
            True when everything was sent and acknowledged, False when `going_on` ended it.

        Raises
        ------
        BagError
            A reader does not follow; the bag is damaged.
        """
        for topic, log_time, message in self._reader.messages(self._topics):
            self._wait_until_due(log_time)
            flow = self._flows.get(topic)
            if flow is not None:
                self._let_follow(topic, flow.window - 1)
                flow.sending(time.time_ns())
            if not self._going_on():
                return False
            self._tick(log_time, CLOCK_STEP)
            self._outlet.send(topic, message)
            self.sent += 1
        for topic in self._topics:
            if topic in self._flows:
                self._let_follow(topic, 0)
        for topic in self._topics:
            if not self._outlet.delivered(topic, self._patience) and self._going_on():
                raise BagError(
                    f"{topic}: a reader's queue did not take the messages within "
                    f"{self._patience:g} s (reader_timeout)"
                )
        return self._going_on()

    def _wait_until_due(self, log_time: int) -> None:
        if self._begin_ns is None:
            self._begin_ns, self._began = log_time, time.monotonic()
        if self._rate <= 0:
            return
        due = self._began + (log_time - self._begin_ns) * 1e-9 / self._rate
        while (left := due - time.monotonic()) > 0 and self._going_on():
            time.sleep(min(left, LONGEST_CLOCK_PERIOD))
            passed = (time.monotonic() - self._began) * self._rate
            self._tick(min(self._begin_ns + round(passed * 1e9), log_time), CLOCK_STEP)
        self.behind = max(self.behind, time.monotonic() - due)

    def _tick(self, now_ns: int, step: int) -> None:
        if now_ns - self._time_ns >= step:
            self._time_ns = now_ns
            self._outlet.clock(now_ns)

    def _let_follow(self, topic: str, at_most: int) -> None:
        flow = self._flows[topic]
        if not flow.wait(at_most, self._patience, self._going_on) and self._going_on():
            raise BagError(
                f"{topic}: a reader made no progress for {self._patience:g} s (reader_timeout): "
                f"{flow.laggards()}"
            )
