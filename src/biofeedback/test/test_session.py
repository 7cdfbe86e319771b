"""Protocol and session: what the program leads through, what it writes, what a restart does."""

import contextlib
import json
import math
import time

import pytest
from hypothesis import settings
from hypothesis.stateful import RuleBasedStateMachine, invariant, precondition, rule

from ankle_node.session_event import HOLD_ENDED, HOLD_STARTED, TORQUE_TARGET, parse
from biofeedback.errors import CommandError, ProtocolError
from biofeedback.session.axis_calibration import SMALLEST_BASELINE, BaselineCollector, torque_axis
from biofeedback.session.guidance import Guidance, direction, instruction
from biofeedback.session.protocol import BASELINE, BREAK, HOLD, PAPER, REACH, load_protocol
from biofeedback.session.saved_session import default_path, save
from biofeedback.session.session_files import SessionFiles
from biofeedback.session.session_program import ARMED, FINISHED, IDLE, PAUSED, RUNNING, Session
from biofeedback.session.target import Reading, Target
from session_analysis.holds import find_holds

GOOD = Reading(80.0, 8.0, 0.3, True)
PERIOD = 1 / 30


def through(session, seconds, start, reading=GOOD):
    events = []
    for k in range(round(seconds / PERIOD)):
        events += session.tick(start + (k + 1) * PERIOD, reading)
    return events, start + round(seconds / PERIOD) * PERIOD


def test_the_papers_protocol():
    protocol = load_protocol(PAPER)
    blocks = {
        n: sum(step.duration for step in protocol.steps if step.block == n and step.kind != BREAK)
        for n in range(1, 5)
    }
    assert protocol.blocks == 4
    assert all(600.0 <= length <= 750.0 for length in blocks.values()), blocks
    assert {step.duration for step in protocol.steps if step.kind == HOLD} == {60.0}
    assert all(150.0 <= step.duration <= 300.0 for step in protocol.steps if step.kind == BREAK)
    assert protocol.targets == [-5.0, 0.0]
    assert {step.feedback for step in protocol.steps} == {"K", "G"}


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("feedback: G", "feedback: B"), "feedback = 'B' is refused"),
        (("feedback: G", "feedback: {G: 1}"), r"feedback = \{'G': 1\} is refused"),
        (('"hold[s]": 2', '"hold[s]": 9999'), r"hold\[s\] = 9999 is refused; allowed: 1 to 600"),
        (
            ('"level[1]": 0.7', '"level[1]": none'),
            r"block 1, hold 2: level\[1\] = 'none' is refused",
        ),
        (('"level[1]": 0.7', '"height[1]": 1'), "unknown key"),
        (('"reach[s]": 1\n', ""), r"'reach\[s\]' is missing"),
        (("blocks:", "- blocks:"), "not YAML"),
    ],
)
def test_mistakes_in_a_protocol_are_named(tmp_path, change, words):
    from laboratory import short_protocol

    short_protocol(tmp_path)
    path = tmp_path / "short.yaml"
    path.write_text(path.read_text().replace(*change))
    with pytest.raises(ProtocolError, match=words):
        load_protocol(str(path))


def test_the_paper_session_gives_the_holds_that_the_analysis_expects():
    session = Session(load_protocol(PAPER))
    now, events = 1000.0, []
    while session.state != FINISHED:
        events += session.arm(now) + session.start(now)
        while session.state == RUNNING:
            now += 0.25
            events += session.tick(now, GOOD)
        if session.state == PAUSED:
            more, now = through(session, 10.0, now)
            events += more
    # What the analysis reads is the text.
    holds, excluded = find_holds([parse(event.line()) for event in events])
    assert not excluded
    assert [hold.number for hold in holds] == list(range(1, 21))
    assert sorted({hold.target for hold in holds}) == [-5.0, 0.0]
    assert all(abs(hold.end - hold.start - 60.0) <= 0.5 for hold in holds)


def test_levels_come_from_the_subjects_own_baseline(tmp_path):
    from laboratory import short_protocol

    session = Session(short_protocol(tmp_path))
    session.arm(0.0)
    session.start(0.0)
    _, now = through(session, 0.5, 0.0, Reading(80.0, 8.0, 0.3, False))
    assert session.step.kind == BASELINE
    assert session.elapsed == 0.0  # time without valid estimates does not count
    through(session, 1.1, now)
    assert session.step.kind == REACH
    assert session.baseline.torque == pytest.approx(0.3)
    assert session.target.lower == pytest.approx(0.85 * 8.0)
    assert session.target.upper == pytest.approx(1.15 * 8.0)


