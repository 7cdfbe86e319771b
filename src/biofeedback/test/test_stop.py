"""A stop reaches the rig whatever else is going on, and what nobody watches stops by itself."""

import asyncio
import json
import threading
import time

import pytest
from laboratory import until
from page_client import of_kind, operator, say, talk
from virtual_session import short_session

from biofeedback.errors import CommandError
from biofeedback.session import rig_agreement, saved_session
from biofeedback.session.commands import BURST, Command
from biofeedback.session.drivers import NO_DRIVER, Drivers
from biofeedback.session.operator_watch import MAX_UNWATCHED_TIME
from biofeedback.session.rig_agreement import RESUME_PATIENCE, WATCH_AFTER_LOST_ANSWER
from biofeedback.session.session_program import IDLE, RUNNING


@pytest.fixture
def virtual(tmp_path):
    return short_session(tmp_path)


# ----- nothing stands before a stop -----


@pytest.mark.live
def test_a_stop_overtakes_a_start_that_is_not_answered(laboratory):
    async def scenario(session):
        page = await operator(session, laboratory)
        assert (await say(page, 1, "arm"))["ok"]
        laboratory.rig.answers.clear()
        await page.send_json({"id": 2, "command": "start"})
        await page.send_json({"id": 3, "command": "note", "text": "behind the start"})
        while laboratory.rig.requests[-1] != "start":
            await asyncio.sleep(0.01)
        await page.send_json({"id": 4, "command": "stop"})
        assert (await of_kind(page, "answer"))["id"] == 4  # before the start has its answer
        assert laboratory.rig.requests == ["arm", "start", "stop"]
        while laboratory.session.state != IDLE:
            await asyncio.sleep(0.01)
        laboratory.rig.answers.set()
        late = await of_kind(page, "answer", id=2)
        assert "stopped while the rig was asked to start" in late["error"]

    talk(laboratory, scenario)
    # The start that was carried out after all is stopped once more.
    assert laboratory.rig.requests[:4] == ["arm", "start", "stop", "stop"]
    assert laboratory.session.state == IDLE


@pytest.mark.live
def test_a_stop_counts_against_no_limit(laboratory):
    count = int(5 * BURST)

    async def scenario(session):
        page = await operator(session, laboratory)
        for number in range(1, count + 1):
            await page.send_json({"id": number, "command": "stop"})
        assert (await of_kind(page, "answer", id=count))["ok"]
        assert (await say(page, count + 1, "arm"))["ok"]

    talk(laboratory, scenario)
    assert laboratory.rig.requests.count("stop") == count
    # One line in the recording, not two hundred.
    assert [event.event for event in laboratory.events].count("session stopped") == 1


@pytest.mark.live
@pytest.mark.parametrize("message", ["stop", '{"id": 1, "command": "stop", "now": true}'])
def test_the_subjects_page_stops(laboratory, message):
    async def scenario(session):
        one = await operator(session, laboratory)
        for number, name in enumerate(("arm", "start"), start=1):
            assert (await say(one, number, name))["ok"]
        subject = await session.ws_connect(laboratory.url("/ws?role=subject"))
        await subject.send_str(message)
        while (await of_kind(subject, "state"))["session"]["state"] != IDLE:
            pass

    talk(laboratory, scenario)
    assert laboratory.rig.requests == ["arm", "start", "stop"]


@pytest.mark.live
def test_a_stop_has_a_second_way_by_request(laboratory):
    async def scenario(session):
        async with session.post(
            laboratory.url("/stop"), headers={"Origin": "http://evil.example"}
        ) as answer:
            assert answer.status == 403
        assert laboratory.rig.requests == []
        async with session.post(laboratory.url("/stop")) as answer:
            assert answer.status == 200

    talk(laboratory, scenario)
    assert laboratory.rig.requests == ["stop"]


@pytest.mark.live
def test_a_session_that_is_busy_does_not_delay_a_stop(laboratory):
    """The session's thread is held up for a second: the rig is stopped by the page's."""

    async def scenario(session):
        page = await session.ws_connect(laboratory.url("/ws?role=subject"))
        await of_kind(page, "state")
        held = threading.Event()
        laboratory.runner._loop.call_soon_threadsafe(lambda: (held.set(), time.sleep(1.0)))
        assert await asyncio.to_thread(held.wait, 5.0)
        asked = time.monotonic()
        await page.send_str(json.dumps({"id": 1, "command": "stop"}))
        assert (await of_kind(page, "answer"))["ok"]
        return asked

    asked = talk(laboratory, scenario)
    assert laboratory.rig.stopped_at[0] - asked < 0.8


