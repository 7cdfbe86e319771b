"""The server against clients that no page is: malformed, flooding, silent."""

import asyncio
import json
import os
import socket
import time
from itertools import pairwise

import aiohttp
import pytest
from page_client import PATIENCE, closing, goes_on, of_kind, say, talk

from biofeedback.web.connection_limit import LIMIT

pytestmark = [pytest.mark.live, pytest.mark.untimed]


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