def test_a_subject_without_reflex_still_gets_an_axis():
    collector = BaselineCollector()
    for k in range(50):
        collector.add(40.0 + 0.1 * (k % 2), -0.05, 0.0)
    baseline = collector.baseline()
    assert baseline.of("G") == SMALLEST_BASELINE["G"]
    assert baseline.axis("G")[1] > baseline.axis("G")[0]
    assert torque_axis([0.0, -5.0], 1.0) == (-9.0, 4.0)


def test_own_target_holds_until_the_next_hold(tmp_path):
    from laboratory import short_protocol

    session = Session(short_protocol(tmp_path))
    session.arm(0.0)
    session.start(0.0)
    _, now = through(session, 1.2, 0.0)
    session.set_target(now, {"torque": -3.0, "lower": 2.0, "upper": 3.0})
    assert (session.target.torque, session.target.lower) == (-3.0, 2.0)
    with pytest.raises(CommandError, match="not below"):
        session.set_target(now, {"lower": 4.0})
    events = session.start_hold(now)
    assert events[0].details[TORQUE_TARGET] == -3.0
    events, now = through(session, 2.1, now)
    assert session.step.hold == 2
    assert session.target.torque == -5.0


def test_pause_breaks_a_hold_off_and_the_way_to_it_begins_again(tmp_path):
    from laboratory import short_protocol

    session = Session(short_protocol(tmp_path))
    session.arm(0.0)
    session.start(0.0)
    _, now = through(session, 2.6, 0.0)
    assert session.holding
    events = session.pause(now)
    assert [event.event for event in events] == [HOLD_ENDED, "session paused"]
    assert events[0].details["broken_off"] == "paused"
    with pytest.raises(CommandError, match="arm it first"):
        session.start(now)
    session.arm(now)
    session.start(now)
    assert (session.step.kind, session.step.hold) == (REACH, 1)


def test_an_unread_clock_moves_nothing(tmp_path):
    """A computer that slept, or a replay that jumped."""
    from laboratory import short_protocol

    session = Session(short_protocol(tmp_path))
    session.arm(0.0)
    session.start(0.0)
    session.tick(0.1, GOOD)
    session.tick(1000.0, GOOD)
    session.tick(10.0, GOOD)
    assert session.step.kind == BASELINE
    assert session.clock == 0.0


@pytest.mark.parametrize(
    ("torque", "G", "target", "hint"),
    [
        (-7.0, 8.0, -5.0, "push_less"),
        (0.1, 8.0, -5.0, "push_more"),
        (-2.0, 8.0, 0.0, "push_less"),
        (2.0, 8.0, 0.0, "lift_less"),
        (-1.0, 8.0, 4.0, "lift_more"),
        (0.0, 9.5, 0.0, "calmer"),
        (0.0, 5.0, 0.0, "livelier"),
        (0.0, 8.0, 0.0, "good"),
    ],
)
def test_the_hint_leads_to_the_target(torque, G, target, hint):
    where = Target("G", target, 1.0, 6.0, 9.0)
    assert direction(where, Reading(80.0, G, torque, True)) == hint
    assert direction(where, Reading(80.0, G, torque, False)) == ""


def test_a_hint_stays_long_enough_to_be_read():
    guidance = Guidance()
    guidance.update("push_more", 0.0)
    assert guidance.update("push_more", 1.0) == "push_more"
    assert guidance.update("push_less", 1.1) == "push_more"
    assert guidance.update("push_more", 1.2) == "push_more"
    guidance.update("push_less", 1.3)
    assert guidance.update("push_less", 2.1) == "push_less"
    assert guidance.update("", 2.2) == ""  # what is no longer true is gone at once


def test_what_the_subject_reads_after_a_stop(tmp_path):
    from laboratory import short_protocol

    session = Session(short_protocol(tmp_path))
    assert instruction(session) == "wait"
    session.arm(0.0)
    session.start(0.0)
    assert instruction(session) == "relax"
    session.stop(1.0)
    assert instruction(session) == "stopped"
    session.arm(2.0)
    session.start(2.0)
    assert instruction(session) == "relax"