def test_a_slow_disk_delays_nothing_but_the_file(tmp_path, monkeypatch):
    written = []
    released = threading.Event()

    def slow(path, content, now):
        released.wait(5.0)
        written.append(content["index"])

    monkeypatch.setattr(saved_session, "save", slow)
    writer = saved_session.ProgressWriter(tmp_path / "state.json", lambda reason: None)
    began = time.monotonic()
    for index in range(1000):
        writer.keep({"index": index})
    assert time.monotonic() - began < 2.0
    released.set()
    writer.close()
    assert written[-1] == 999
    assert len(written) <= 3


# ----- answers that do not come -----


def test_a_start_without_an_answer_ends_in_a_stop_and_is_watched(virtual, monkeypatch):
    monkeypatch.setattr(rig_agreement, "ANSWER_TIMEOUT", 0.05)
    virtual.command("arm")
    virtual.rig.answers.clear()
    with pytest.raises(CommandError, match="no answer from the rig within"):
        virtual.command("start")
    assert virtual.session.state == IDLE
    assert virtual.rig.requests == ["arm", "start", "stop"]
    # The start was carried out late, after the stop.
    virtual.rig.state = "running"
    virtual.pass_time(1.0)
    assert virtual.rig.requests[3:] == ["stop", "stop"]
    virtual.rig.state = "ready"
    count = len(virtual.rig.requests)
    virtual.pass_time(WATCH_AFTER_LOST_ANSWER)
    assert len(virtual.rig.requests) == count


def test_a_start_that_is_cancelled_ends_in_a_stop(virtual):
    virtual.command("arm")
    virtual.rig.answers.clear()

    async def cancel():
        task = asyncio.create_task(virtual.runner.carry_out(Command(1, "start", {})))
        await asyncio.sleep(0.05)
        task.cancel()
        with pytest.raises(asyncio.CancelledError):
            await task

    asyncio.run(cancel())
    assert virtual.rig.requests == ["arm", "start", "stop"]
    assert virtual.session.state == IDLE


def test_a_resumed_session_follows_its_rig_at_once(virtual, tmp_path):
    virtual.run()
    saved = virtual.session.saved()
    again = short_session(tmp_path)
    again.rig.state = "ready: stopped by its watchdog"
    again.runner.resume(saved, again.now)
    again.pass_time(RESUME_PATIENCE + 0.2)
    assert again.session.state == IDLE
    assert "the rig is not running: ready" in again.session.stop_reason


# ----- the operator's dead-man's switch -----


def test_a_session_that_nobody_watches_stops(virtual):
    virtual.run()
    virtual.operator = False
    virtual.pass_time(MAX_UNWATCHED_TIME - 0.3)
    assert virtual.session.state == RUNNING
    virtual.pass_time(0.5)
    assert virtual.session.state == IDLE
    assert virtual.rig.requests == ["arm", "start", "stop"]
    assert "no operator's page" in virtual.session.stop_reason


def test_an_armed_session_that_nobody_watches_is_disarmed(virtual):
    virtual.command("arm")
    virtual.operator = False
    virtual.pass_time(MAX_UNWATCHED_TIME + 0.2)
    assert virtual.session.state == IDLE
    assert virtual.rig.requests == ["arm", "stop"]


def test_nothing_is_armed_without_an_operators_page(virtual):
    virtual.operator = False
    virtual.pass_time(MAX_UNWATCHED_TIME + 0.2)
    with pytest.raises(CommandError, match="no operator's page"):
        virtual.command("arm")
    assert virtual.rig.requests == []


def test_the_heartbeat_lasts_as_long_as_an_operators_page(virtual):
    virtual.pass_time(3.0)
    heartbeats = [when for when, _ in virtual.rig.heartbeats]
    assert 25 <= len(heartbeats) <= 35
    assert len({session_id for _, session_id in virtual.rig.heartbeats}) == 1
    virtual.operator = False
    virtual.pass_time(1.0)
    count = len(virtual.rig.heartbeats)
    virtual.pass_time(3.0)
    assert len(virtual.rig.heartbeats) == count


