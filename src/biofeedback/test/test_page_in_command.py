"""What pages may command over a running server, where the rig decides."""

import asyncio
import time

import pytest
from page_client import closing, goes_on, of_kind, operator, say, talk

from biofeedback.session.protocol import PAPER, load_protocol

pytestmark = [pytest.mark.live, pytest.mark.untimed]


@pytest.mark.parametrize("command", ["arm", "start", "claim", "set_target", "next"])
def test_a_subjects_page_cannot_command(laboratory, command):
    async def scenario(session):
        page = await session.ws_connect(laboratory.url("/ws?role=subject"))
        await page.send_json({"id": 1, "command": command})
        assert await closing(page) == 1008

    talk(laboratory, scenario)
    assert laboratory.rig.requests == []


def test_a_page_that_is_not_in_command_may_only_stop_and_note(laboratory):
    async def scenario(session):
        one = await operator(session, laboratory)
        other = await session.ws_connect(laboratory.url("/ws?role=operator"))
        assert "another page is in command" in (await say(other, 1, "arm"))["error"]
        assert (await say(other, 2, "note", text="seen"))["ok"]
        assert (await say(other, 3, "stop"))["ok"]
        assert (await say(other, 4, "claim"))["ok"]
        assert not (await say(one, 5, "arm"))["ok"]
        assert (await say(other, 6, "arm"))["ok"]

    talk(laboratory, scenario)
    assert laboratory.rig.requests == ["stop", "arm"]


def test_a_refused_value_is_answered_and_the_page_stays(laboratory):
    async def scenario(session):
        page = await operator(session, laboratory)
        await page.send_json({"id": 5, "command": "set_target", "torque[N.m]": 400})
        answer = await of_kind(page, "answer")
        assert answer == {
            "type": "answer",
            "id": 5,
            "ok": False,
            "error": "torque[N.m] = 400 is refused; allowed: -30 to 30",
        }
        await page.send_json({"id": 6, "command": "pause"})
        assert "while the session is idle" in (await of_kind(page, "answer"))["error"]
        await goes_on(page)

    talk(laboratory, scenario)


def test_two_operators_at_once_see_one_state(laboratory):
    """Both press at the same moment; one order of events comes out, and both end with the same
    version of it.
    """

    async def scenario(session):
        pages = [await session.ws_connect(laboratory.url("/ws?role=operator")) for _ in range(2)]
        await asyncio.gather(*(page.send_json({"id": 1, "command": "claim"}) for page in pages))
        for page in pages:
            assert (await of_kind(page, "answer"))["ok"]
        await asyncio.gather(*(page.send_json({"id": 2, "command": "arm"}) for page in pages))
        answers = [await of_kind(page, "answer", id=2) for page in pages]
        assert sorted(answer["ok"] for answer in answers) == [False, True]
        states = []
        for page in pages:
            await say(page, 3, "note", text="done")
        for page in pages:
            state = await of_kind(page, "state")
            while [entry["event"] for entry in state["log"]].count("note") < 2:
                state = await of_kind(page, "state")
            states.append(state)
        return states

    one, other = talk(laboratory, scenario)
    assert one["session"] == other["session"]
    assert one["session"]["state"] == "armed"
    assert laboratory.rig.requests == ["arm"]


def test_the_rig_decides_and_is_stopped_in_every_case(laboratory):
    async def scenario(session):
        page = await operator(session, laboratory)
        laboratory.rig.refuses = "emergency stop is pressed"
        refused = await say(page, 1, "arm")
        assert refused["error"] == "test_rig refuses to arm: emergency stop is pressed"
        assert laboratory.session.state == "idle"
        laboratory.rig.refuses = ""
        assert (await say(page, 2, "arm"))["ok"]
        assert (await say(page, 3, "start"))["ok"]
        assert (await say(page, 4, "stop"))["ok"]

    talk(laboratory, scenario)
    assert laboratory.rig.requests == ["arm", "arm", "start", "stop"]
    # The rig stops at once; the session follows in its own thread.
    due = time.monotonic() + 5.0
    while laboratory.session.state != "idle" and time.monotonic() < due:
        time.sleep(0.01)
    assert laboratory.session.state == "idle"


@pytest.mark.parametrize(
    ("event", "words"),
    [("fault", "the rig is not running: fault: encoder stuck"), ("gone", "driver is gone")],
)
def test_a_session_stops_when_its_rig_does(laboratory, event, words):
    async def scenario(session):
        page = await operator(session, laboratory)
        for number, name in enumerate(("arm", "start"), start=1):
            assert (await say(page, number, name))["ok"]

        laboratory.rig.state = "running"
        watching = asyncio.create_task(of_kind(page, "never"))
        await asyncio.sleep(2.0)
        assert laboratory.session.state == "running"
        if event == "fault":
            laboratory.rig.state = "fault: encoder stuck"
        else:
            laboratory.rig.present = False
        while laboratory.session.state != "idle":
            await asyncio.sleep(0.02)
        watching.cancel()

    laboratory.rig.state = "armed"
    laboratory.session.protocol = load_protocol(PAPER)
    talk(laboratory, scenario)
    stopped = next(one for one in laboratory.events if one.event == "session stopped")
    assert words in stopped.details["reason"]


def test_a_break_stops_the_rig_by_itself(laboratory):
    async def scenario(session):
        page = await operator(session, laboratory)
        for number, name in enumerate(("arm", "start"), start=1):
            assert (await say(page, number, name))["ok"]
        while (await of_kind(page, "state"))["session"]["state"] != "paused":
            pass
        assert laboratory.rig.requests == ["arm", "start", "stop"]

    talk(laboratory, scenario)
