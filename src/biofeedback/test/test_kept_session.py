"""What the node hands on and keeps of a session: its events and its progress."""

from ankle_node.session_event import SessionEvent
from biofeedback.session.event_outbox import DISCOVERY, LONGEST_DISCOVERY, EventOutbox
from biofeedback.session.saved_session import SAVE_PERIOD, ProgressKeeper, worth_resuming


def test_events_wait_for_a_reader_but_not_for_ever():
    now, readers, logged, sent, woken = [0.0], [0], [], [], []
    outbox = EventOutbox(
        logged.append, sent.append, lambda: readers[0], lambda: woken.append(1), lambda: now[0]
    )
    outbox.put(SessionEvent("note", 1.0))
    assert woken
    outbox.send()
    assert (len(logged), sent) == (1, [])
    now[0], readers[0] = DISCOVERY + 0.1, 1
    outbox.send()
    assert len(sent) == 1
    readers[0] = 0
    outbox.put(SessionEvent("note", 2.0))
    outbox.send()
    assert len(sent) == 1
    now[0] = LONGEST_DISCOVERY + 0.1
    outbox.send()
    assert (len(logged), len(sent)) == (2, 2)


def test_progress_is_written_at_steps_and_once_a_second(tmp_path):
    now, written = [0.0], []
    start = {"index": 0, "elapsed": 0.0}
    keeper = ProgressKeeper(tmp_path / "p.json", start, print, lambda: now[0])
    keeper.close()
    keeper._writer.keep = written.append
    keeper.keep({"index": 0, "elapsed": 0.1})
    assert written == []
    keeper.keep({"index": 1, "elapsed": 0.0})
    assert len(written) == 1
    now[0] = SAVE_PERIOD + 0.1
    keeper.keep({"index": 1, "elapsed": 0.9})
    keeper.keep({"index": 1, "elapsed": 0.9})
    assert len(written) == 2


def test_only_a_session_that_got_anywhere_is_resumed():
    assert not worth_resuming(None)
    assert not worth_resuming({"state": "idle", "index": 0, "checks": {}})
    assert worth_resuming({"state": "idle", "index": 0, "checks": {"zero": {}}})
    assert worth_resuming({"state": "running", "index": 0})