@pytest.mark.live
def test_closing_the_last_operators_page_stops(laboratory):
    async def scenario(session):
        page = await operator(session, laboratory)
        for number, name in enumerate(("arm", "start"), start=1):
            assert (await say(page, number, name))["ok"]
        await page.close()

    talk(laboratory, scenario)
    until(lambda: laboratory.session.state == IDLE, "the stop")
    assert laboratory.rig.requests == ["arm", "start", "stop"]


@pytest.mark.live
def test_a_page_that_hangs_is_no_operator(laboratory):
    """Its connection stays open, but it acknowledges nothing."""

    async def scenario(session):
        page = await operator(session, laboratory)
        for number, name in enumerate(("arm", "start"), start=1):
            assert (await say(page, number, name))["ok"]
        for _ in range(60):
            if laboratory.session.state == IDLE:
                return
            await asyncio.sleep(0.1)

    talk(laboratory, scenario)
    assert laboratory.session.state == IDLE
    assert "no operator's page" in laboratory.session.stop_reason


# ----- drivers -----

ALL = ("arm", "start", "stop")


def test_two_drivers_are_a_named_fault_and_both_are_known():
    drivers = Drivers()
    drivers.update({"one": ALL})
    assert drivers.selected == "one"
    drivers.update({"one": ALL, "two": ALL})
    assert drivers.selected is None
    assert drivers.several
    assert "2 rig drivers are in this graph (one, two)" in drivers.problem
    assert drivers.known == ["one", "two"]


def test_a_named_driver_does_not_hide_a_second_one():
    drivers = Drivers("one")
    drivers.update({"one": ALL, "two": ALL})
    assert drivers.selected is None
    assert drivers.several


def test_a_driver_whose_services_are_lost_stays_known():
    drivers = Drivers()
    drivers.update({"one": ALL})
    drivers.update({"one": ("arm", "stop")})
    assert drivers.selected == "one"
    assert drivers.problem == "one does not offer start at the moment"
    drivers.update({})
    assert drivers.selected is None
    assert drivers.problem == NO_DRIVER
    assert drivers.known == ["one"]


def test_a_node_that_only_stops_is_no_driver():
    drivers = Drivers()
    drivers.update({"recorder": ("stop",)})
    assert drivers.known == []


def test_a_second_driver_ends_the_session_and_is_recorded_once(virtual):
    virtual.run()
    virtual.rig.several = True
    virtual.pass_time(1.0)
    assert virtual.session.state == IDLE
    faults = [event for event in virtual.events if event.event == "fault"]
    assert [fault.details["node"] for fault in faults] == ["rig"]
    assert virtual.rig.requests == ["arm", "start", "stop"]
    with pytest.raises(CommandError, match="2 rig drivers"):
        virtual.command("arm")


def test_a_session_that_was_armed_without_a_rig_does_not_go_on_with_one(virtual):
    virtual.rig.present = False
    virtual.command("arm")
    virtual.rig.present, virtual.rig.state = True, "ready"
    virtual.pass_time(0.1)
    assert virtual.session.state == IDLE
    assert "a rig driver has appeared" in virtual.session.stop_reason
    assert virtual.rig.requests == ["stop"]


def test_a_start_that_is_refused_again_and_again_does_not_keep_a_session_armed(virtual):
    virtual.command("arm")
    virtual.pass_time(0.5)
    virtual.rig.refuses, virtual.rig.state = "the line is lost", "disabled: the line is lost"
    for _ in range(6):
        if virtual.session.state == IDLE:
            break
        with pytest.raises(CommandError, match="the line is lost"):
            asyncio.run(virtual.runner.carry_out(Command(1, "start", {})))
        virtual.pass_time(0.5)
    assert virtual.session.state == IDLE
    assert virtual.rig.requests[-1] == "stop"


def test_a_session_whose_tick_fails_stops_the_rig(tmp_path):
    made = short_session(tmp_path)
    made.session.tick = None  # any failure
    made.runner.start()
    until(lambda: "stop" in made.rig.requests, "the stop")
    made.runner.close()
