"""The server against clients that no page is: malformed, flooding, silent, strangers."""

import asyncio
import json
import os
import socket
import ssl
import time
from itertools import pairwise

import aiohttp
import pytest
from laboratory import Laboratory, own_certificate, short_protocol

from biofeedback.errors import AccessError
from biofeedback.session.protocol import PAPER, load_protocol
from biofeedback.web.access import subject_token, tls_context
from biofeedback.web.connection_limit import LIMIT

pytestmark = [pytest.mark.live, pytest.mark.untimed]

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


async def operator(session, laboratory):
    """An operator's page in command."""
    page = await session.ws_connect(laboratory.url("/ws?role=operator"))
    await page.send_json({"id": 0, "command": "claim"})
    assert (await of_kind(page, "answer", id=0))["ok"]
    return page


async def say(page, number, name, **fields):
    await page.send_json({"id": number, "command": name, **fields})
    return await of_kind(page, "answer", id=number)


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
        assert (await say(good, 1, "claim"))["ok"]
        assert (await say(good, 2, "arm"))["ok"]

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

    async def enter(session, text):
        async with session.post(
            laboratory.url("/enter"), data={"token": text}, allow_redirects=False
        ) as answer:
            return answer.status, answer.headers.get("Set-Cookie", "").split(";")[0]

    async def scenario(session):
        for path in ("/", "/operator", f"/operator?token={token}"):
            async with session.get(laboratory.url(path), allow_redirects=False) as answer:
                assert (answer.status, answer.headers["Location"]) == (302, "/enter")
        async with session.post(laboratory.url("/stop")) as answer:
            assert answer.status == 403
        for cookie in ("", f"ankle_session={token}"):
            with pytest.raises(aiohttp.WSServerHandshakeError):
                await session.ws_connect(
                    laboratory.url("/ws?role=operator"), headers={"Cookie": cookie}
                )
        assert (await enter(session, "wrong"))[0] == 403
        status, cookie = await enter(session, token)
        assert status == 303
        assert token not in cookie
        page = await session.ws_connect(
            laboratory.url("/ws?role=operator"), headers={"Cookie": cookie}
        )
        await of_kind(page, "state")
        _, cookie = await enter(session, subject_token(token))
        with pytest.raises(aiohttp.WSServerHandshakeError):
            await session.ws_connect(
                laboratory.url("/ws?role=operator"), headers={"Cookie": cookie}
            )
        page = await session.ws_connect(
            laboratory.url("/ws?role=subject"), headers={"Cookie": cookie}
        )
        await of_kind(page, "state")

    try:
        talk(laboratory, scenario)
    finally:
        laboratory.close()


def test_no_page_may_be_framed_or_opened_by_another_site(laboratory):
    async def scenario(session):
        for path in ("/", "/operator", "/enter"):
            async with session.get(laboratory.url(path)) as answer:
                assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
                assert answer.headers["X-Frame-Options"] == "DENY"
                assert answer.headers["Cross-Origin-Opener-Policy"] == "same-origin"
            async with session.get(
                laboratory.url(path), headers={"Sec-Fetch-Site": "cross-site"}
            ) as answer:
                assert answer.status == 403

    talk(laboratory, scenario)


def test_the_laboratorys_certificate_serves_the_pages_encrypted(tmp_path):
    certificate, key = own_certificate(tmp_path)
    laboratory = Laboratory(short_protocol(tmp_path), tls=tls_context(str(certificate), str(key)))
    context = ssl.create_default_context(cafile=certificate)

    async def scenario(session):
        url = laboratory.url("/ws?role=subject").replace("http:", "https:")
        await of_kind(await session.ws_connect(url, ssl=context), "state")
        with pytest.raises(aiohttp.ClientError):
            await session.get(laboratory.url("/"))

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