def test_hits_are_holds_that_were_mostly_in_the_target(tmp_path):
    from laboratory import short_protocol

    session = Session(short_protocol(tmp_path, hold=2))
    session.arm(0.0)
    session.start(0.0)
    _, now = through(session, 2.2, 0.0, Reading(80.0, 8.0, 0.0, True))
    assert session.holding
    _, now = through(session, 2.0, now, Reading(80.0, 8.0, 0.0, True))  # in the target
    assert (session.holds_done, session.hits) == (1, 1)
    _, now = through(session, 3.2, now, Reading(80.0, 8.0, 0.0, True))  # asked for other levels
    assert (session.holds_done, session.hits) == (2, 1)


@pytest.mark.parametrize(
    "damage",
    [
        {"index": 99},
        {"state": "flying"},
        {"elapsed": "x"},
        {"baseline": {"K": 1}},
        {"own": {"speed": 1}},
        {"holds_done": 1, "hits": 2},
    ],
)
def test_a_damaged_saved_session_is_refused(tmp_path, damage):
    from laboratory import short_protocol

    protocol = short_protocol(tmp_path)
    saved = {**Session(protocol).saved(), **damage}
    with pytest.raises(CommandError, match="damaged"):
        Session(protocol).resume(saved, 0.0)


def test_what_was_measured_of_one_subject_is_not_continued_with_another(tmp_path, monkeypatch):
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    progress = {**Session(load_protocol(PAPER)).saved(), "state": PAUSED}
    save(default_path(8765, "S07", 3), progress, time.time())
    files = SessionFiles(PAPER, None, print)
    assert files.open(default_path(8765, "S08", 1), 900.0) is None
    assert files.open(default_path(8765), 900.0) is None
    assert files.open(default_path(8765, "S07", 3), 900.0)["state"] == PAUSED
    files.close()


class AnyOrder(RuleBasedStateMachine):
    """Operators, time and restarts in any order."""

    def __init__(self):
        super().__init__()
        self.protocol = load_protocol(PAPER)
        self.session = Session(self.protocol)
        self.now, self.events = 0.0, []

    def attempt(self, name):
        with contextlib.suppress(CommandError):
            self.events += getattr(self.session, name)(self.now)

    @rule()
    def arm(self):
        before = self.session.state
        self.attempt("arm")
        assert self.session.state == ARMED or before not in (IDLE, PAUSED)

    @rule()
    def start(self):
        before = self.session.state
        self.attempt("start")
        assert (self.session.state == RUNNING) == (before in (ARMED, RUNNING))

    @rule()
    def pause(self):
        self.attempt("pause")

    @rule()
    def stop(self):
        self.attempt("stop")
        assert self.session.state in (IDLE, FINISHED)

    @rule()
    def skip(self):
        self.attempt("next")

    @rule()
    def hold(self):
        self.attempt("start_hold")

    @rule()
    def end(self):
        self.attempt("end_hold")

    @precondition(lambda self: self.session.state != RUNNING)
    @rule()
    def begin_anew(self):
        self.attempt("restart")

    @rule()
    def time_passes(self):
        for _ in range(130):
            self.now += 0.5
            self.events += self.session.tick(self.now, GOOD)

    @rule()
    def restart_of_the_node(self):
        saved = json.loads(json.dumps(self.session.saved()))
        position = (self.session.step.block, self.session.step.hold)
        was, self.session = self.session.state, Session(self.protocol)
        self.events += self.session.resume(saved, self.now)
        assert (self.session.step.block, self.session.step.hold) == position
        assert self.session.state == (PAUSED if was == ARMED else was)
        if was == RUNNING and self.events[-1].event != "screen restarted":
            assert self.session.step.kind in (REACH, BASELINE)

    @invariant()
    def holds_begin_and_end_in_turn(self):
        marks = [event for event in self.events if event.event in (HOLD_STARTED, HOLD_ENDED)]
        begun = None
        for mark in marks:
            if mark.event == HOLD_STARTED:
                assert begun is None
                begun = mark
            else:
                # A hold that a restart broke off is ended by the restarted node.
                assert begun is not None
                assert begun.details["hold"] == mark.details["hold"]
                assert begun.details[TORQUE_TARGET] == mark.details[TORQUE_TARGET]
                begun = None
        assert (begun is not None) == self.session.holding

    @invariant()
    def everything_written_can_be_read(self):
        for event in self.events[-3:]:
            assert parse(event.line()) == event
        assert math.isfinite(self.session.remaining)


AnyOrder.TestCase.settings = settings(max_examples=25, stateful_step_count=25, deadline=None)
TestAnyOrder = AnyOrder.TestCase
