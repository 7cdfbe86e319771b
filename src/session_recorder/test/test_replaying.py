"""Flow control, pace and choice of topics of a replay, without ROS."""

import threading
import time

import pytest

from session_recorder.bag_reader import BagReader
from session_recorder.errors import BagError
from session_recorder.flow_control import WINDOW, Flow
from session_recorder.replaying import Replay, choose_topics

pytestmark = pytest.mark.live


class Queue:
    """A reader with a queue of 64 that forgets the oldest, as DDS with keep-last 64, and processes
    one message at a time.
    """

    def __init__(self, flow, delay):
        self.flow, self.delay = flow, delay
        self.waiting, self.done, self.overwritten = [], [], 0
        self.lock = threading.Lock()
        self.open = True
        self.thread = threading.Thread(target=self.work, daemon=True)
        self.thread.start()

    def put(self, message):
        with self.lock:
            self.waiting.append((time.time_ns(), message))
            if len(self.waiting) > 64:
                self.waiting.pop(0)
                self.overwritten += 1

    def work(self):
        while self.open:
            with self.lock:
                taken = self.waiting.pop(0) if self.waiting else None
            if taken is None:
                time.sleep(1e-4)
                continue
            time.sleep(self.delay)
            self.done.append(taken[1])
            if self.flow is not None:
                self.flow.acknowledged(f"/reader {id(self)}", taken[0])


class Outlet:
    def __init__(self):
        self.queues, self.sent, self.times = {}, [], []

    def send(self, topic, message):
        self.sent.append((topic, message))
        for queue in self.queues.get(topic, ()):
            queue.put(message)

    def clock(self, now_ns):
        self.times.append(now_ns)

    def delivered(self, topic, patience):
        return True


def replay(reader, outlet, rate=0.0, flows=None, patience=5.0, going_on=lambda: True):
    return Replay(reader, list(reader.topics), rate, flows or {}, outlet, patience, going_on)


def under_way(flow):
    """Messages that the slowest reader has not acknowledged."""
    return next(number for number in range(10) if flow.wait(number, 0.0, lambda: False))


def test_two_readers_of_different_speed_lose_nothing(make_bag):
    reader = BagReader(make_bag(blocks=300))
    flow = Flow(2)
    outlet = Outlet()
    outlet.queues["/ankle/samples"] = readers = [Queue(flow, 1e-3), Queue(flow, 0)]
    assert replay(reader, outlet, flows={"/ankle/samples": flow}).run()
    expected = [data for _, _, data in reader.messages(["/ankle/samples"])]
    for queue in readers:
        queue.open = False
        assert queue.done == expected
        assert queue.overwritten == 0
    assert under_way(flow) == 0


def test_without_flow_control_the_same_reader_loses(make_bag):
    reader = BagReader(make_bag(blocks=300))
    outlet = Outlet()
    outlet.queues["/ankle/samples"] = [queue] = [Queue(None, 1e-3)]
    assert replay(reader, outlet).run()
    queue.open = False
    assert queue.overwritten > 0


def test_a_reader_that_stops_is_named(make_bag):
    flow = Flow(2)
    outlet = Outlet()
    outlet.queues["/ankle/samples"] = [Queue(flow, 0)]
    with pytest.raises(
        BagError,
        match=rf"no progress for 0\.3 s.*/reader acknowledged {WINDOW} of {WINDOW}, 1 reader\(s\) "
        rf"never answered",
    ):
        replay(BagReader(make_bag()), outlet, flows={"/ankle/samples": flow}, patience=0.3).run()
    outlet.queues["/ankle/samples"][0].open = False


def test_what_was_acknowledged_before_this_replay_does_not_count():
    flow = Flow(1)
    flow.acknowledged("/reader 1", 500)
    for stamp in (1000, 2000, 3000):
        flow.sending(stamp)
    flow.acknowledged("/reader 1", 900)
    assert under_way(flow) == 3
    flow.acknowledged("/reader 1", 2000)
    assert under_way(flow) == 1
    flow.acknowledged("/reader 1", 1500)
    assert under_way(flow) == 1


def test_pace_is_kept_and_clock_is_monotonic_and_never_ahead(make_bag):
    reader = BagReader(make_bag(blocks=32))
    outlet = Outlet()
    began = time.monotonic()
    assert replay(reader, outlet, rate=1.0).run()
    assert time.monotonic() - began >= reader.duration
    assert outlet.times == sorted(outlet.times)
    assert outlet.times[0] == reader.start_ns
    assert outlet.times[-1] <= reader.end_ns
    assert [message for _, message in outlet.sent] == [data for _, _, data in reader.messages()]


def test_ending_early_is_no_success(make_bag):
    outlet = Outlet()
    assert not replay(BagReader(make_bag()), outlet, going_on=lambda: len(outlet.sent) < 5).run()
    assert len(outlet.sent) == 5


def test_choice_of_topics(make_bag):
    reader = BagReader(make_bag())
    assert choose_topics(reader, "") == ["/perturbation/reference", "/ankle/samples"]
    assert choose_topics(reader, " /ankle/samples ,") == ["/ankle/samples"]
    assert sorted(choose_topics(reader, "all")) == ["/ankle/samples", "/perturbation/reference"]
    with pytest.raises(BagError, match="has no topic '/x'"):
        choose_topics(reader, "/ankle/samples,/x")
