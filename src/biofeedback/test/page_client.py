"""A page of operator or subject without a browser, for tests of a running server."""

import asyncio
import json

import aiohttp

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
