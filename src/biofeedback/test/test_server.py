"""The server against clients that no page is: malformed, flooding, silent, not reading, strangers."""  # noqa: E501

import asyncio
import json
import os
import socket
import time
from itertools import pairwise

import aiohttp
import pytest
from laboratory import Laboratory, short_protocol, until

from biofeedback.errors import AccessError
from biofeedback.session.protocol import PAPER, load_protocol
from biofeedback.web.connection_limit import LIMIT

pytestmark = pytest.mark.live

PATIENCE = 30.0


def talk(laboratory, scenario):
    """Run a coroutine function of an aiohttp session."""

    async def run():
        async with aiohttp.ClientSession(timeout=aiohttp.ClientTimeout(total=PATIENCE)) as session:
            return await scenario(session)

    return asyncio.run(asyncio.wait_for(run(), 3 * PATIENCE))


async def of_kind(page, kind, **wanted):
    while True:
        message = await asyncio.wait_for(page.receive(), PATIENCE)
        assert message.type == aiohttp.WSMsgType.TEXT, message
        content = json.loads(message.data)
        if content["type"] == "frame":
            await page.send_str("seen")
        if content["type"] == kind and all(
            content.get(key) == value for key, value in wanted.items()
        ):
            return content


async def closing(page):
    while True:
        message = await asyncio.wait_for(page.receive(), PATIENCE)
        if message.type in (
            aiohttp.WSMsgType.CLOSE,
            aiohttp.WSMsgType.CLOSED,
            aiohttp.WSMsgType.ERROR,
        ):
            return page.close_code


async def goes_on(good):
    """The others' frames still come, each later than the one before."""
    first = await of_kind(good, "frame")
    for _ in range(5):
        later = await of_kind(good, "frame")
    assert later["n"] > first["n"]


def flood(count):
    return [json.dumps({"id": k, "command": "note", "text": "x"}) for k in range(count)]


BAD = {
    "text": ["hello"],
    "unknown command": ['{"id": 1, "command": "shutdown"}'],
    "nested": ["[" * 3000],
    "too long": ["x" * 100_000],
    "bytes": [b"\x00\xff"],
    "flood": flood(2000),
}


@pytest.mark.parametrize("kind", BAD)
def test_who_sends_what_no_page_sends_is_disconnected_alone(laboratory, kind):
    async def scenario(session):
        good = await session.ws_connect(laboratory.url("/ws?role=operator"))
        await of_kind(good, "state")
        bad = await session.ws_connect(laboratory.url("/ws?role=operator"))
        for message in BAD[kind]:
            try:
                await (bad.send_bytes if isinstance(message, bytes) else bad.send_str)(message)
            except (ConnectionError, aiohttp.ClientError):
                break
        assert await closing(bad) in (1008, 1009, 1006)
        await goes_on(good)
        await good.send_json({"id": 1, "command": "arm"})
        assert (await of_kind(good, "answer"))["ok"]

    talk(laboratory, scenario)
    assert laboratory.session.state == "armed"
    if kind == "flood":
        assert len(laboratory.events) < 150  # of 2000 notes


def test_seen_without_a_frame_is_not_what_a_page_says(laboratory):
    async def scenario(session):
        page = await session.ws_connect(laboratory.url("/ws?role=subject"))
        for _ in range(100):
            await page.send_str("seen")
        assert await closing(page) == 1008

    talk(laboratory, scenario)


def test_a_busy_page_gets_the_newest_frame_not_old_ones(laboratory):
    async def scenario(session):
        page = await session.ws_connect(laboratory.url("/ws?role=subject"))
        await of_kind(page, "frame")
        await asyncio.sleep(2.0)
        waiting = [await of_kind(page, "frame") for _ in range(6)]
        return [time.time() - frame["now"] for frame in waiting[-1:]], [
            frame["n"] for frame in waiting
        ]

    (age,), numbers = talk(laboratory, scenario)
    # 60 frames were made meanwhile; the few on their way are passed, then comes the present.
    assert age < 1.0
    assert max(later - earlier for earlier, later in pairwise(numbers)) > 20


def test_a_subjects_page_has_nothing_to_say(laboratory):
    async def scenario(session):
        page = await session.ws_connect(laboratory.url("/ws?role=subject"))
        await page.send_json({"id": 1, "command": "stop"})
        assert await closing(page) == 1008

    talk(laboratory, scenario)


def test_a_refused_value_is_answered_and_the_page_stays(laboratory):
    async def scenario(session):
        page = await session.ws_connect(laboratory.url("/ws?role=operator"))
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


def test_connections_that_say_nothing_shut_nobody_out(laboratory):
    silent = []

    async def scenario(session):
        good = await session.ws_connect(laboratory.url("/ws?role=operator"))
        for _ in range(3 * LIMIT):
            silent.append(
                socket.create_connection(("127.0.0.1", laboratory.port), timeout=PATIENCE)
            )
        await goes_on(good)
        another = await session.ws_connect(laboratory.url("/ws?role=subject"))
        await goes_on(another)

    talk(laboratory, scenario)
    for one in silent:
        one.close()


def test_raw_nonsense_on_the_port_harms_nobody(laboratory):
    for content in (
        b"\x16\x03\x01\x02\x00" + os.urandom(500),
        b"GET " + b"/" * 20_000,
        b"GET / HTTP/1.1\r\n" + b"X: y\r\n" * 500,
        b"\r\n\r\n",
    ):
        with socket.create_connection(("127.0.0.1", laboratory.port), timeout=PATIENCE) as raw:
            raw.sendall(content)

    async def scenario(session):
        await goes_on(await session.ws_connect(laboratory.url("/ws?role=operator")))

    talk(laboratory, scenario)


def test_a_page_that_does_not_read_delays_nobody(laboratory):
    """Its socket fills up; the frames of the other one go on at their rate."""
    key = "dGhlIHNhbXBsZSBub25jZQ=="
    stuck = socket.socket()
    stuck.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 2048)
    stuck.connect(("127.0.0.1", laboratory.port))
    head = (
        f"GET /ws?role=operator HTTP/1.1\r\nHost: 127.0.0.1:{laboratory.port}\r\nUpgrade: "
        "websocket\r\nConnection: Upgrade\r\n"
    )
    stuck.sendall(f"{head}Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n".encode())

    async def scenario(session):
        good = await session.ws_connect(laboratory.url("/ws?role=subject"))
        first = await of_kind(good, "frame")
        began = time.monotonic()
        while time.monotonic() - began < 4.0:
            last = await of_kind(good, "frame")
        return (last["n"] - first["n"]) / 4.0

    assert talk(laboratory, scenario) > 10.0
    stuck.close()


def test_strangers_are_refused(laboratory):
    async def scenario(session):
        for headers in ({"Origin": "http://evil.example"}, {"Host": "evil.example"}):
            with pytest.raises(aiohttp.WSServerHandshakeError) as found:
                await session.ws_connect(laboratory.url("/ws?role=operator"), headers=headers)
            assert found.value.status == 403
        async with session.get(laboratory.url("/"), headers={"Host": "evil.example"}) as answer:
            assert answer.status == 403
        for path in (
            "/pages/../server.py",
            "/pages/..%2fserver.py",
            "/etc/passwd",
            "/pages/nothing.js",
        ):
            async with session.get(laboratory.url(path)) as answer:
                assert answer.status == 404

    talk(laboratory, scenario)


def test_a_token_opens_another_address_and_nothing_else_does(tmp_path):
    token = "0123456789abcdef0123"
    with pytest.raises(AccessError):
        Laboratory(short_protocol(tmp_path), host="0.0.0.0", token="short")
    laboratory = Laboratory(short_protocol(tmp_path), host="0.0.0.0", token=token)

    async def scenario(session):
        async with session.get(laboratory.url("/")) as answer:
            assert answer.status == 403
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await session.ws_connect(laboratory.url("/ws?role=operator"))
        async with session.get(laboratory.url(f"/operator?token={token}")) as answer:
            assert answer.status == 200
        # The page's own requests carry the cookie (a browser also keeps one of an address;
        # aiohttp's jar does not).
        cookie = {"Cookie": f"ankle_token={token}"}
        await of_kind(
            await session.ws_connect(laboratory.url("/ws?role=operator"), headers=cookie), "state"
        )

    try:
        talk(laboratory, scenario)
    finally:
        laboratory.close()


def test_two_operators_at_once_see_one_state(laboratory):
    """Both press at the same moment; one order of events comes out, and both end with the same
    version of it.
    """

    async def scenario(session):
        pages = [await session.ws_connect(laboratory.url("/ws?role=operator")) for _ in range(2)]
        await asyncio.gather(*(page.send_json({"id": 1, "command": "arm"}) for page in pages))
        answers = [await of_kind(page, "answer") for page in pages]
        assert sorted(answer["ok"] for answer in answers) == [False, True]
        await asyncio.gather(
            *(
                page.send_json({"id": 2, "command": "set_target", "torque[N.m]": value})
                for page, value in zip(pages, (-1, -2), strict=True)
            )
        )
        for page in pages:
            assert (await of_kind(page, "answer"))["ok"]
        states = []
        for page in pages:
            await page.send_json({"id": 3, "command": "note", "text": "done"})
            await of_kind(page, "answer")
        for page in pages:
            state = await of_kind(page, "state")
            while [entry["event"] for entry in state["log"]].count("note") < 2:
                state = await of_kind(page, "state")
            states.append(state)
        return states

    one, other = talk(laboratory, scenario)
    assert one["target"] == other["target"]
    assert one["target"]["torque"] in (-1.0, -2.0)
    assert one["session"] == other["session"]


def test_the_rig_decides_and_is_stopped_in_every_case(laboratory):
    async def scenario(session):
        page = await session.ws_connect(laboratory.url("/ws?role=operator"))

        async def say(number, name):
            await page.send_json({"id": number, "command": name})
            return await of_kind(page, "answer", id=number)

        laboratory.rig.refuses = "emergency stop is pressed"
        refused = await say(1, "arm")
        assert refused["error"] == "test_rig refuses to arm: emergency stop is pressed"
        assert laboratory.session.state == "idle"
        laboratory.rig.refuses = ""
        assert (await say(2, "arm"))["ok"]
        assert (await say(3, "start"))["ok"]
        assert (await say(4, "stop"))["ok"]

    talk(laboratory, scenario)
    assert laboratory.rig.told == ["arm", "arm", "start", "stop"]
    assert laboratory.session.state == "idle"


@pytest.mark.parametrize(
    ("event", "words"),
    [("fault", "the rig is not running: fault: encoder stuck"), ("gone", "driver is gone")],
)
def test_a_session_stops_when_its_rig_does(laboratory, event, words):
    async def scenario(session):
        page = await session.ws_connect(laboratory.url("/ws?role=operator"))
        for number, name in enumerate(("arm", "start")):
            await page.send_json({"id": number, "command": name})
            await of_kind(page, "answer")

    laboratory.rig.state = "armed"
    laboratory.session.protocol = load_protocol(PAPER)
    talk(laboratory, scenario)
    laboratory.rig.state = "running"
    time.sleep(2.0)
    assert laboratory.session.state == "running"
    if event == "fault":
        laboratory.rig.state = "fault: encoder stuck"
    else:
        laboratory.rig.present = False
    until(lambda: laboratory.session.state == "idle", "the stop")
    stopped = next(one for one in laboratory.events if one.event == "session stopped")
    assert words in stopped.details["reason"]


def test_a_break_stops_the_rig_by_itself(laboratory):
    async def scenario(session):
        page = await session.ws_connect(laboratory.url("/ws?role=operator"))
        for number, name in enumerate(("arm", "start")):
            await page.send_json({"id": number, "command": name})
            await of_kind(page, "answer")
        until(lambda: laboratory.session.state == "paused", "the break", 60.0)

    talk(laboratory, scenario)
    until(
        lambda: laboratory.rig.told == ["arm", "start", "stop"],
        f"the stop in {laboratory.rig.told}",
    )
